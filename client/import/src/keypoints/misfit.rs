//! Why key points don't lie in masks: mirrored or turned pictures, and masks of other frames.

use super::detections::{Detection, SURE};
use crate::clip::Clip;
use crate::pictures::read_masks;
use crate::proof::Masks;
use yoto_client::ClientError;
use yoto_terminal::progress::count;

/// Frames that are looked at.
const FRAMES: usize = 16;
/// Share of points inside from which on a guess is named.
const GOOD: f64 = 0.8;
/// Share of points inside above which nothing is wrong with the frames.
const FITS: f64 = 0.9;
/// By how much other frames must fit better, shares of the points.
const BETTER: f64 = 0.05;
/// Frames by which masks and points are tried to be apart.
const FARTHEST: i64 = 5;

/// A point of a picture of `[width, height]` in another picture of the same scene.
type Change = fn([f64; 2], [f64; 2]) -> [f64; 2];

/// Changes that are guessed. The points of a picture that was turned by the angle named are turned back.
const CHANGES: [(&str, Change); 5] = [
    ("mirrored left to right", |[x, y], [w, _]| [w - x, y]),
    ("turned by 90° clockwise", |[x, y], [_, h]| [y, h - x]),
    ("turned by 90° counter-clockwise", |[x, y], [w, _]| {
        [w - y, x]
    }),
    ("turned by 180°", |[x, y], [w, h]| [w - x, h - y]),
    ("upside down", |[x, y], [_, h]| [x, h - y]),
];

/// The share of sure points that lie inside the masks `shift` frames later, after a change.
pub(super) fn share(
    masks: &Masks,
    clip: &Clip,
    seen: &[(usize, &Detection)],
    shift: i64,
    change: Change,
) -> Result<f64, ClientError> {
    let size = clip.size.map(f64::from);
    let (mut inside, mut all) = (0, 0);
    for (frame, detection) in seen.iter().step_by(seen.len().div_ceil(FRAMES).max(1)) {
        let masked = usize::try_from(*frame as i64 + shift).ok();
        let Some(mask) = masked.and_then(|frame| masks.of_frame(frame)) else {
            continue;
        };
        let image = read_masks(&[mask], clip.size, *frame as u32)?;
        for &[x, y, sure] in &detection.picture {
            let [x, y] = change([x, y], size);
            if sure > SURE && x >= 0.0 && y >= 0.0 {
                let level = image.get_pixel_checked(x as u32, y as u32);
                all += 1;
                inside += usize::from(level.is_some_and(|level| level.0[0] >= 128));
            }
        }
    }
    Ok(f64::from(inside as u32) / f64::from(all.max(1)))
}

/// Which pictures points outside of the masks may be of; `None` if no guess fits.
pub(super) fn guess(
    masks: &Masks,
    clip: &Clip,
    seen: &[(usize, &Detection)],
) -> Result<Option<String>, ClientError> {
    let mut best: Option<(f64, &str)> = None;
    for (words, change) in CHANGES {
        let share = share(masks, clip, seen, 0, change)?;
        if share >= GOOD && best.is_none_or(|(most, _)| share > most) {
            best = Some((share, words));
        }
    }
    Ok(best.map(|(share, words)| {
        format!(
            "they are those of pictures {words} ({:.0} % lie inside then): let the detector see the clip as it is shown",
            100.0 * share
        )
    }))
}

/// Frames by which the masks fit clearly better, if the share `found` lies in those of the same frames.
pub(super) fn shifted(
    masks: &Masks,
    clip: &Clip,
    seen: &[(usize, &Detection)],
    found: f64,
) -> Result<Option<String>, ClientError> {
    if found >= FITS {
        return Ok(None);
    }
    let mut best = (found + BETTER, 0);
    for shift in (-FARTHEST..=FARTHEST).filter(|shift| *shift != 0) {
        let share = share(masks, clip, seen, shift, |point, _| point)?;
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
