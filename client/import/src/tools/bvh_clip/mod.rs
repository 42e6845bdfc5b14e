//! A clip, with its person's motion as BVH: what motion-capture programs write, and some pose tools.
//!
//! Joints are SMPL's by name, or the file's own ([`motion`](crate::motion)). Positions are of a world whose
//! y or z is up, in metres, centimetres or millimetres. The camera is in OpenCV's `intri.yml` and
//! `extri.yml` beside the file or above it, of the same world in metres. Without these the world is the
//! camera's own: y up, looking along −z, as OpenGL has it. Other readings than these are compared with
//! masks ([`reading`]), as those of pose tools are.

mod reading;

use super::opencv::calibration;
use crate::clip::{Clip, fault, left_out};
use crate::motion::{Motion, MotionOptions, read_bvh};
use crate::proof::Masks;
use crate::source::Source;
use crate::{Findings, ImportError, Imported, Options};
use reading::{FilmedMotion, choose};
use std::path::Path;

/// Whether `path` is a BVH file by its name.
pub(crate) fn fits(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str());
    ending.is_some_and(|ending| ending.eq_ignore_ascii_case("bvh"))
}

/// Reads the motion in `options.poses` of the person in the clip `source`.
///
/// # Errors
/// When the files are wrong, or of another clip; when no reading agrees with the masks.
pub(crate) fn read(source: &Path, options: &Options) -> Result<Imported, ImportError> {
    let Some(at) = options.poses.as_deref() else {
        let message =
            "a BVH file comes with the clip that it is of: yoto import CLIP --poses FILE.bvh";
        return Err(fault(source, "MISSING", message));
    };
    let folder = Source::new(at.parent().unwrap_or(Path::new("")));
    let name = at.file_name().unwrap_or_default().to_string_lossy();
    let reading = MotionOptions {
        keep_skeleton: options.keep_skeleton,
        ..MotionOptions::default()
    };
    let (motion, up) = read_bvh(&folder, &name, &reading)?;
    let calibration = calibration(&folder, "", options)?;
    let clip = Clip::open(source, options)?;
    let mut notes = vec![summary(&motion, options)];
    notes.extend(motion.notes.iter().chain(&clip.notes).cloned());
    let wanted = clip.selected(options)?;
    let fps = options.fps.or(clip.fps).unwrap_or(motion.fps);
    let numbers = numbers(&motion, &clip, fps, at, &mut notes)?;
    let masks = match (&options.matting, &options.masks) {
        (Some(model), _) => {
            let frames = (0..clip.frames).filter(|frame| numbers(*frame).is_some());
            vec![Masks::made(
                model,
                frames.collect(),
                &clip,
                options,
                &mut notes,
            )?]
        }
        (None, Some(given)) => Masks::given(given, &clip)?,
        (None, None) => Vec::new(),
    };
    let masks = masks.into_iter().filter_map(Masks::by_frame).collect();
    let body = FilmedMotion {
        scale: unit(&motion, at, &mut notes)?,
        motion: &motion,
        up,
        calibration: calibration.as_ref(),
        frames: wanted.clone(),
        number: &numbers,
        size: clip.size,
        fps,
        focal: options.focal,
    };
    let (mut track, masks) = choose(&body, masks, at, &mut notes)?;
    track.distortion = calibration.map_or(track.distortion, |it| it.distortion);
    let has_pose = |frame: &usize| track.frames.iter().any(|it| it.index as usize == *frame);
    left_out(&wanted, "a pose of the person", has_pose, &mut notes);
    if let Some(masks) = &masks {
        let posed: Vec<usize> = track.frames.iter().map(|it| it.index as usize).collect();
        left_out(
            &posed,
            "a mask",
            |frame| masks.contains_key(frame),
            &mut notes,
        );
        track
            .frames
            .retain(|it| masks.contains_key(&(it.index as usize)));
    }
    if track.frames.is_empty() {
        let message = "no frame is left that has a pose and, if there are masks, a mask";
        return Err(fault(at, "EMPTY", message));
    }
    let indices: Vec<usize> = track.frames.iter().map(|it| it.index as usize).collect();
    let mask = |frame: &usize| masks.as_ref().and_then(|masks| masks.get(frame)).cloned();
    let of_frames = indices
        .iter()
        .map(|frame| mask(frame).into_iter().collect());
    Ok(Imported {
        pictures: clip.pictures(&indices, of_frames.collect()),
        available: clip.frames,
        track,
        notes,
        found: Findings::default(),
    })
}

