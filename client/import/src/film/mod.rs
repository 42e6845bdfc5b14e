//! A clip alone: the pose model finds the person, and the fit of poses does the rest.
//!
//! The clip is a video or a folder of pictures. The pose model says of each frame where the body's
//! points are, in the picture and in metres, and gives a mask; all frames together are then fitted
//! with a body of constant bones before one camera, whose focal length is found on the way unless
//! it is given.
//!
//! ```text
//! clip → watch (pose model, parts) → key points → fit → pose track
//!                                           → masks (or those given, or a matting model's)
//! ```

mod hands;
mod masks;
mod parts;
mod people;
mod sheet;
mod watch;

use crate::clip::{Clip, fault};
use crate::{Findings, ImportError, Imported, Options, PoseFit, Stage};
use parts::PartModels;
use std::path::Path;
use std::time::Instant;
use watch::Watched;
use yoto_landmarks::{PoseModel, Watcher};
use yoto_pose::{FitOptions, KeyPointSet, KeyPoints, fit};
use yoto_proto::text::count;

/// At most this number of frames is searched: further frames of a clip are alike, and each takes a part of a second.
const MOST_FRAMES: usize = 200;

/// Finds poses and masks of the person in the clip `source`.
pub(crate) fn read(source: &Path, options: &Options) -> Result<Imported, ImportError> {
    let model = open_model(source, options)?;
    let clip = Clip::open(source, options)?;
    let mut notes = clip.notes.clone();
    let wanted = wanted(&clip, options, &mut notes)?;
    let started = Instant::now();
    let name = model.name().to_owned();
    let mut watcher = Watcher::new(model);
    let mut parts = PartModels::open(options)?;
    let followed = people::follow(&mut watcher, &mut parts, &clip, &wanted, options)?;
    let watched = followed.watched;
    let absence = match followed.is_one_of_several {
        true => "the person was not found, or could not be told from others,",
        false => "nobody was found",
    };
    notes.extend(followed.note.clone());
    let seconds = started.elapsed().as_secs_f64() / wanted.len().max(1) as f64;
    notes.push(format!(
        "the person was searched for in {} by {name}, {seconds:.2} s each",
        count(wanted.len(), "frame")
    ));
    let absent = left_out(absence, &wanted, &watched);
    notes.extend(absent.clone());
    if watched.is_empty() {
        let message = format!("nobody was found in {}", count(wanted.len(), "frame"));
        return Err(fault(source, "EMPTY", message));
    }
    let (watched, masks) = masks::of(options, &clip, watched, &mut notes)?;
    let fps = options.fps_or(clip.fps, &mut notes);
    let indices: Vec<usize> = watched.iter().map(|it| it.index).collect();
    let points = KeyPoints {
        set: KeyPointSet::BlazePose33,
        image_size: clip.size,
        fps,
        frames: watched.into_iter().map(|it| it.points).collect(),
    };
    let fit_options = FitOptions {
        focal: options.focal,
        height: options.height,
        lift: true,
        ..FitOptions::default()
    };
    let running = options.progress.start(Stage::Poses);
    let fitted = fit(&points, &fit_options, &mut |done, all| {
        running.count(done, all);
    });
    drop(running);
    let fitted = fitted.map_err(|error| fault(source, "UNFITTED", error.to_string()))?;
    let lacks = hands::lacks(&points.frames, &fitted.track);
    let found = Findings {
        fit: Some(PoseFit::of(&fitted, wanted.len())),
        doubts: (clip.notes.iter().cloned())
            .chain(followed.note)
            .chain(absent)
            .chain(fitted.doubt)
            .collect(),
        lacks,
        people: followed.sheet,
    };
    notes.extend(fitted.notes);
    notes.extend(fingers(fitted.hands, points.frames.len()));
    notes.extend(face(fitted.face, points.frames.len()));
    Ok(Imported {
        track: fitted.track,
        pictures: clip.pictures(&indices, masks),
        available: clip.frames,
        notes,
        found,
    })
}

fn open_model(source: &Path, options: &Options) -> Result<PoseModel, ImportError> {
    let Some(path) = &options.pose_model else {
        let message = "poses of a clip alone are found by a pose model: fetch it with \
                       deploy/models/get.sh and name its folder with --pose-model (or \
                       YOTO_POSE_MODEL); or give a pose tool's files with --poses";
        return Err(fault(source, "POSE_MODEL", message));
    };
    PoseModel::open(path).map_err(|error| fault(path, "POSE_MODEL", error.to_string()))
}

/// The frames to look at: the selected ones, or, of too many, an evenly spaced part.
fn wanted(
    clip: &Clip,
    options: &Options,
    notes: &mut Vec<String>,
) -> Result<Vec<usize>, ImportError> {
    let selected = clip.selected(options)?;
    let every = selected.len().div_ceil(MOST_FRAMES);
    if every > 1 {
        notes.push(format!(
            "one frame in {every} is taken of {}, at most {MOST_FRAMES} in all: --range takes another part \
             of the clip",
            count(selected.len(), "frame")
        ));
    }
    Ok(selected.into_iter().step_by(every).collect())
}

/// A note about the frames that show how fingers are bent.
fn fingers([left, right]: [usize; 2], frames: usize) -> Option<String> {
    (left + right > 0).then(|| {
        format!(
            "fingers: read off the left hand in {left} and off the right hand in {right} of {}, and as usual elsewhere",
            count(frames, "frame")
        )
    })
}

/// A note about the frames that show the face's expression.
fn face(shown: usize, frames: usize) -> Option<String> {
    (shown > 0).then(|| {
        format!(
            "face: mouth and eyelids read off the face in {shown} of {}, and at rest elsewhere",
            count(frames, "frame")
        )
    })
}

/// A note about frames without a person.
fn left_out(absence: &str, wanted: &[usize], watched: &[Watched]) -> Option<String> {
    let seen = |frame: &usize| watched.binary_search_by_key(frame, |it| it.index).is_ok();
    let absent: Vec<usize> = wanted.iter().copied().filter(|it| !seen(it)).collect();
    let (first, last) = (absent.first()?, absent.last()?);
    Some(format!(
        "{absence} in {} from {first} to {last}: left out",
        count(absent.len(), "frame")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A clip of `frames` pictures.
    fn clip(folder: &Path, frames: usize) -> Clip {
        for frame in 0..frames {
            let picture = image::RgbImage::new(1, 1);
            let path = folder.join(format!("{frame:06}.png"));
            picture.save(path).expect("a picture");
        }
        Clip::open(folder, &Options::default()).expect("a clip")
    }

    #[test]
    fn long_clips_are_looked_at_in_even_steps() {
        let folder = tempfile::tempdir().expect("a folder");
        let clip = clip(folder.path(), 401);
        let wanted = |frames| {
            let options = Options {
                frames,
                ..Options::default()
            };
            let mut notes = Vec::new();
            let frames = wanted(&clip, &options, &mut notes);
            (frames.map_err(|error| error.to_string()), notes)
        };
        let (frames, notes) = wanted(None);
        let expected: Vec<usize> = (0..401).step_by(3).collect();
        assert_eq!(frames, Ok(expected));
        assert!(notes[0].contains("one frame in 3"), "{notes:?}");
        let (frames, notes) = wanted(Some((10, 16, 2)));
        assert_eq!((frames, notes), (Ok(vec![10, 12, 14]), Vec::new()));
        let (frames, _) = wanted(Some((500, 600, 1)));
        assert!(frames.is_err_and(|error| error.contains("401 frames")));
    }
}
