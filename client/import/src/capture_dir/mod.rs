//! A capture as a folder or archive on disk, ready to be uploaded.
//!
//! Before the upload, the pose track is read according to the plan and checked, and its pictures
//! must exist, up to the end of a video: a wrong unit should cost a second, not an upload. Pictures
//! are not decoded, which is the ingest job's task. Files are uploaded unchanged, with the plan: the job corrects the track
//! with the same function.
//!
//! `yoto_capture::CaptureFolder` reads folders of pictures, too, and decodes them; it
//! comes with the whole model. A client without the feature `embedded` only uploads and is
//! built without a tensor library, so it needs this small reader. A test checks that both read
//! the same files.
//!
//! ```text
//! DIR/poses.json            or poses.pb (protocol buffers)
//! DIR/frames/000000.png …   or video.mp4, frames.zip, frames.tar   each also below train/
//! DIR/masks/000000.png …    or masks.mp4, masks.zip, masks.tar, background.png
//! DIR/media.json            how to read them, where names are not enough
//! ```

mod decoded;
mod listing;
mod options;
mod track;

pub use decoded::DecodedCapture;
pub use options::{CaptureOptions, Prefer};
pub use track::{named, read_track};

use crate::ImportError;
use listing::Listing;
use std::io::Read;
use std::path::{Path, PathBuf};
use yoto_ingest::end_with_videos;
use yoto_media::Limits;
use yoto_proto::media_plan::{
    self, ARCHIVE_ENDINGS, MaskSource, MediaPlan, Pictures, Planned, Sources, VIDEO_ENDINGS,
    has_ending,
};
use yoto_proto::pose_track::{FILE, FILES, violation};
use yoto_proto::v1::Violation;

/// Most missing files that are named; a wrong folder lacks all of them.
const MAX_MISSING: usize = 20;

/// Where the content of a file is.
#[derive(Debug, Clone)]
pub enum FileSource {
    /// On this disk.
    Disk(PathBuf),
    /// In memory.
    Memory(Vec<u8>),
}

/// A file of a capture.
#[derive(Debug, Clone)]
pub struct CaptureFile {
    /// Path inside the capture: "poses.json", "frames/000000.png".
    pub path: String,
    /// Its content.
    pub source: FileSource,
}

/// A checked capture.
#[derive(Debug)]
pub struct CaptureDir {
    /// The selected frames, corrected, with their masks; none for an archive, which is not
    /// unpacked, and for a film, whose poses the service finds.
    pub planned: Option<Planned>,
    /// The plan for the service.
    pub plan: MediaPlan,
    /// Everything to upload, the pose track last.
    pub files: Vec<CaptureFile>,
    /// Size of all files together.
    pub bytes: u64,
    /// A summary of what will be read, for people.
    pub notes: Vec<String>,
}

impl CaptureDir {
    /// Opens the capture at `path`, a folder or an archive, with the sources that its names give.
    ///
    /// # Errors
    /// The same errors as [`CaptureDir::open_with`].
    pub fn open(path: &Path) -> Result<Self, ImportError> {
        Self::open_with(path, &CaptureOptions::default())
    }

    /// Opens the capture at `path`, with `options`.
    ///
    /// # Errors
    /// [`ImportError::File`] when a file can't be read; [`ImportError::BadCapture`] with
    /// all faults of the pose track and all missing files.
    pub fn open_with(path: &Path, options: &CaptureOptions) -> Result<Self, ImportError> {
        if path.is_file() {
            archive(path, options)
        } else {
            folder(path, options)
        }
    }

    /// Number of frames of the pose track; 0 for an archive and a film.
    pub fn frames(&self) -> usize {
        let planned = self.planned.as_ref();
        planned.map_or(0, |it| it.track.frames.len())
    }
}

fn bad(place: &Path, violations: Vec<Violation>) -> ImportError {
    ImportError::BadCapture {
        place: place.display().to_string(),
        violations,
    }
}

