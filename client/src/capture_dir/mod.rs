//! A capture as a folder or archive on disk, ready to be uploaded.
//!
//! The pose track is read as the plan says and checked, and every picture it names is looked
//! for, before a byte is sent: a wrong unit should cost its author a second, not an upload.
//! Pictures are not looked into, that is the ingest job's work. Files go up as they are, with
//! the plan beside them: the job corrects the track by the same function.
//!
//! `yoto_avatar::capture::CaptureFolder` reads folders of pictures, too, and decodes them; it
//! comes with the whole model. A client without the feature `embedded` only uploads and is
//! built without a tensor library, so this small reader stands beside it. A test holds the two
//! to the same files.
//!
//! ```text
//! DIR/poses.json            or poses.pb (protocol buffers)
//! DIR/frames/000000.png …   or video.mp4, frames.zip, frames.tar   each also below train/
//! DIR/masks/000000.png …    or masks.mp4, masks.zip, masks.tar, background.png
//! DIR/media.json            how to read them, where names don't tell
//! ```

mod listing;
mod options;

pub use options::{CaptureOptions, Prefer};

use crate::api::{ClientError, FileSource, UploadFile};
use listing::Listing;
use std::path::{Path, PathBuf};
use yoto_proto::media_plan::{
    self, ARCHIVE_ENDINGS, MaskSource, MediaPlan, Pictures, Planned, Sources,
};
use yoto_proto::pose_track::{FILE, FILES, violation};
use yoto_proto::v1::Violation;

/// Missing files named at most; a wrong folder misses all of them.
const MAX_MISSING: usize = 20;

/// A checked capture.
#[derive(Debug)]
pub struct CaptureDir {
    /// Who stands how in each frame that counts, corrected, and where its mask is; none for an
    /// archive, which is not looked into.
    pub planned: Option<Planned>,
    /// How the service is to read it.
    pub plan: MediaPlan,
    /// Everything to upload, the pose track last.
    pub files: Vec<UploadFile>,
    /// Size of all files together.
    pub bytes: u64,
    /// What will be read, for people.
    pub notes: Vec<String>,
}

impl CaptureDir {
    /// Opens the capture at `path`, a folder or an archive, to be read as names tell.
    ///
    /// # Errors
    /// As [`CaptureDir::open_with`].
    pub fn open(path: &Path) -> Result<Self, ClientError> {
        Self::open_with(path, &CaptureOptions::default())
    }

    /// Opens the capture at `path` to be read as `options` say.
    ///
    /// # Errors
    /// [`ClientError::File`] when a file can't be read; [`ClientError::BadCapture`] with
    /// everything that is wrong with the pose track or missing.
    pub fn open_with(path: &Path, options: &CaptureOptions) -> Result<Self, ClientError> {
        if path.is_file() {
            archive(path, options)
        } else {
            folder(path, options)
        }
    }

    /// How many frames the pose track has; 0 for an archive.
    pub fn frames(&self) -> usize {
        let planned = self.planned.as_ref();
        planned.map_or(0, |it| it.track.frames.len())
    }
}

fn bad(place: &Path, violations: Vec<Violation>) -> ClientError {
    ClientError::BadCapture {
        place: place.display().to_string(),
        violations,
    }
}

/// A whole capture in one file.
fn archive(path: &Path, options: &CaptureOptions) -> Result<CaptureDir, ClientError> {
    let name = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    let Some(ending) = ARCHIVE_ENDINGS.iter().find(|it| name.ends_with(**it)) else {
        let message = "is a file; a capture is a folder, or a zip, tar or tar.gz of one";
        return Err(bad(
            path,
            vec![violation("INVALID", &name, None, "", message)],
        ));
    };
    let bytes = size(path)?;
    let mut files = vec![UploadFile {
        path: format!("capture{ending}"),
        source: FileSource::Disk(path.to_owned()),
    }];
    let plan = MediaPlan {
        images: options.prefer.map(|prefer| match prefer {
            Prefer::Images => "frames".to_owned(),
            Prefer::Video => "video".to_owned(),
        }),
        ..options.plan()
    };
    let plan_bytes = push_plan(&mut files, &plan);
    Ok(CaptureDir {
        planned: None,
        plan,
        files,
        bytes: bytes + plan_bytes,
        notes: vec!["an archive: the service looks into it".to_owned()],
    })
}

