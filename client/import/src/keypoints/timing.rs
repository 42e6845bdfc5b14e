//! Decides by masks whether detections belong to the frames of their numbers or to the frames before.
//!
//! In the right frame, the box around the points and the box of the mask move together. What flesh, hair and clothes
//! add to the points is nearly constant, so the median of each side's distance is taken off.

use super::detections::{Detection, Detections, SURE};
use crate::ImportError;
use crate::clip::{Clip, FrameNumbering};
use crate::pictures::{Mask, read_masks};
use std::collections::BTreeMap;

/// Frames that are looked at.
const FRAMES: usize = 64;
/// Fewest frames that decide.
const FEWEST: usize = 4;
/// The other numbering is taken if the error of its boxes is less than this share of the first one's.
const BETTER: f64 = 0.8;
/// Fewest points that make a box.
const POINTS: usize = 6;

/// Detections with their frames of the clip.
type ByFrame<'a> = Vec<(usize, &'a Detection)>;

/// The detections `seen` with the frames that `counting` gives, or those of the `other` numbering if `masks` agree
/// better with them; with a note where it is not sure that frames are counted from 0.
///
/// # Errors
/// A mask that can't be read.
pub(super) fn decide<'a>(
    counting: FrameNumbering,
    found: &Detections,
    seen: ByFrame<'a>,
    other: Result<ByFrame<'a>, ImportError>,
    masks: Option<&BTreeMap<usize, Mask>>,
    clip: &Clip,
    notes: &mut Vec<String>,
) -> Result<ByFrame<'a>, ImportError> {
    let numbers = || found.frames.iter().map(|frame| frame.number);
    let (least, last) = (numbers().min(), numbers().max());
    let said = format!(
        "the frames of the file, {} to {}, are counted from",
        least.unwrap_or_default(),
        last.unwrap_or_default()
    );
    if counting.is_sure {
        if counting.first > 0 {
            notes.push(format!(
                "{said} {}: the clip has {} frames",
                counting.first, clip.frames
            ));
        }
        return Ok(seen);
    }
    let is_possible = other.is_ok();
    let misfits = match (masks, &other) {
        (Some(masks), Ok(other)) if !other.is_empty() => {
            misfit(masks, clip, &seen)?.zip(misfit(masks, clip, other)?)
        }
        _ => None,
    };
    let (first, seen, misfits) = match (misfits, other) {
        (Some((given, better)), Ok(other)) if better < BETTER * given => {
            (counting.other(), other, Some((better, given)))
        }
        (misfits, _) => (counting.first, seen, misfits),
    };
    // Points that begin within the clip begin with any number.
    if least != Some(1) && first == 0 {
        return Ok(seen);
    }
    let alternative = 1 - first.min(1);
    notes.push(match misfits {
        Some((taken, other)) if taken < BETTER * other => format!(
            "{said} {first}: so the boxes of points and masks are off by {taken:.2} px, by {other:.2} px \
             counted from {alternative}"
        ),
        Some((taken, other)) => format!(
            "{said} {first}, or from {alternative}: the masks agree as well with both ({taken:.2} and {other:.2} px)"
        ),
        None if is_possible => {
            format!("{said} {first}, or from {alternative}: only masks tell (--masks)")
        }
        None => format!("{said} {first}: the clip has {} frames", clip.frames),
    });
    Ok(seen)
}

/// The mean distance of the sides of boxes around points from those of masks, less the median of each side, pixels;
/// `None` of few frames.
fn misfit(
    masks: &BTreeMap<usize, Mask>,
    clip: &Clip,
    seen: &[(usize, &Detection)],
) -> Result<Option<f64>, ImportError> {
    let mut sides: [Vec<f64>; 4] = Default::default();
    for (frame, detection) in seen.iter().step_by(seen.len().div_ceil(FRAMES).max(1)) {
        let sure = detection.picture.iter().filter(|point| point[2] > SURE);
        let (Some(mask), Some(points)) = (masks.get(frame), detection.bounds()) else {
            continue;
        };
        let image = read_masks(std::slice::from_ref(mask), clip.size, *frame as u32)?;
        if let (Some(mask), true) = (bounds(&image), sure.count() >= POINTS) {
            for ((side, mask), point) in sides.iter_mut().zip(mask).zip(points) {
                side.push(mask - point);
            }
        }
    }
    let off = |side: &mut Vec<f64>| {
        side.sort_by(f64::total_cmp);
        let median = side.get(side.len() / 2).copied().unwrap_or_default();
        side.iter().map(|it| (it - median).abs()).sum::<f64>() / side.len().max(1) as f64
    };
    let frames = sides[0].len();
    let mean = sides.iter_mut().map(off).sum::<f64>() / 4.0;
    Ok((frames >= FEWEST).then_some(mean))
}

/// The box around what a mask covers by at least half: x0, y0, x1, y1.
fn bounds(mask: &image::GrayImage) -> Option<[f64; 4]> {
    let mut bounds: Option<[u32; 4]> = None;
    for (x, y, level) in mask.enumerate_pixels() {
        if level.0[0] >= 128 {
            let [x0, y0, x1, y1] = bounds.unwrap_or([x, y, x, y]);
            bounds = Some([x0.min(x), y0.min(y), x1.max(x), y1.max(y)]);
        }
    }
    bounds.map(|bounds| bounds.map(f64::from))
}
