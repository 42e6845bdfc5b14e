//! A capture as a folder: pose track, frames, masks, and views held out for evaluation.
//!
//! `poses.json`, or `poses.pb` in protocol buffers, stands at the top. Training images are `frames/%06d.png` and
//! `masks/%06d.png`, either beside it or under `train/`. Held-out views, where there are
//! any, are `eval/<camera>/{frames,masks}` (training poses from other cameras) and
//! `eval_pose/<camera>/{frames,masks}` (poses never trained on); `poses.json` describes
//! them under `eval` and `eval_pose`.

use super::files::{at_fault, missing, read_file, read_frame};
use super::held_out::{HeldOut, HeldOutView};
use super::{CaptureError, FrameImage, Shard, ShardBuilder};
use crate::camera::Camera;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use yoto_proto::media_plan::{self, MediaPlan};
use yoto_proto::pose_track::{self, PoseTrack, violation};
use yoto_proto::v1::Violation;

/// Most missing files that an error names.
const MAX_MISSING: usize = 20;
/// Frames decoded side by side before they are cropped, so that memory holds a few only.
const DECODED_AT_ONCE: usize = 8;

/// A file to upload, with its path in the capture and on this disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UploadFile {
    /// Path inside the capture, e.g. `frames/000000.png`.
    pub relative: String,
    /// Path of the file itself.
    pub path: PathBuf,
}

/// A capture folder with a checked pose track. All its training images exist.
#[derive(Debug)]
pub struct CaptureFolder {
    root: PathBuf,
    /// The pose track's name.
    file: &'static str,
    /// `train/`, or empty if the training images are at the top.
    prefix: &'static str,
    track: PoseTrack,
    held_out_views: Vec<HeldOutView>,
    held_out_poses: Vec<HeldOutView>,
}

impl CaptureFolder {
    /// Opens a capture folder.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] with all faults of `poses.json`, or with the missing training images;
    /// [`CaptureError::Io`] if the file system fails.
    pub fn open(dir: impl AsRef<Path>) -> Result<Self, CaptureError> {
        let root = dir.as_ref().to_path_buf();
        check_plan(&root)?;
        let binary = !root.join(pose_track::FILE).is_file();
        let binary = binary && root.join(pose_track::BINARY_FILE).is_file();
        let file = pose_track::FILES[usize::from(binary)];
        let bytes = read_file(&root.join(file), file, None)?;
        let track = PoseTrack::from_file(file, &bytes).map_err(CaptureError::Invalid)?;
        if !track.is_pinhole() {
            let message = "images with lens distortion must be undistorted first";
            return Err(at_fault("distortion", message));
        }
        // Only JSON describes held-out views.
        let held_out = if binary {
            HeldOut::default()
        } else {
            HeldOut::from_json(&bytes)?
        };
        let prefix = if root.join("train/frames").is_dir() {
            "train/"
        } else {
            ""
        };
        let folder = Self {
            held_out_views: held_out.views(&root, &track)?,
            held_out_poses: held_out.poses(&root, &track)?,
            root,
            file,
            prefix,
            track,
        };
        folder.check_files()?;
        Ok(folder)
    }

    /// Whether `dir` has a `poses.json` that describes held-out pictures.
    ///
    /// # Errors
    /// If `poses.json` or its held-out parts can't be read.
    pub fn has_held_out(dir: impl AsRef<Path>) -> Result<bool, CaptureError> {
        let path = dir.as_ref().join(pose_track::FILE);
        if !path.is_file() {
            return Ok(false);
        }
        let bytes = read_file(&path, pose_track::FILE, None)?;
        Ok(!HeldOut::from_json(&bytes)?.is_empty())
    }

    /// The held-out cameras that the `poses.json` in `dir` describes, by name, at the stored images' size. Only that
    /// file is read.
    ///
    /// # Errors
    /// If the file is missing or broken.
    pub fn held_out_cameras(
        dir: impl AsRef<Path>,
    ) -> Result<BTreeMap<String, Camera>, CaptureError> {
        let path = dir.as_ref().join(pose_track::FILE);
        let bytes = read_file(&path, pose_track::FILE, None)?;
        let track = PoseTrack::from_json(&bytes).map_err(CaptureError::Invalid)?;
        HeldOut::from_json(&bytes)?.cameras(track.image_size)
    }

    /// Skeleton, poses and cameras of the training frames.
    pub fn track(&self) -> &PoseTrack {
        &self.track
    }

    /// The files to upload: the pose track, then every frame and its mask.
    pub fn files(&self) -> Vec<UploadFile> {
        let poses = UploadFile {
            relative: self.file.to_owned(),
            path: self.root.join(self.file),
        };
        let images = self.track.frames.iter().flat_map(|frame| {
            ["frames", "masks"].map(|kind| UploadFile {
                relative: format!("{kind}/{:06}.png", frame.index),
                path: self.root.join(self.image_name(kind, frame.index)),
            })
        });
        std::iter::once(poses).chain(images).collect()
    }

