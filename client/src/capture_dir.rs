//! A capture as a folder on disk, ready to be uploaded.
//!
//! The pose track is read and checked, and every image it names is looked for, before a
//! byte is sent: a wrong unit should cost its author a second, not an upload.
//!
//! `yoto_avatar::capture::CaptureFolder` reads the same folders, and decodes them; it comes
//! with the whole model. A client without the feature `embedded` only uploads and is built
//! without a tensor library, so this small reader stands beside it. A test holds the two to
//! the same files.
//!
//! ```text
//! DIR/poses.json         or DIR/poses.pb (protocol buffers)
//! DIR/frames/000000.png …   or DIR/train/frames/…   (8-bit colour over black)
//! DIR/masks/000000.png …    or DIR/train/masks/…    (8-bit coverage)
//! ```

use crate::api::{ClientError, FileSource, UploadFile};
use std::path::Path;
use yoto_proto::correction::{Correction, Source};
use yoto_proto::pose_track::{FILE, FILES, PoseTrack, violation};
use yoto_proto::v1::Violation;

/// Where a capture's images may stand, below its folder.
const IMAGE_FOLDERS: [&str; 2] = ["train", ""];
/// Missing files named at most; a wrong folder misses all of them.
const MAX_MISSING: usize = 20;

/// A checked capture folder.
#[derive(Debug)]
pub struct CaptureDir {
    /// Who stands how in each frame.
    pub track: PoseTrack,
    /// Everything to upload, the pose track last.
    pub files: Vec<UploadFile>,
    /// Size of all files together.
    pub bytes: u64,
}

impl CaptureDir {
    /// Reads the pose track of `dir` and finds its images.
    ///
    /// # Errors
    /// [`ClientError::File`] when `poses.json` can't be read; [`ClientError::BadCapture`]
    /// with everything that is wrong with it or missing.
    pub fn open(dir: &Path) -> Result<Self, ClientError> {
        Self::open_corrected(dir, &Correction::default())
    }

    /// As [`CaptureDir::open`], with the numbers read as `correction` says: the track, and
    /// what is uploaded, are as the files should have been.
    ///
    /// # Errors
    /// As [`CaptureDir::open`], and a correction that can't be applied.
    pub fn open_corrected(dir: &Path, correction: &Correction) -> Result<Self, ClientError> {
        let bad = |violations| ClientError::BadCapture {
            place: dir.display().to_string(),
            violations,
        };
        let there = FILES.into_iter().find(|name| dir.join(name).is_file());
        let name = there.unwrap_or(FILE);
        let poses = dir.join(name);
        let bytes_of_track = std::fs::read(&poses).map_err(ClientError::file("reading", &poses))?;
        let (track, sources, uploaded) =
            read_track(name, bytes_of_track, correction).map_err(bad)?;
        let images = IMAGE_FOLDERS
            .map(|below| dir.join(below))
            .into_iter()
            .find(|root| root.join("frames").is_dir());
        let images = images.unwrap_or_else(|| dir.to_owned());

        let (name, content) = uploaded;
        let (mut files, mut missing, mut bytes) = (Vec::new(), Vec::new(), content.len() as u64);
        for (frame, source) in track.frames.iter().zip(&sources) {
            for (folder, file) in [("frames", source.image), ("masks", source.mask)] {
                let path = format!("{folder}/{:06}.png", frame.index);
                let disk = images.join(format!("{folder}/{file:06}.png"));
                match disk.metadata().ok().filter(std::fs::Metadata::is_file) {
                    Some(meta) => {
                        bytes += meta.len();
                        files.push(UploadFile {
                            path,
                            source: FileSource::Disk(disk),
                        });
                    }
                    None if missing.len() < MAX_MISSING => {
                        let message = format!("there is no such file below {}", images.display());
                        missing.push(violation("MISSING", &path, Some(frame.index), "", message));
                    }
                    None => {}
                }
            }
        }
        if !missing.is_empty() {
            return Err(bad(missing));
        }
        files.push(UploadFile {
            path: name.into(),
            source: FileSource::Memory(content),
        });
        Ok(Self {
            track,
            files,
            bytes,
        })
    }
}

