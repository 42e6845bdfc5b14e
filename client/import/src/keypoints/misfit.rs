//! Guesses why key points lie outside masks: mirrored or rotated pictures, pictures of another size, or masks of other frames.

use super::detections::{Detection, SURE};
use super::picture_transform::PictureTransform;
use super::point_rotation::PointRotation;
use crate::ImportError;
use crate::clip::Clip;
use crate::pictures::read_masks;
use crate::proof::Masks;
use yoto_proto::text::count;

/// Number of frames that are compared.
const FRAMES: usize = 16;
/// A guess is named if at least this share of the points lies inside the masks.
const GOOD: f64 = 0.8;
/// Above this share of points inside the masks, the frames are right.
const FITS: f64 = 0.9;
/// Masks of other frames must fit better by this share of the points.
const BETTER: f64 = 0.05;
/// Sizes of pictures, as shares of the clip's, that are tried.
const FACTORS: [f64; 10] = [
    0.25,
    1.0 / 3.0,
    0.5,
    2.0 / 3.0,
    0.75,
    4.0 / 3.0,
    1.5,
    2.0,
    3.0,
    4.0,
];
/// Delays between masks and points of up to this many frames are tried.
const FARTHEST: i64 = 5;

/// Changes that are guessed, with words for them and the options that undo them.
const CHANGES: [(&str, &str, PictureTransform); 5] = [
    (
        "mirrored left to right",
        "--mirror-points",
        PictureTransform {
            mirrored: true,
            ..PictureTransform::SHOWN
        },
    ),
    (
        "turned by 90° clockwise",
        "--turn-points 90",
        turned(PointRotation::Quarter, false),
    ),
    (
        "turned by 90° counter-clockwise",
        "--turn-points 270",
        turned(PointRotation::ThreeQuarters, false),
    ),
    (
        "turned by 180°",
        "--turn-points 180",
        turned(PointRotation::Half, false),
    ),
    (
        "upside down",
        "--turn-points 180 --mirror-points",
        turned(PointRotation::Half, true),
    ),
];

const fn turned(rotation: PointRotation, mirrored: bool) -> PictureTransform {
    PictureTransform {
        rotation: Some(rotation),
        mirrored,
        ..PictureTransform::SHOWN
    }
}

/// The share of sure points that lie inside the masks `shift` frames later, of pictures `seen_as` the detector saw them.
pub(super) fn share(
    masks: &Masks,
    clip: &Clip,
    seen: &[(usize, &Detection)],
    shift: i64,
    seen_as: &PictureTransform,
) -> Result<f64, ImportError> {
    let size = clip.size.map(f64::from);
    let (mut inside, mut all) = (0, 0);
    for (frame, detection) in seen.iter().step_by(seen.len().div_ceil(FRAMES).max(1)) {
        let masked = usize::try_from(*frame as i64 + shift).ok();
        let Some(mask) = masked.and_then(|frame| masks.of_frame(frame)) else {
            continue;
        };
        let image = read_masks(&[mask], clip.size, *frame as u32)?;
        for &[x, y, sure] in &detection.picture {
            let [x, y] = seen_as.back([x, y], size);
            if sure > SURE && x >= 0.0 && y >= 0.0 {
                let level = image.get_pixel_checked(x as u32, y as u32);
                all += 1;
                inside += usize::from(level.is_some_and(|level| level.0[0] >= 128));
            }
        }
    }
    Ok(f64::from(inside as u32) / f64::from(all.max(1)))
}

/// A guess which pictures the detector saw, with the options that undo it; `None` if no guess fits. The points were already
/// transformed as `given` by the user.
pub(super) fn guess(
    masks: &Masks,
    clip: &Clip,
    seen: &[(usize, &Detection)],
    given: &PictureTransform,
) -> Result<Option<String>, ImportError> {
    let mut best: Option<(f64, &str, &str)> = None;
    let [width, height] = clip.size.map(f64::from);
    for (words, options, change) in CHANGES {
        // Shares of the picture's sides were multiplied with the clip's sides.
        let [across, down] = change.size([width, height]);
        let of_shares = PictureTransform {
            scale: [height / width, width / height],
            ..change
        };
        let is_quarter = [across, down] != [width, height];
        let changes = [Some(change), is_quarter.then_some(of_shares)];
        for change in changes.iter().flatten() {
            let share = share(masks, clip, seen, 0, change)?;
            if share >= GOOD && best.is_none_or(|(most, ..)| share > most) {
                best = Some((share, words, options));
            }
        }
    }
    Ok(best.map(|(share, words, options)| {
        let how = match *given == PictureTransform::SHOWN {
            true => format!("with {options} they become those of the clip as it is shown"),
            false => "that is after the options that turn and mirror them".to_owned(),
        };
        format!(
            "they are those of pictures {words} ({:.0} % lie inside then): {how}",
            100.0 * share
        )
    }))
}

/// How much larger or smaller the pictures are in which the points lie inside the masks; `None` if none of the usual factors fits.
pub(super) fn scaled(
    masks: &Masks,
    clip: &Clip,
    seen: &[(usize, &Detection)],
) -> Result<Option<String>, ImportError> {
    let mut best: Option<(f64, f64)> = None;
    for factor in FACTORS {
        let change = PictureTransform {
            scale: [factor; 2],
            ..PictureTransform::SHOWN
        };
        let share = share(masks, clip, seen, 0, &change)?;
        if share >= GOOD && best.is_none_or(|(most, _)| share > most) {
            best = Some((share, factor));
        }
    }
    Ok(best.map(|(share, factor)| {
        let [width, height] = clip.size.map(|side| (f64::from(side) * factor).round());
        format!(
            "they are those of pictures of about {width}x{height}, {factor:.2} times the clip's ({:.0} % lie inside then): give the clip \
             that the detector saw, or points of this one",
            100.0 * share
        )
    }))
}

/// The delay, in frames, with which the masks fit clearly better than the share `found` without a delay.
pub(super) fn shifted(
    masks: &Masks,
    clip: &Clip,
    seen: &[(usize, &Detection)],
    found: f64,
) -> Result<Option<String>, ImportError> {
    if found >= FITS {
        return Ok(None);
    }
    let mut best = (found + BETTER, 0);
    for shift in (-FARTHEST..=FARTHEST).filter(|shift| *shift != 0) {
        let share = share(masks, clip, seen, shift, &PictureTransform::SHOWN)?;
        if share > best.0 {
            best = (share, shift);
        }
    }
    let (share, shift) = best;
    Ok((shift != 0).then(|| {
        let frames = count(shift.unsigned_abs() as usize, "frame");
        let (masks, points) = if shift > 0 { ("later", "early") } else { ("earlier", "late") };
        format!(
            "masks {frames} {masks} hold {:.0} % of the key points, so that the points seem to be {frames} {points} (with --mask-shift \
             {shift}, the capture is checked and added with these masks)",
            100.0 * share
        )
    }))
}