/// A whole capture in one file.
fn archive(path: &Path, options: &CaptureOptions) -> Result<CaptureDir, ImportError> {
    let name = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    if let Some((_, ending)) = name
        .rsplit_once('.')
        .filter(|_| has_ending(&name, &VIDEO_ENDINGS))
    {
        return film(path, ending, options);
    }
    let Some(ending) = ARCHIVE_ENDINGS.iter().find(|it| name.ends_with(**it)) else {
        let message = "is a file; a capture is a folder, a zip, tar or tar.gz of one, or a film";
        return Err(bad(
            path,
            vec![violation("INVALID", &name, None, "", message)],
        ));
    };
    ensure_archive(path, &name)?;
    let bytes = size(path)?;
    let mut files = vec![CaptureFile {
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

/// A film without poses.
fn film(path: &Path, ending: &str, options: &CaptureOptions) -> Result<CaptureDir, ImportError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let refused = |code, message| Err(bad(path, vec![violation(code, &name, None, "", message)]));
    let bytes = size(path)?;
    if bytes == 0 {
        return refused("EMPTY", "the film is empty");
    }
    if options.prefer.is_some() || options.plan() != MediaPlan::default() {
        let message = "is a film without poses: frames, masks and corrections can't be chosen for it; `yoto import` makes a \
                       capture of it for which they can";
        return refused("INVALID", message);
    }
    Ok(CaptureDir {
        planned: None,
        plan: MediaPlan::default(),
        files: vec![CaptureFile {
            path: format!("video.{ending}"),
            source: FileSource::Disk(path.to_owned()),
        }],
        bytes,
        notes: vec![
            "a film without poses: the service finds them, if it has a pose model".to_owned(),
        ],
    })
}

fn folder(dir: &Path, options: &CaptureOptions) -> Result<CaptureDir, ImportError> {
    let there = FILES.into_iter().find(|name| dir.join(name).is_file());
    let name = there.ok_or_else(|| no_poses(dir))?;
    let poses = dir.join(name);
    let poses_bytes = std::fs::read(&poses).map_err(ImportError::file("reading", &poses))?;
    let mut plan = options.plan().over(read_plan(dir)?);
    let mut planned = plan
        .track(name, &poses_bytes)
        .map_err(|found| bad(dir, found))?;
    let listing = Listing::of(dir, &folders_of(&plan))?;
    let mut notes = Vec::new();
    choose_images(&listing, options.prefer, &mut plan, &mut notes);
    let sources = Sources::find(&plan, listing.sources()).map_err(|mut fault| {
        fault.message += &format!("; looked below {}", listing.root().display());
        bad(dir, vec![fault])
    })?;
    // A pose beyond the video's end needs no mask either.
    end_with_videos(
        &mut planned,
        &sources,
        listing.top(),
        plan.timing,
        &Limits::default(),
    )
    .map_err(|fault| bad(dir, vec![fault]))?;
    notes.extend(planned.notes.iter().cloned());
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
        files.push(CaptureFile {
            path,
            source: FileSource::Disk(disk),
        });
    }
    bytes += push_plan(&mut files, &plan);
    files.push(CaptureFile {
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

/// The error about a folder without a pose track.
fn no_poses(dir: &Path) -> ImportError {
    if !dir.is_dir() {
        return ImportError::Unusable(format!("there is no {}", dir.display()));
    }
    let message = "a capture needs the person's poses in this file: `yoto import` makes it from the \
                   files of pose tools, docs/use/formats.md describes it";
    bad(dir, vec![violation("MISSING", FILE, None, "", message)])
}

/// The beginnings of archives that can be unpacked, and where they are.
const ARCHIVE_MARKS: [(usize, &[u8]); 3] = [(0, b"PK"), (0, &[0x1f, 0x8b]), (257, b"ustar")];

/// Checks that the file at `path` begins as an archive, so that nothing else is uploaded.
fn ensure_archive(path: &Path, name: &str) -> Result<(), ImportError> {
    let mut start = Vec::new();
    let file = std::fs::File::open(path).map_err(ImportError::file("reading", path))?;
    file.take(512)
        .read_to_end(&mut start)
        .map_err(ImportError::file("reading", path))?;
    let marked =
        |(at, mark): &(usize, &[u8])| start.get(*at..).is_some_and(|rest| rest.starts_with(mark));
    if ARCHIVE_MARKS.iter().any(marked) {
        return Ok(());
    }
    let message = "is not an archive, whatever its name: zip, tar and tar.gz are read";
    Err(bad(
        path,
        vec![violation("INVALID", name, None, "", message)],
    ))
}

/// Folders named in the plan.
fn folders_of(plan: &MediaPlan) -> Vec<&str> {
    let masks = match &plan.masks {
        Some(MaskSource::Pictures(path)) => Some(path.as_str()),
        Some(MaskSource::Alpha | MaskSource::Plate(_)) | None => None,
    };
    let images = plan.images.as_deref();
    images.into_iter().chain(masks).collect()
}

fn size(path: &Path) -> Result<u64, ImportError> {
    let meta = path
        .metadata()
        .map_err(ImportError::file("reading", path))?;
    Ok(meta.len())
}

/// The folder's own plan.
fn read_plan(dir: &Path) -> Result<MediaPlan, ImportError> {
    let path = dir.join(media_plan::FILE);
    if !path.is_file() {
        return Ok(MediaPlan::default());
    }
    let json = std::fs::read(&path).map_err(ImportError::file("reading", &path))?;
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

/// Appends the plan unless it is empty; returns its bytes.
fn push_plan(files: &mut Vec<CaptureFile>, plan: &MediaPlan) -> u64 {
    if *plan == MediaPlan::default() {
        return 0;
    }
    // A plan consists of numbers and names, which JSON can always represent.
    let json = serde_json::to_vec(plan).unwrap_or_default();
    let bytes = json.len() as u64;
    files.push(CaptureFile {
        path: media_plan::FILE.into(),
        source: FileSource::Memory(json),
    });
    bytes
}

/// Pictures or a video, if the folder has both and the plan does not decide.
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
mod tests;