fn folder(dir: &Path, options: &CaptureOptions) -> Result<CaptureDir, ClientError> {
    let there = FILES.into_iter().find(|name| dir.join(name).is_file());
    let name = there.unwrap_or(FILE);
    let poses = dir.join(name);
    let poses_bytes = std::fs::read(&poses).map_err(ClientError::file("reading", &poses))?;
    let mut plan = options.plan().over(read_plan(dir)?);
    let planned = plan
        .track(name, &poses_bytes)
        .map_err(|found| bad(dir, found))?;
    let listing = Listing::of(dir, &folders_of(&plan))?;
    let mut notes = Vec::new();
    choose_images(&listing, options.prefer, &mut plan, &mut notes);
    let sources = Sources::find(&plan, listing.sources()).map_err(|mut fault| {
        fault.message += &format!("; looked below {}", listing.root().display());
        bad(dir, vec![fault])
    })?;
    notes.push(format!("images: {}", sources.images));
    let kinds = [Some(sources.images.clone()), sources.mask_pictures()];
    notes.push(match (&sources.masks, &kinds[1]) {
        (_, Some(pictures)) => format!("masks: {pictures}"),
        (MaskSource::Plate(name), _) => format!("masks: a difference key against {name}"),
        _ => "masks: the pictures' alpha channel".to_owned(),
    });

    let mut chosen: Vec<(String, PathBuf)> = Vec::new();
    // Folders to take each frame's picture from, and its index there.
    let mut folders: Vec<(&str, &[u32])> = Vec::new();
    let frames = planned.track.frames.iter();
    let images: Vec<u32> = frames.map(|frame| frame.index).collect();
    for (pictures, indices) in kinds.iter().zip([&images, &planned.masks]) {
        match pictures {
            Some(Pictures::Folder(folder)) => match listing.archive_of(folder) {
                Some((name, path)) => chosen.push((name, path)),
                None => folders.push((folder, indices)),
            },
            Some(Pictures::Video(name)) => chosen.extend(listing.file(name)),
            None => {}
        }
    }
    if let MaskSource::Plate(name) = &sources.masks {
        chosen.extend(listing.file(name));
    }
    let mut missing = Vec::new();
    for position in 0..images.len() {
        for (folder, indices) in &folders {
            let Some(&index) = indices.get(position) else {
                continue;
            };
            match listing.picture(folder, index) {
                Some(found) => chosen.push(found),
                None if missing.len() < MAX_MISSING => {
                    let path = format!("{folder}/{index:06}.png");
                    let message =
                        format!("there is no such file below {}", listing.root().display());
                    missing.push(violation("MISSING", &path, Some(index), "", message));
                }
                None => {}
            }
        }
    }
    if !missing.is_empty() {
        return Err(bad(dir, missing));
    }
    let mut bytes = poses_bytes.len() as u64;
    let mut files = Vec::with_capacity(chosen.len() + 2);
    for (path, disk) in chosen {
        bytes += size(&disk)?;
        files.push(UploadFile {
            path,
            source: FileSource::Disk(disk),
        });
    }
    bytes += push_plan(&mut files, &plan);
    files.push(UploadFile {
        path: name.into(),
        source: FileSource::Memory(poses_bytes),
    });
    Ok(CaptureDir {
        planned: Some(planned),
        plan,
        files,
        bytes,
        notes,
    })
}

/// Folders that the plan names.
fn folders_of(plan: &MediaPlan) -> Vec<&str> {
    let masks = match &plan.masks {
        Some(MaskSource::Pictures(path)) => Some(path.as_str()),
        Some(MaskSource::Alpha | MaskSource::Plate(_)) | None => None,
    };
    let images = plan.images.as_deref();
    images.into_iter().chain(masks).collect()
}

fn size(path: &Path) -> Result<u64, ClientError> {
    let meta = path
        .metadata()
        .map_err(ClientError::file("reading", path))?;
    Ok(meta.len())
}

/// The folder's own plan.
fn read_plan(dir: &Path) -> Result<MediaPlan, ClientError> {
    let path = dir.join(media_plan::FILE);
    if !path.is_file() {
        return Ok(MediaPlan::default());
    }
    let json = std::fs::read(&path).map_err(ClientError::file("reading", &path))?;
    serde_json::from_slice(&json).map_err(|error| {
        let field = format!("line {} column {}", error.line(), error.column());
        let fault = violation(
            "UNREADABLE",
            media_plan::FILE,
            None,
            field,
            error.to_string(),
        );
        bad(dir, vec![fault])
    })
}

/// Appends the plan where it says anything; its bytes.
fn push_plan(files: &mut Vec<UploadFile>, plan: &MediaPlan) -> u64 {
    if *plan == MediaPlan::default() {
        return 0;
    }
    // A plan consists of numbers and names, which JSON always holds.
    let json = serde_json::to_vec(plan).unwrap_or_default();
    let bytes = json.len() as u64;
    files.push(UploadFile {
        path: media_plan::FILE.into(),
        source: FileSource::Memory(json),
    });
    bytes
}