/// The track that a file means under `correction`, where its pictures come from, and the file to
/// upload: as it stands where nothing is corrected, as it may say more than a track does.
///
/// Corrections come before checks: lengths in millimetres are out of range.
#[allow(clippy::type_complexity)]
fn read_track<'a>(
    name: &'a str,
    bytes: Vec<u8>,
    correction: &Correction,
) -> Result<(PoseTrack, Vec<Source>, (&'a str, Vec<u8>)), Vec<Violation>> {
    if correction.is_identity() {
        let track = PoseTrack::from_file(name, &bytes)?;
        let sources = track.frames.iter().map(|frame| Source {
            image: frame.index,
            mask: frame.index,
        });
        return Ok((track.clone(), sources.collect(), (name, bytes)));
    }
    let fault = |code: &str, message: String| vec![violation(code, name, None, "", message)];
    let track = PoseTrack::from_file_unchecked(name, &bytes)?;
    let corrected = correction
        .apply(&track)
        .map_err(|error| fault("NOT_CORRECTABLE", error.to_string()))?;
    let violations = corrected.track.check();
    if !violations.is_empty() {
        return Err(violations);
    }
    let json = serde_json::to_vec(&corrected.track)
        .map_err(|error| fault("UNREADABLE", error.to_string()))?;
    Ok((corrected.track, corrected.sources, (FILE, json)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::pose_track::{Frame, Skeleton};

    fn write_capture(dir: &Path, below: &str, break_it: fn(&mut PoseTrack)) {
        let identity = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
        let frame = |index| Frame {
            index,
            pose: vec![0.0; 3],
            translation: [0.0; 3],
            k: [[9.0, 0.0, 4.0], [0.0, 9.0, 4.0], [0.0, 0.0, 1.0]],
            e: std::array::from_fn(|i| std::array::from_fn(|j| identity(i, j))),
        };
        let skeleton = Skeleton {
            names: vec!["root".into()],
            parents: vec![-1],
            rest_joints: vec![[0.0; 3]],
        };
        let mut track = PoseTrack {
            skeleton,
            image_size: [8, 8],
            fps: 15.0,
            distortion: [0.0; 5],
            frames: vec![frame(0), frame(7)],
        };
        break_it(&mut track);
        std::fs::write(
            dir.join(FILE),
            serde_json::to_vec(&track).expect("serialises"),
        )
        .expect("writes");
        for folder in ["frames", "masks"] {
            let folder = dir.join(below).join(folder);
            std::fs::create_dir_all(&folder).expect("creates");
            for index in [0, 7] {
                std::fs::write(folder.join(format!("{index:06}.png")), b"12345").expect("writes");
            }
        }
    }

    #[test]
    fn both_layouts_upload_the_same_paths() {
        for below in ["", "train"] {
            let dir = tempfile::tempdir().expect("temporary folder");
            write_capture(dir.path(), below, |_| {});
            let capture = CaptureDir::open(dir.path()).expect("a good capture");
            let paths: Vec<&str> = capture
                .files
                .iter()
                .map(|file| file.path.as_str())
                .collect();
            let expected = [
                "frames/000000.png",
                "masks/000000.png",
                "frames/000007.png",
                "masks/000007.png",
                "poses.json",
            ];
            assert_eq!(paths, expected, "in {below:?}");
            let json = std::fs::metadata(dir.path().join(FILE))
                .expect("exists")
                .len();
            assert_eq!(capture.bytes, json + 4 * 5);
        }
    }

    #[cfg(feature = "embedded")]
    #[test]
    fn the_model_reads_the_same_files() {
        use std::collections::BTreeSet;
        use yoto_avatar::capture::CaptureFolder;
        let dir = tempfile::tempdir().expect("temporary folder");
        // A folder with both layouts, as one that was unpacked over another.
        for below in ["", "train"] {
            write_capture(dir.path(), below, |_| {});
            let capture = CaptureDir::open(dir.path()).expect("a good capture");
            let ours: BTreeSet<_> = capture
                .files
                .into_iter()
                .map(|file| {
                    let disk = match file.source {
                        FileSource::Disk(path) => path,
                        FileSource::Memory(_) => dir.path().join(FILE),
                    };
                    (file.path, disk)
                })
                .collect();
            let folder = CaptureFolder::open(dir.path()).expect("a good capture");
            let theirs = folder.files().into_iter().map(|it| (it.relative, it.path));
            assert_eq!(ours, theirs.collect(), "after {below:?}");
        }
    }

    #[test]
    fn a_missing_mask_and_a_bad_pose_are_named() {
        let dir = tempfile::tempdir().expect("temporary folder");
        write_capture(dir.path(), "", |_| {});
        std::fs::remove_file(dir.path().join("masks/000007.png")).expect("removes");
        let error = CaptureDir::open(dir.path())
            .expect_err("a mask is missing")
            .to_string();
        assert!(
            error.contains("masks/000007.png frame 7: there is no such file"),
            "{error}"
        );

        write_capture(dir.path(), "", |track| track.frames[1].pose[2] = 1e9);
        let error = CaptureDir::open(dir.path())
            .expect_err("a pose is out of range")
            .to_string();
        assert!(error.contains("poses.json frame 7: pose[2]"), "{error}");
    }
}
