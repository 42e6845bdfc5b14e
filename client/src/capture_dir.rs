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
use yoto_proto::pose_track::{FILE, FILES, PoseTrack, violation};

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
        let bad = |violations| ClientError::BadCapture {
            place: dir.display().to_string(),
            violations,
        };
        let there = FILES.into_iter().find(|name| dir.join(name).is_file());
        let name = there.unwrap_or(FILE);
        let poses = dir.join(name);
        let bytes_of_track = std::fs::read(&poses).map_err(ClientError::file("reading", &poses))?;
        let track = PoseTrack::from_file(name, &bytes_of_track).map_err(bad)?;
        let images = IMAGE_FOLDERS
            .map(|below| dir.join(below))
            .into_iter()
            .find(|root| root.join("frames").is_dir());
        let images = images.unwrap_or_else(|| dir.to_owned());

        let (mut files, mut missing, mut bytes) =
            (Vec::new(), Vec::new(), bytes_of_track.len() as u64);
        for frame in &track.frames {
            for folder in ["frames", "masks"] {
                let path = format!("{folder}/{:06}.png", frame.index);
                let disk = images.join(&path);
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
            source: FileSource::Memory(bytes_of_track),
        });
        Ok(Self {
            track,
            files,
            bytes,
        })
    }
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
