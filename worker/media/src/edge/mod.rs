//! Edges of a person before a scene: coverage and colours without the background's share.
//!
//! Masks of a segmentation network are good to some pixels, so the wall stands around hair and shoulders. Near a
//! mask's edge, a pixel's colour is I = α F + (1 − α) B (the compositing equation). B is known where a camera stands
//! still ([`background`]); elsewhere it continues from the pixels around. F continues from inside. α follows.

mod background;
mod band;
mod extrapolate;
mod shift;
mod solve;

pub use background::{BackgroundBuilder, KnownBackground};

use crate::{Picture, compose};
use band::Band;
use yoto_proto::media_plan::Background;

/// Colours of a picture as numbers.
type Rgb = [f32; 3];

/// Corrects `mask` near its edge, and returns the colours over black, `[height, width, 3]`: the person's share of
/// each pixel, premultiplied by the coverage. A mask without an inside stays as it is.
///
/// # Panics
/// If the sizes of `picture`, `mask` and `known` differ.
pub fn refine(picture: Picture, mask: &mut [u8], known: &KnownBackground) -> Vec<u8> {
    assert_eq!(mask.len(), picture.pixels(), "a mask of another size");
    let mut solved = Vec::new();
    if let Some(band) = Band::around(mask, picture.width) {
        solved = solve::solve(&band, picture.rgb.as_chunks().0, mask, known);
        band.settle(mask);
    }
    for it in &solved {
        mask[it.pixel] = (it.alpha * 255.0 + 0.5) as u8;
    }
    let mut rgb = compose::over_black(picture, mask, Background::Scene);
    let pixels = rgb.as_chunks_mut::<3>().0;
    for it in &solved {
        pixels[it.pixel] = it.own;
    }
    rgb
}

#[cfg(test)]
mod tests;