/// Pictures or a video, where the folder has both and the plan leaves it open.
fn choose_images(
    listing: &Listing,
    prefer: Option<Prefer>,
    plan: &mut MediaPlan,
    notes: &mut Vec<String>,
) {
    let video = listing.video();
    if plan.images.is_some() {
        return;
    }
    match (prefer, listing.has_frames(), video) {
        (Some(Prefer::Video), _, video) => {
            plan.images = Some(video.unwrap_or_else(|| "video.mp4".to_owned()));
        }
        (Some(Prefer::Images), ..) => plan.images = Some("frames".to_owned()),
        (None, true, Some(video)) => notes.push(format!(
            "there are both frames/ and {video}: frames/ is taken (--frames video for the other)"
        )),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::correction::Unit;
    use yoto_proto::pose_track::{Frame, PoseTrack, Skeleton};

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

    #[test]
    fn a_video_or_an_archive_goes_up_as_it_is() {
        let dir = tempfile::tempdir().expect("temporary folder");
        write_capture(dir.path(), "train", |_| {});
        std::fs::write(dir.path().join("train/video.mp4"), b"film").expect("writes");
        let paths = |capture: &CaptureDir| -> Vec<String> {
            capture.files.iter().map(|file| file.path.clone()).collect()
        };
        let images = CaptureDir::open(dir.path()).expect("a good capture");
        assert_eq!(paths(&images).len(), 5, "pictures, unless asked otherwise");
        assert!(
            images.notes[0].contains("--frames video"),
            "{:?}",
            images.notes
        );

        let mut options = CaptureOptions {
            prefer: Some(Prefer::Video),
            ..CaptureOptions::default()
        };
        options.selection.end = Some(7);
        let video = CaptureDir::open_with(dir.path(), &options).expect("a good capture");
        let expected = ["video.mp4", "masks/000000.png", "media.json", "poses.json"];
        assert_eq!(paths(&video), expected);

        std::fs::remove_dir_all(dir.path().join("train/frames")).expect("removes");
        std::fs::remove_dir_all(dir.path().join("train/masks")).expect("removes");
        std::fs::write(dir.path().join("train/masks.tar"), b"tar").expect("writes");
        let film = CaptureDir::open(dir.path()).expect("a good capture");
        assert_eq!(paths(&film), ["video.mp4", "masks.tar", "poses.json"]);

        let whole = dir.path().join("ada.tar.gz");
        std::fs::write(&whole, b"packed").expect("writes");
        let packed = CaptureDir::open(&whole).expect("not looked into");
        assert_eq!(
            (paths(&packed), packed.bytes),
            (vec!["capture.tar.gz".to_owned()], 6)
        );
        let other = dir.path().join("train/video.mp4");
        assert!(CaptureDir::open(&other).is_err(), "a video is no capture");
    }

    #[test]
    fn pictures_of_any_name_are_found_by_their_number() {
        let dir = tempfile::tempdir().expect("temporary folder");
        write_capture(dir.path(), "", |_| {});
        let frames = dir.path().join("frames");
        std::fs::rename(frames.join("000007.png"), frames.join("shot 7.JPG")).expect("renames");
        let capture = CaptureDir::open(dir.path()).expect("a good capture");
        let uploaded = |name: &str| capture.files.iter().any(|file| file.path == name);
        assert!(uploaded("frames/000007.jpg"), "{:?}", capture.files);
        std::fs::copy(frames.join("shot 7.JPG"), frames.join("7.png")).expect("copies");
        let error = CaptureDir::open(dir.path())
            .expect_err("two of a kind")
            .to_string();
        assert!(
            error.contains("frame 7") && error.contains("shot 7.JPG"),
            "{error}"
        );
    }

    #[test]
    fn a_correction_goes_up_beside_the_files_as_they_are() {
        let dir = tempfile::tempdir().expect("temporary folder");
        write_capture(dir.path(), "", |track| {
            track.frames[0].translation[2] = 3000.0;
            track.frames[1].translation[2] = 20_000.0;
        });
        assert!(CaptureDir::open(dir.path()).is_err(), "20 km away");
        let mut options = CaptureOptions::default();
        options.correction.units.root = Unit::Millimetre;
        options.correction.mask_shift = 1;
        let capture = CaptureDir::open_with(dir.path(), &options).expect("a good capture");
        let paths: Vec<&str> = capture.files.iter().map(|it| it.path.as_str()).collect();
        let expected = [
            "frames/000000.png",
            "masks/000007.png",
            "media.json",
            "poses.json",
        ];
        assert_eq!(paths, expected);
        let planned = capture.planned.expect("a folder has one");
        assert_eq!(planned.track.frames[0].translation[2], 3.0);
        let in_memory = |path: &str| {
            let file = capture.files.iter().find(|it| it.path == path);
            match file.map(|it| &it.source) {
                Some(FileSource::Memory(bytes)) => bytes.clone(),
                other => panic!("{path}: {other:?}"),
            }
        };
        let plan: MediaPlan = serde_json::from_slice(&in_memory("media.json")).expect("reads");
        assert_eq!(plan.correction, options.correction);
        assert_eq!(
            plan.track("poses.json", &in_memory("poses.json")),
            Ok(planned),
            "the job reads the same"
        );
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
