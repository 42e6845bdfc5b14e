//! Pixels that are not square: pictures are made wider or higher, so that nothing of them is lost.

use crate::{Limits, MediaFault, Picture};
use std::fmt;

/// Ratios of sides nearer to 1 than this are rounding: the pixels stay.
const SQUARE: f64 = 0.01;

/// The shape of a video's pixels, which are not square.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Aspect {
    /// Width and height of a pixel, in parts of each other.
    pixel: [u32; 2],
}

impl fmt::Display for Aspect {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.pixel;
        write!(to, "{width}:{height}")
    }
}

impl Aspect {
    /// The aspect of pixels of `[width, height]`; `None` for square and unknown ones.
    pub(super) fn of(pixel: [u32; 2]) -> Option<Self> {
        let [width, height] = pixel.map(f64::from);
        let is_known = width > 0.0 && height > 0.0;
        (is_known && (width / height).max(height / width) - 1.0 > SQUARE).then_some(Self { pixel })
    }

    /// This aspect after a quarter turn.
    pub(super) fn turned(self) -> Self {
        let [width, height] = self.pixel;
        Self {
            pixel: [height, width],
        }
    }

    /// Width and height of a pixel, of which the shorter is 1.
    pub(super) fn pixel(self) -> [f64; 2] {
        let [across, down] = self.pixel.map(f64::from);
        [(across / down).max(1.0), (down / across).max(1.0)]
    }

    /// Width and height of a picture with square pixels.
    pub(super) fn size(self, size: [usize; 2]) -> [usize; 2] {
        let [across, down] = self.pixel();
        let [width, height] = size.map(|side| side as f64);
        [width * across, height * down].map(|side| side.round() as usize)
    }

    /// The picture with square pixels.
    ///
    /// # Errors
    /// `TOO_LARGE` if it has more pixels on a side than allowed.
    pub(super) fn apply(self, picture: Picture, limits: &Limits) -> Result<Picture, MediaFault> {
        let [width, height] = self.size([picture.width, picture.height]);
        if width.max(height) > limits.side as usize {
            let message = format!(
                "{width}x{height} square pixels; each side must be at most {}",
                limits.side
            );
            return Err(MediaFault::new("TOO_LARGE", message));
        }
        let across = samples(picture.width, width);
        let down = samples(picture.height, height);
        let (pixels, _) = picture.rgb.as_chunks::<3>();
        let at = |x: usize, y: usize| {
            let pixel = pixels.get(y * picture.width + x);
            pixel.copied().unwrap_or_default().map(u32::from)
        };
        let mut rgb = Vec::with_capacity(width * height * 3);
        for &([top, bottom], low) in &down {
            for &([left, right], far) in &across {
                let (a, b) = (at(left, top), at(right, top));
                let (c, d) = (at(left, bottom), at(right, bottom));
                rgb.extend((0..3).map(|channel| {
                    let above = a[channel] * (ONE - far) + b[channel] * far;
                    let below = c[channel] * (ONE - far) + d[channel] * far;
                    let sum = above * (ONE - low) + below * low;
                    ((sum + ONE * ONE / 2) / (ONE * ONE)) as u8
                }));
            }
        }
        Ok(Picture {
            width,
            height,
            rgb,
            alpha: None,
            lossy: picture.lossy,
        })
    }
}

/// Weights are parts of this.
const ONE: u32 = 256;

/// For each of `to` samples: its two neighbours among `from`, and the weight of the second.
fn samples(from: usize, to: usize) -> Vec<([usize; 2], u32)> {
    let last = from.saturating_sub(1);
    let sample = |at: usize| {
        let place = (at as f64 + 0.5) * from as f64 / to as f64 - 0.5;
        let place = place.clamp(0.0, last as f64);
        let first = place as usize;
        let weight = (place.fract() * f64::from(ONE)).round() as u32;
        ([first, (first + 1).min(last)], weight)
    };
    (0..to).map(sample).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(width: usize, levels: &[u8]) -> Picture {
        Picture {
            width,
            height: levels.len() / width,
            rgb: levels.iter().flat_map(|&level| [level; 3]).collect(),
            alpha: None,
            lossy: true,
        }
    }

    #[test]
    fn nearly_square_pixels_stay() {
        for square in [[1, 1], [0, 1], [0, 0], [959, 960], [405, 404]] {
            assert_eq!(Aspect::of(square), None, "{square:?}");
        }
        let wide = Aspect::of([16, 15]).expect("not square");
        assert_eq!(wide.size([720, 576]), [768, 576]);
        assert_eq!(wide.turned().size([576, 720]), [576, 768]);
        let narrow = Aspect::of([8, 9]).expect("not square");
        assert_eq!(narrow.size([720, 480]), [720, 540]);
    }

    #[test]
    fn a_picture_is_made_wider_or_higher() {
        let limits = Limits::default();
        let wide = Aspect::of([2, 1]).expect("not square");
        let made = wide.apply(grey(2, &[0, 200, 100, 100]), &limits);
        assert_eq!(made, Ok(grey(4, &[0, 50, 150, 200, 100, 100, 100, 100])));
        let high = wide.turned().apply(grey(1, &[0, 200]), &limits);
        assert_eq!(high, Ok(grey(1, &[0, 50, 150, 200])));
        let few = Limits { side: 3, ..limits };
        let fault = wide.apply(grey(2, &[0, 0]), &few).expect_err("too wide");
        assert_eq!(fault.code, "TOO_LARGE");
    }
}