fn summary(motion: &Motion, options: &Options) -> String {
    let joints = motion.skeleton.names.len();
    let whose = match options.keep_skeleton {
        true => "of the file's own",
        false => "in the places of SMPL's",
    };
    let merged = match &motion.unmatched[..] {
        [] => String::new(),
        others => format!("; {} others are merged into those above", others.len()),
    };
    format!(
        "BVH: {} frames at {:.2} a second, {joints} joints {whose}{merged}",
        motion.frames.len(),
        motion.fps
    )
}

/// Metres per unit of the file: the unit that gives the person a plausible size.
fn unit(motion: &Motion, at: &Path, notes: &mut Vec<String>) -> Result<f64, ImportError> {
    /// Units, and metres in each.
    const UNITS: [(&str, f64); 3] = [
        ("metres", 1.0),
        ("centimetres", 0.01),
        ("millimetres", 0.001),
    ];
    /// From the lowest joint to the highest, metres.
    const PEOPLE: std::ops::Range<f64> = 0.7..2.4;
    let heights = motion.skeleton.rest_joints.iter().map(|joint| joint[1]);
    let span = heights.clone().fold(f64::MIN, f64::max) - heights.fold(f64::MAX, f64::min);
    let found = UNITS
        .iter()
        .find(|(_, metres)| PEOPLE.contains(&(span * metres)));
    let Some((name, metres)) = found else {
        let message = format!(
            "its joints span {span:.3} units from the lowest to the highest: no person in metres, centimetres \
             or millimetres"
        );
        return Err(fault(at, "OUT_OF_RANGE", message));
    };
    notes.push(format!(
        "lengths are in {name}: the joints span {:.2} m from the lowest to the highest",
        span * metres
    ));
    Ok(*metres)
}

/// The motion's frame of each frame of the clip: the same, or the nearest in time where the rates differ.
///
/// # Errors
/// When the motion is much longer than the clip.
fn numbers(
    motion: &Motion,
    clip: &Clip,
    fps: f64,
    at: &Path,
    notes: &mut Vec<String>,
) -> Result<impl Fn(usize) -> Option<usize> + use<>, ImportError> {
    /// Rates of the same clip differ by at most this share, because of rounding.
    const SAME: f64 = 0.01;
    /// Motions that are longer than the clip by more than this share belong to another clip.
    const LONGER: f64 = 1.1;
    let ratio = motion.fps / fps;
    let ratio = if (ratio - 1.0).abs() < SAME {
        1.0
    } else {
        ratio
    };
    if ratio != 1.0 {
        notes.push(format!(
            "the motion has {:.2} frames per second, the clip {fps:.2}: each frame of the clip has the pose \
             nearest in time",
            motion.fps
        ));
    }
    let count = motion.frames.len();
    if count as f64 > LONGER * clip.frames as f64 * ratio + 2.0 {
        let message = format!(
            "the motion takes {:.1} s, the clip {:.1} s: is this the clip that it is of? (--fps gives the rate \
             of a folder of pictures)",
            count as f64 / motion.fps,
            clip.frames as f64 / fps
        );
        return Err(fault(at, "SIZE_MISMATCH", message));
    }
    Ok(move |frame: usize| {
        let number = (frame as f64 * ratio).round() as usize;
        (number < count).then_some(number)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_name_tells_a_bvh_file() {
        assert!(fits(Path::new("a/walk.BVH")) && !fits(Path::new("a/bvh")));
    }
}
