//! A capture of the chosen person: a body fitted to the key points of all frames.

use super::detections::{Detection, Detections};
use super::judge::judge;
use super::people::{self, DetectedPerson};
use super::{mask, own_skeleton, timing};
use crate::clip::{Clip, fault, left_out};
use crate::proof::prove;
use crate::{Findings, ImportError, Imported, Options, PoseFit};
use std::path::Path;
use yoto_pose::{FitOptions, FrameKeyPoints, KeyPoints, fit};

/// The capture of a person in `found`, whose files are at `at`.
///
/// # Errors
/// When the person or the masks are not there; when no body fits the points.
pub(super) fn read(
    clip: &Clip,
    found: &Detections,
    at: &Path,
    options: &Options,
) -> Result<Imported, ImportError> {
    let mut notes = vec![format!(
        "{}: key points of {} frames",
        found.name,
        found.frames.len()
    )];
    notes.extend(clip.notes.iter().cloned());
    let mut about = Findings {
        doubts: clip.notes.clone(),
        ..Findings::default()
    };
    notes.extend(found.notes.iter().cloned());
    let earlier = notes.len();
    let person = people::choose(found, options.person.as_deref(), at, &mut notes)?;
    if options.person.is_none() {
        about.doubts.extend(notes.iter().skip(earlier).cloned());
    }
    let wanted = clip.selected(options)?;
    let counting = found.counting(clip);
    let first = counting.map(|counting| counting.first);
    let numbers = found.numbers(first, clip, at)?;
    let mut seen = of_clip(&person, &numbers, &wanted);
    if seen.is_empty() {
        let message = "no frame of the clip has key points of the person";
        return Err(fault(at, "EMPTY", message));
    }
    let other = counting.map(|counting| {
        let numbers = found.numbers(Some(counting.other()), clip, at);
        numbers.map(|numbers| of_clip(&person, &numbers, &wanted))
    });
    let frames = seen.iter().chain(other.iter().flatten().flatten());
    let frames = frames.map(|(frame, _)| *frame).collect();
    let masks = match (&options.masks, &options.matting) {
        (Some(given), _) => Some(mask::find(
            given, clip, &seen, &frames, options, &mut notes,
        )?),
        (None, Some(model)) => Some(mask::made(
            model, clip, &seen, &frames, options, &mut notes,
        )?),
        (None, None) => mask::own(&seen, &mut notes),
    };
    if let (Some(counting), Some(other)) = (counting, other) {
        // Masks of the detector are of its poses, whatever their numbers.
        let of_frames = options.masks.is_some() || options.matting.is_some();
        let masks = masks.as_ref().filter(|_| of_frames);
        seen = timing::decide(counting, found, seen, other, masks, clip, &mut notes)?;
    }
    let are_proven = masks.is_some() || found.focal.is_some() || options.keep_skeleton;
    let doubts = judge(&seen, clip.size, at, are_proven)?;
    notes.extend(doubts.iter().cloned());
    about.doubts.extend(doubts);
    let is_seen = |frame: &usize| seen.binary_search_by_key(frame, |(at, _)| *at).is_ok();
    left_out(&wanted, "key points of the person", is_seen, &mut notes);
    let fps = options.fps_or(clip.fps, &mut notes);
    let mut track = match options.keep_skeleton {
        true => own_skeleton::track(found, &seen, clip.size, fps, options, at, &mut notes)?,
        false => {
            let points = key_points(clip, found, &seen, fps, options, &mut notes);
            let options = FitOptions {
                focal: options.focal.or(found.focal),
                height: options.height,
                lift: false,
                upright: true,
            };
            let fitted = fit(&points, &options, &mut |_, _| ());
            let fitted = fitted.map_err(|error| fault(at, "UNSUITABLE", error.to_string()))?;
            about.fit = Some(PoseFit::of(&fitted, wanted.len()));
            about.doubts.extend(fitted.doubt);
            notes.extend(fitted.notes);
            fitted.track
        }
    };
    if let (true, Some(masks)) = (options.keep_skeleton, &masks) {
        prove(&track, masks, at, &mut notes)?;
    }
    if let Some(masks) = &masks {
        let frames: Vec<usize> = seen.iter().map(|(frame, _)| *frame).collect();
        let has_mask = |frame: &usize| masks.contains_key(frame);
        left_out(&frames, "a mask", has_mask, &mut notes);
        track
            .frames
            .retain(|frame| has_mask(&(frame.index as usize)));
    }
    let indices: Vec<usize> = track
        .frames
        .iter()
        .map(|frame| frame.index as usize)
        .collect();
    let mask = |frame: &usize| masks.as_ref().and_then(|masks| masks.get(frame)).cloned();
    let of_frames = indices
        .iter()
        .map(|frame| mask(frame).into_iter().collect());
    Ok(Imported {
        track,
        pictures: clip.pictures(&indices, of_frames.collect()),
        available: clip.frames,
        notes,
        found: about,
    })
}

/// The frames of `wanted` that show the person, with the points; `numbers` are the frames of the detections.
pub(super) fn of_clip<'a>(
    person: &DetectedPerson<'a>,
    numbers: &[Option<usize>],
    wanted: &[usize],
) -> Vec<(usize, &'a Detection)> {
    let mut seen: Vec<(usize, &Detection)> = Vec::new();
    for &(index, detection) in &person.seen {
        let frame = numbers.get(index).copied().flatten();
        if let Some(frame) = frame.filter(|frame| wanted.binary_search(frame).is_ok())
            && seen.last().is_none_or(|(last, _)| *last < frame)
        {
            seen.push((frame, detection));
        }
    }
    seen
}

fn key_points(
    clip: &Clip,
    found: &Detections,
    seen: &[(usize, &Detection)],
    fps: f64,
    options: &Options,
    notes: &mut Vec<String>,
) -> KeyPoints {
    if options.focal.is_none()
        && let Some(focal) = found.focal
    {
        notes.push(format!(
            "focal length: {focal:.0} px, which {} worked with (--focal for another)",
            found.name
        ));
    }
    let frames = seen.iter().map(|(frame, detection)| FrameKeyPoints {
        index: *frame as u32,
        picture: detection.picture.clone(),
        space: detection.space.clone(),
        hands: detection.hands.clone(),
        face: detection.face.clone(),
        ..FrameKeyPoints::default()
    });
    KeyPoints {
        set: found.set,
        image_size: clip.size,
        fps,
        frames: frames.collect(),
    }
}
