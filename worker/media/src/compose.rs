//! Composes a picture and its mask to the person over black, the form for training.

use crate::Picture;
use yoto_proto::media_plan::Background;

/// The background of a picture is black if no more than this share of its pixels is brighter than
/// [`BLACK`].
const BRIGHT_SHARE: f64 = 0.01;
/// Brightest level of black after compression.
const BLACK: u8 = 16;

/// The background, from the pixels with mask 0; `None` without such pixels.
pub fn background(picture: &Picture, mask: &[u8]) -> Option<Background> {
    let (mut outside, mut bright) = (0usize, 0usize);
    for (pixel, &coverage) in picture.rgb.chunks_exact(3).zip(mask) {
        if coverage == 0 {
            outside += 1;
            bright += usize::from(pixel.iter().any(|&v| v > BLACK));
        }
    }
    if outside == 0 {
        None
    } else if bright as f64 <= BRIGHT_SHARE * outside as f64 {
        Some(Background::Black)
    } else {
        Some(Background::Scene)
    }
}

/// `[height, width, 3]` premultiplied by `mask`.
///
/// A picture over black is premultiplied already; after lossy compression, its colours are clamped
/// to the coverage, the largest premultiplied value. With a scene as background, each pixel is
/// multiplied by its coverage.
pub fn over_black(picture: Picture, mask: &[u8], background: Background) -> Vec<u8> {
    let mut rgb = picture.rgb;
    let times = |value: u8, coverage: u8| {
        let product = u32::from(value) * u32::from(coverage);
        ((product + 127) / 255) as u8
    };
    if let Some(alpha) = &picture.alpha {
        for (pixel, &alpha) in rgb.chunks_exact_mut(3).zip(alpha) {
            pixel
                .iter_mut()
                .for_each(|value| *value = times(*value, alpha));
        }
        if alpha == mask {
            return rgb;
        }
    }
    for (pixel, &coverage) in rgb.chunks_exact_mut(3).zip(mask) {
        for value in pixel {
            match background {
                Background::Scene => *value = times(*value, coverage),
                Background::Black if picture.lossy => *value = (*value).min(coverage),
                Background::Black => {}
            }
        }
    }
    rgb
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(rgb: Vec<u8>, alpha: Option<Vec<u8>>, lossy: bool) -> Picture {
        Picture {
            width: rgb.len() / 3,
            height: 1,
            rgb,
            alpha,
            lossy,
        }
    }

    #[test]
    fn black_and_scenes_are_told_apart() {
        let mask = [255, 128, 0, 0];
        let black = picture(
            vec![200, 200, 200, 100, 100, 100, 3, 2, 1, 0, 9, 0],
            None,
            true,
        );
        assert_eq!(background(&black, &mask), Some(Background::Black));
        let scene = picture(vec![90; 12], None, true);
        assert_eq!(background(&scene, &mask), Some(Background::Scene));
        assert_eq!(background(&scene, &[1; 4]), None);
    }

    #[test]
    fn every_source_ends_premultiplied() {
        let mask = [255, 128, 0];
        let rgb = vec![200, 100, 50, 200, 100, 50, 9, 9, 9];
        let scene = over_black(picture(rgb.clone(), None, true), &mask, Background::Scene);
        assert_eq!(scene, [200, 100, 50, 100, 50, 25, 0, 0, 0]);
        let clamped = over_black(picture(rgb.clone(), None, true), &mask, Background::Black);
        assert_eq!(clamped, [200, 100, 50, 128, 100, 50, 0, 0, 0]);
        let exact = over_black(picture(rgb.clone(), None, false), &mask, Background::Black);
        assert_eq!(exact, rgb);
        let cut_out = picture(rgb, Some(mask.to_vec()), false);
        assert_eq!(over_black(cut_out, &mask, Background::Scene), scene);
    }
}