    /// Held-out views of training poses, by camera name.
    pub fn held_out_views(&self) -> &[HeldOutView] {
        &self.held_out_views
    }

    /// Held-out poses, by camera name.
    pub fn held_out_poses(&self) -> &[HeldOutView] {
        &self.held_out_poses
    }

    /// Decodes the training frame at `position` in the track.
    ///
    /// # Errors
    /// The same errors as [`HeldOutView::read`], and when there is no frame at `position`.
    pub fn read(&self, position: usize) -> Result<FrameImage, CaptureError> {
        let frames = &self.track.frames;
        let index = frames
            .get(position)
            .map(|frame| frame.index)
            .ok_or_else(|| {
                let message = format!(
                    "there is no frame at position {position} of {}",
                    frames.len()
                );
                at_fault("frames", message)
            })?;
        let [frame, mask] = ["frames", "masks"].map(|kind| self.image_name(kind, index));
        read_frame(
            (&self.root.join(&frame), &self.root.join(&mask)),
            (&frame, &mask),
            self.track.image_size,
            index,
        )
    }

    /// All training frames as a shard.
    ///
    /// # Errors
    /// The same errors as [`CaptureFolder::read`].
    pub fn shard(&self) -> Result<Shard, CaptureError> {
        let mut builder = ShardBuilder::new(self.track.clone());
        let positions: Vec<usize> = (0..self.track.frames.len()).collect();
        for some in positions.chunks(DECODED_AT_ONCE) {
            let images: Vec<_> = some.par_iter().map(|&at| self.read(at)).collect();
            for image in images {
                builder.push(&image?)?;
            }
        }
        builder.finish()
    }

    fn image_name(&self, kind: &str, index: u32) -> String {
        format!("{}{kind}/{index:06}.png", self.prefix)
    }

    fn check_files(&self) -> Result<(), CaptureError> {
        let indices = self.track.frames.iter().map(|frame| frame.index);
        let missing: Vec<Violation> = indices
            .flat_map(|index| ["frames", "masks"].map(|kind| (index, self.image_name(kind, index))))
            .filter(|(_, name)| !self.root.join(name).is_file())
            .map(|(index, name)| missing(&name, Some(index)))
            .take(MAX_MISSING)
            .collect();
        if missing.is_empty() {
            Ok(())
        } else {
            Err(CaptureError::Invalid(missing))
        }
    }
}

