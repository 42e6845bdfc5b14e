//! Masks: coverage 0 to 255 per pixel, from the sources of a capture.

use crate::{MediaFault, Picture};
use yoto_proto::media_plan::MaskKind;

/// Levels of difference to the clean background between which coverage rises from 0 to 255.
const KEY_LEVELS: (f32, f32) = (12.0, 36.0);
/// A patch of the difference key smaller than this share of the largest is noise.
const KEY_SHARE: usize = 20;
/// Largest error of JPEG or video, levels.
const LOSSY_NOISE: u8 = 16;
/// Labels are small numbers: a coverage mask whose brightest pixel is below this probably has
/// labels instead.
const DARKEST_COVERAGE: u8 = 32;

/// `[height, width]` coverage from a mask picture.
///
/// # Errors
/// `LOOKS_LIKE_LABELS` for a coverage mask of a few dark levels only.
pub fn from_picture(picture: &Picture, kind: MaskKind) -> Result<Vec<u8>, MediaFault> {
    match kind {
        MaskKind::Coverage => {
            let mut coverage: Vec<u8> = picture.rgb.chunks_exact(3).map(luma).collect();
            if picture.lossy {
                coverage.iter_mut().for_each(|it| *it = snapped(*it));
            }
            let brightest = coverage.iter().copied().max().unwrap_or_default();
            if (1..DARKEST_COVERAGE).contains(&brightest) {
                let message = format!(
                    "its brightest pixel is {brightest} of 255: coverage has 255 inside the \
                     person; if these are labels, say so (mask kind 'labels')"
                );
                return Err(MediaFault::new("LOOKS_LIKE_LABELS", message));
            }
            Ok(coverage)
        }
        MaskKind::Inverted => {
            let mut coverage = from_picture(picture, MaskKind::Coverage)?;
            coverage.iter_mut().for_each(|it| *it = 255 - *it);
            Ok(coverage)
        }
        MaskKind::Labels if picture.lossy => Err(MediaFault::new(
            "UNSUPPORTED",
            "labels can't be read from JPEG or video, which change numbers slightly; PNG preserves them",
        )),
        MaskKind::Labels => Ok(picture
            .rgb
            .chunks_exact(3)
            .map(|pixel| if pixel == [0; 3] { 0 } else { 255 })
            .collect()),
    }
}

/// Removes compression noise near zero and full coverage.
fn snapped(coverage: u8) -> u8 {
    match coverage {
        0..LOSSY_NOISE => 0,
        _ if coverage > 255 - LOSSY_NOISE => 255,
        other => other,
    }
}

/// Rec. 601 luma. The weights add up to 256, so gray pixels keep their level exactly.
fn luma(pixel: &[u8]) -> u8 {
    let [r, g, b] = [0, 1, 2].map(|i| u32::from(pixel[i]));
    ((77 * r + 150 * g + 29 * b + 128) >> 8) as u8
}

/// Coverage from the difference between a picture and `plate`, the same view without the person: a
/// difference key. Shadows and clothes of the background's colour cause errors, so reports always
/// name the method.
///
/// The largest of the three channels' differences, averaged over 3x3 pixels, rises to full
/// coverage over [`KEY_LEVELS`]; patches far smaller than the largest are dropped.
///
/// # Errors
/// `SIZE_MISMATCH` when the two have different sizes.
pub fn difference_key(picture: &Picture, plate: &Picture) -> Result<Vec<u8>, MediaFault> {
    let (width, height) = (picture.width, picture.height);
    if (plate.width, plate.height) != (width, height) {
        let message = format!(
            "{}x{} pixels, the frame has {width}x{height}",
            plate.width, plate.height
        );
        return Err(MediaFault::new("SIZE_MISMATCH", message));
    }
    let difference: Vec<u8> = picture
        .rgb
        .chunks_exact(3)
        .zip(plate.rgb.chunks_exact(3))
        .map(|(a, b)| {
            (0..3)
                .map(|i| a[i].abs_diff(b[i]))
                .max()
                .unwrap_or_default()
        })
        .collect();
    let (low, high) = KEY_LEVELS;
    let mut coverage = Vec::with_capacity(difference.len());
    for y in 0..height {
        for x in 0..width {
            let (mut sum, mut count) = (0.0, 0.0);
            for row in y.saturating_sub(1)..(y + 2).min(height) {
                for column in x.saturating_sub(1)..(x + 2).min(width) {
                    sum += f32::from(difference[row * width + column]);
                    count += 1.0;
                }
            }
            let share = ((sum / count - low) / (high - low)).clamp(0.0, 1.0);
            coverage.push((share * 255.0).round() as u8);
        }
    }
    drop_small_patches(&mut coverage, width);
    Ok(coverage)
}

