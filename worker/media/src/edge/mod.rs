//! Edges of a person before a scene: coverage and colours without the background's share.
//!
//! Masks of a segmentation network are good to some pixels, so the wall stands around hair and shoulders. Near a
//! mask's edge, a pixel's colour is I = α F + (1 − α) B (the compositing equation). B is known where a camera stands
//! still ([`background`]); elsewhere it continues from the pixels around. F continues from inside. α follows.

mod background;
mod band;
mod extrapolate;
mod solve;

pub use background::{BackgroundBuilder, KnownBackground};

use crate::Picture;
use band::Band;

/// Colours of a picture as numbers.
type Rgb = [f32; 3];

/// Corrects `mask` near its edge, and returns the colours over black, `[height, width, 3]`: the person's share of
/// each pixel, premultiplied by the coverage. A mask without an inside stays as it is.
///
/// # Panics
/// If the sizes of `picture`, `mask` and `known` differ.
pub fn refine(picture: &Picture, mask: &mut [u8], known: &KnownBackground) -> Vec<u8> {
    let (width, height) = (picture.width, picture.height);
    assert_eq!(mask.len(), width * height, "a mask of another size");
    let pixels = picture.rgb.as_chunks::<3>().0;
    let band = Band::around(mask, width);
    let solved = band.map(|band| {
        let solved = solve::solve(&band, pixels, mask, known);
        band.settle(mask);
        solved
    });
    let solved = solved.unwrap_or_default();
    for it in &solved {
        mask[it.pixel] = (it.alpha * 255.0 + 0.5) as u8;
    }
    let mut rgb = vec![0; picture.rgb.len()];
    let out = rgb.as_chunks_mut::<3>().0;
    for ((out, pixel), &coverage) in out.iter_mut().zip(pixels).zip(&*mask) {
        match coverage {
            0 => (),
            255 => *out = *pixel,
            _ => *out = pixel.map(|value| (u32::from(value) * u32::from(coverage) / 255) as u8),
        }
    }
    for it in &solved {
        out[it.pixel] = std::array::from_fn(|c| {
            let own = f32::from(pixels[it.pixel][c]) - (1.0 - it.alpha) * it.background[c];
            (own.clamp(0.0, 255.0 * it.alpha) + 0.5) as u8
        });
    }
    rgb
}

#[cfg(test)]
mod tests;