/// Refuses a media plan that asks for more than file names tell: ingest follows such a plan, this reader
/// does not.
fn check_plan(root: &Path) -> Result<(), CaptureError> {
    let (name, path) = (media_plan::FILE, root.join(media_plan::FILE));
    if !path.is_file() {
        return Ok(());
    }
    let plan = serde_json::from_slice::<MediaPlan>(&read_file(&path, name, None)?);
    if plan.is_ok_and(|plan| plan == MediaPlan::default()) {
        return Ok(());
    }
    let message = "here captures are read as they stand, without corrections and selections; \
                   `yoto import --from folder` makes a plain capture of one with a plan";
    let fault = violation("UNSUPPORTED", name, None, "", message);
    Err(CaptureError::Invalid(vec![fault]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::tests::png;
    use crate::test_support::track;
    use std::fs;

    /// A folder that goes away with its test.
    struct Scratch(PathBuf);

    impl Scratch {
        fn new(name: &str) -> Self {
            let dir = std::env::temp_dir().join(format!("yoto-{name}-{}", std::process::id()));
            fs::create_dir_all(&dir).expect("a temporary folder");
            Self(dir)
        }

        fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
            let path = self.0.join(name);
            fs::create_dir_all(path.parent().expect("inside the folder")).expect("a folder");
            fs::write(path, bytes).expect("a file");
        }

        fn images(&self, folder: &str, index: u32, level: u8) {
            let rgb = image::RgbImage::from_pixel(6, 4, image::Rgb([level, 0, 0]));
            let mask = image::GrayImage::from_pixel(6, 4, image::Luma([255]));
            self.write(&format!("{folder}frames/{index:06}.png"), png(rgb));
            self.write(&format!("{folder}masks/{index:06}.png"), png(mask));
        }
    }

    impl Drop for Scratch {
        fn drop(&mut self) {
            // Leaving a temporary folder behind fails no test.
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    fn poses() -> serde_json::Value {
        serde_json::to_value(track(2, [6, 4])).expect("writes")
    }

    #[test]
    fn a_plain_folder_is_read_in_track_order() {
        let scratch = Scratch::new("plain");
        scratch.write("poses.json", poses().to_string());
        scratch.images("", 0, 10);
        scratch.images("", 1, 20);
        let folder = CaptureFolder::open(&scratch.0).expect("opens");
        let relative: Vec<String> = folder.files().into_iter().map(|f| f.relative).collect();
        assert_eq!(
            relative,
            [
                "poses.json",
                "frames/000000.png",
                "masks/000000.png",
                "frames/000001.png",
                "masks/000001.png"
            ]
        );
        assert!(folder.files().iter().all(|file| file.path.is_file()));
        let shard = folder.shard().expect("decodes");
        assert_eq!(shard.frames(), 2);
        assert_eq!(shard.image(1), folder.read(1).expect("decodes"));
        assert_eq!(shard.image(1).rgb[0], 20);
        assert!(folder.read(2).is_err());
        assert!(folder.held_out_views().is_empty() && folder.held_out_poses().is_empty());
        assert!(!CaptureFolder::has_held_out(&scratch.0).expect("reads"));
    }

    #[test]
    fn held_out_views_come_with_pose_and_camera() {
        let scratch = Scratch::new("held-out");
        let mut poses = poses();
        let camera = poses["frames"][0].clone();
        poses["eval"] = serde_json::json!({
            "cam00": {"K": camera["K"], "E": camera["E"], "frames": [1]}
        });
        poses["eval_pose"] = serde_json::json!({
            "frames": [{"index": 9, "pose": [0.1, 0.2, 0.3], "translation": [0.0, 0.0, 1.0]}],
            "cams": {"cam03": {"K": camera["K"], "E": camera["E"]}}
        });
        scratch.write("poses.json", poses.to_string());
        for index in 0..2 {
            scratch.images("train/", index, 1);
        }
        scratch.images("eval/cam00/", 1, 30);
        let folder = CaptureFolder::open(&scratch.0).expect("opens");
        assert!(CaptureFolder::has_held_out(&scratch.0).expect("reads"));
        let cameras = CaptureFolder::held_out_cameras(&scratch.0).expect("reads");
        assert_eq!(cameras.keys().collect::<Vec<_>>(), ["cam00", "cam03"]);
        assert_eq!(cameras["cam00"], folder.held_out_views()[0].camera);
        let upload = &folder.files()[1];
        assert_eq!(upload.relative, "frames/000000.png");
        assert_eq!(upload.path, scratch.0.join("train/frames/000000.png"));
        let [view] = folder.held_out_views() else {
            panic!("one view: {:?}", folder.held_out_views())
        };
        assert_eq!((view.camera_name.as_str(), view.frame), ("cam00", 1));
        assert_eq!(view.read().expect("decodes").rgb[0], 30);
        let [pose] = folder.held_out_poses() else {
            panic!("one pose: {:?}", folder.held_out_poses())
        };
        assert_eq!(pose.pose.rotations, [[0.1, 0.2, 0.3]]);
        let error = pose.read().expect_err("its images are missing");
        assert_eq!(
            error.to_string(),
            "eval_pose/cam03/frames/000009.png frame 9: there is no such file"
        );

        poses["eval"]["../elsewhere"] = poses["eval"]["cam00"].clone();
        scratch.write("poses.json", poses.to_string());
        assert!(CaptureFolder::open(&scratch.0).is_err());
    }

    #[test]
    fn faults_name_file_and_frame() {
        let scratch = Scratch::new("faults");
        let fault = || match CaptureFolder::open(&scratch.0).and_then(|f| f.shard()) {
            Ok(_) => panic!("the folder is broken"),
            Err(error) => error.to_string(),
        };
        assert_eq!(fault(), "poses.json: there is no such file");
        assert!(!CaptureFolder::has_held_out(&scratch.0).expect("no file"));
        scratch.write("poses.json", "{");
        assert!(CaptureFolder::has_held_out(&scratch.0).is_err());
        let cut = "poses.json: EOF while parsing an object at line 1";
        assert!(fault().starts_with(cut), "{}", fault());
        scratch.write("poses.json", poses().to_string());
        scratch.images("", 0, 1);
        assert!(fault().starts_with("frames/000001.png frame 1: there is no such file; masks/"));
        scratch.images("", 1, 1);
        scratch.write("masks/000001.png", b"not a picture");
        assert!(fault().starts_with("masks/000001.png frame 1: can't be decoded"));
        scratch.write("media.json", "{}");
        assert!(fault().starts_with("masks/000001.png frame 1: can't be decoded"));
        scratch.write("media.json", r#"{"correction": {"mask_shift": 1}}"#);
        assert!(
            fault().starts_with("media.json: here captures are read"),
            "{}",
            fault()
        );
    }
}