/// Clears connected patches (of 4 neighbours) smaller than a [`KEY_SHARE`]th of the largest.
fn drop_small_patches(coverage: &mut [u8], width: usize) {
    let mut patch = vec![0u32; coverage.len()];
    let mut sizes = vec![0usize];
    let mut open = Vec::new();
    for start in 0..coverage.len() {
        if coverage[start] == 0 || patch[start] != 0 {
            continue;
        }
        let id = sizes.len() as u32;
        sizes.push(0);
        patch[start] = id;
        open.push(start);
        while let Some(at) = open.pop() {
            sizes[id as usize] += 1;
            let column = at % width;
            let neighbours = [
                (column > 0).then(|| at - 1),
                (column + 1 < width).then(|| at + 1),
                at.checked_sub(width),
                (at + width < coverage.len()).then(|| at + width),
            ];
            for next in neighbours.into_iter().flatten() {
                if coverage[next] > 0 && patch[next] == 0 {
                    patch[next] = id;
                    open.push(next);
                }
            }
        }
    }
    let largest = sizes.iter().copied().max().unwrap_or_default();
    for (pixel, id) in coverage.iter_mut().zip(patch) {
        if sizes[id as usize] * KEY_SHARE < largest {
            *pixel = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gray(width: usize, levels: &[u8]) -> Picture {
        Picture {
            width,
            height: levels.len() / width,
            rgb: levels.iter().flat_map(|&v| [v; 3]).collect(),
            alpha: None,
            lossy: false,
        }
    }

    #[test]
    fn coverage_is_kept_and_labels_become_full_coverage() {
        let levels = [0, 64, 128, 255];
        let mask = gray(2, &levels);
        assert_eq!(
            from_picture(&mask, MaskKind::Coverage).expect("fine"),
            levels
        );
        assert_eq!(
            from_picture(&mask, MaskKind::Labels).expect("fine"),
            [0, 255, 255, 255]
        );
        assert_eq!(
            from_picture(&mask, MaskKind::Inverted).expect("fine"),
            levels.map(|it| 255 - it)
        );
        let mut film = gray(2, &[3, 15, 128, 241]);
        film.lossy = true;
        assert_eq!(
            from_picture(&film, MaskKind::Coverage).expect("fine"),
            [0, 0, 128, 255]
        );
        assert_eq!(
            from_picture(&film, MaskKind::Labels)
                .expect_err("lossy")
                .code,
            "UNSUPPORTED"
        );
        let labels = gray(2, &[0, 1, 2, 3]);
        let fault = from_picture(&labels, MaskKind::Coverage).expect_err("labels");
        assert_eq!(fault.code, "LOOKS_LIKE_LABELS");
        assert!(from_picture(&labels, MaskKind::Labels).is_ok());
        assert_eq!(
            from_picture(&gray(2, &[0; 4]), MaskKind::Coverage).expect("nobody"),
            [0; 4]
        );
    }

    #[test]
    fn the_difference_key_finds_what_is_new_and_drops_specks() {
        let (width, height) = (32, 24);
        let plate: Vec<u8> = (0..width * height).map(|i| (i % 7) as u8 * 9).collect();
        let inside = |i: usize| (8..20).contains(&(i % width)) && (6..20).contains(&(i / width));
        let mut seen: Vec<u8> = plate
            .iter()
            .enumerate()
            .map(|(i, &v)| {
                if inside(i) {
                    v + 100
                } else {
                    v + (i % 3) as u8
                }
            })
            .collect();
        seen[width + 30] = 255;
        let mask = difference_key(&gray(width, &seen), &gray(width, &plate)).expect("same size");
        for (i, &coverage) in mask.iter().enumerate() {
            let (x, y) = (i % width, i / width);
            let core = (9..19).contains(&x) && (7..19).contains(&y);
            let far = !(6..22).contains(&x) || !(4..22).contains(&y);
            assert!(!core || coverage == 255, "{x},{y}: {coverage}");
            assert!(!far || coverage == 0, "{x},{y}: {coverage}");
        }
        let other = difference_key(&gray(2, &[0; 4]), &gray(4, &[0; 4]));
        assert_eq!(other.expect_err("sizes").code, "SIZE_MISMATCH");
    }
}
