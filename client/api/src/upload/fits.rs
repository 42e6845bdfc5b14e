//! Whether a service takes an upload, found before its files are read.

use super::UploadFile;
use crate::{ClientError, YotoClient};
use yoto_proto::limits::VIOLATIONS;
use yoto_proto::media_plan::film_alone;
use yoto_proto::v1::{UploadLimits, Violation};

/// Code of a file, or of a capture, that is larger than the service allows.
const TOO_LARGE: &str = "TOO_LARGE";
/// Code of a film where no worker has a pose model.
const POSE_MODEL: &str = "POSE_MODEL";

impl YotoClient {
    /// Checks `files` against the limits that the operator of the service has set.
    ///
    /// # Errors
    /// [`ClientError::BadCapture`] with all files that are too large, or a film that needs poses; [`ClientError::File`] when a file can't be found;
    /// [`ClientError::Refused`].
    pub async fn fits(&self, files: &[UploadFile]) -> Result<(), ClientError> {
        let limits = self.limits().await?.upload.unwrap_or_default();
        let mut sizes = Vec::with_capacity(files.len());
        for file in files {
            sizes.push((file.path.as_str(), file.bytes().await?));
        }
        match violations(&limits, &sizes) {
            none if none.is_empty() => Ok(()),
            violations => Err(ClientError::BadCapture {
                place: String::new(),
                violations,
            }),
        }
    }
}

/// What `limits` forbid of these files, by path and size.
fn violations(limits: &UploadLimits, files: &[(&str, u64)]) -> Vec<Violation> {
    let fault = |file: &str, message: String| Violation {
        code: TOO_LARGE.to_owned(),
        file: file.to_owned(),
        message,
        ..Violation::default()
    };
    let mut found = Vec::new();
    if let Some(film) = film_alone(files.iter().map(|it| it.0))
        && !limits.films
    {
        found.push(Violation {
            code: POSE_MODEL.to_owned(),
            ..fault(film, "a film without poses, and no worker of this service has a pose model; `yoto import` makes a capture of it \
                           with one of yours".to_owned())
        });
    }
    let count = files.len() as u64;
    if count > limits.files {
        let most = limits.files;
        found.push(fault(
            "",
            format!("{count} files; the service takes at most {most} of a capture"),
        ));
    }
    let bytes = files.iter().fold(0_u64, |sum, it| sum.saturating_add(it.1));
    if bytes > limits.capture_bytes {
        let most = limits.capture_bytes;
        let message =
            format!("{bytes} bytes in all; the service takes at most {most} of a capture");
        found.push(fault("", message));
    }
    let large = files.iter().filter(|it| it.1 > limits.file_bytes);
    found.extend(large.take(VIOLATIONS).map(|(path, bytes)| {
        let most = limits.file_bytes;
        fault(
            path,
            format!("{bytes} bytes; the service takes at most {most} of a file"),
        )
    }));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_that_is_too_large_is_named() {
        let limits = UploadLimits {
            file_bytes: 10,
            capture_bytes: 30,
            files: 4,
            ..UploadLimits::default()
        };
        let found = |files: &[(&str, u64)]| -> Vec<String> {
            let found = violations(&limits, files);
            found.into_iter().map(|it| it.file).collect()
        };
        assert_eq!(found(&[("a", 10), ("b", 10), ("c", 10), ("d", 0)]), [""; 0]);
        assert_eq!(found(&[("a", 11), ("b", 10), ("c", 12)]), ["", "a", "c"]);
        assert_eq!(found(&[("a", 0); 5]), [""]);
        assert_eq!(found(&[("video.mp4", 0)]), ["video.mp4"]);
        assert_eq!(found(&[("video.mp4", 0), ("poses.json", 0)]), [""; 0]);
    }
}
