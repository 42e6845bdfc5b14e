//! The exposure that explains best how a frame differs from the model's picture of it.

use crate::config::ExposureConfig;
use crate::render::FrameExposure;
use yoto_capture::FrameImage;

/// Side of the blocks of pixels whose means are compared, as a share of the picture's longer side: edges that are
/// a pixel off leave no trace in a mean.
const BLOCK: usize = 48;
/// Coverage of pixels that have no background in them.
const WHOLE: u8 = 250;
/// Opacity from which on the model shows the person there.
const OPAQUE: f32 = 0.9;
/// Values above are clipped: they no longer say how a frame is exposed.
const CLIPPED: f32 = 0.98;
/// Fewest blocks that an exposure is fitted to.
const FEWEST: usize = 12;
/// A difference that counts half.
const ROBUST: f64 = 0.1;
/// Rounds of the robust fit.
const ROUNDS: usize = 4;
/// Bounds of a gain.
const GAINS: [f64; 2] = [0.1, 10.0];

/// The mean colours of a block in the model's picture and in the frame.
struct Block {
    seen: [f32; 3],
    truth: [f32; 3],
}

/// The exposure of `image` over `picture` `[H W, 4]`, colour over black and opacity of the model's picture in
/// neutral exposure; `None` where the frame shows too little of the person.
pub(super) fn exposure(
    picture: &[f32],
    image: &FrameImage,
    config: &ExposureConfig,
) -> Option<FrameExposure> {
    let blocks = blocks(picture.as_chunks::<4>().0, image);
    if blocks.len() < FEWEST {
        return None;
    }
    let mut found = FrameExposure::NEUTRAL;
    for c in 0..3 {
        let pairs = blocks.iter().filter(|it| it.truth[c] < CLIPPED);
        let pairs: Vec<[f64; 2]> = pairs
            .map(|it| [f64::from(it.seen[c]), f64::from(it.truth[c])])
            .collect();
        let [gain, offset] = line(&pairs, config);
        found.gain[c] = gain.clamp(GAINS[0], GAINS[1]) as f32;
        found.offset[c] = offset as f32;
    }
    Some(found)
}

/// Blocks that show nothing but the person, in both pictures.
fn blocks(picture: &[[f32; 4]], image: &FrameImage) -> Vec<Block> {
    let (width, height) = (image.width, image.height);
    let side = (width.max(height) / BLOCK).max(2);
    let corners = (0..height / side).flat_map(|y| (0..width / side).map(move |x| (x, y)));
    let block = |(x, y): (usize, usize)| {
        let (mut seen, mut truth) = ([0f32; 3], [0f32; 3]);
        for row in y * side..(y + 1) * side {
            let first = row * width + x * side;
            let pixels = picture[first..first + side].iter();
            let masks = &image.mask[first..first + side];
            let filmed = image.rgb[3 * first..3 * (first + side)].chunks_exact(3);
            for ((drawn, mask), filmed) in pixels.zip(masks).zip(filmed) {
                let [.., alpha] = drawn;
                if *mask < WHOLE || *alpha < OPAQUE {
                    return None;
                }
                for c in 0..3 {
                    seen[c] += drawn[c];
                    truth[c] += f32::from(filmed[c]) / 255.0;
                }
            }
        }
        let mean = |sum: [f32; 3]| sum.map(|v| v / (side * side) as f32);
        Some(Block {
            seen: mean(seen),
            truth: mean(truth),
        })
    };
    corners.filter_map(block).collect()
}

/// Gain and offset of the robust line through `pairs` of values, held near 1 and 0 by what is expected of them.
fn line(pairs: &[[f64; 2]], config: &ExposureConfig) -> [f64; 2] {
    let precision = |error: f64| error.powi(-2);
    let (gains, offsets, each) = (
        precision(config.gain),
        precision(config.offset),
        precision(config.noise),
    );
    let [mut gain, mut offset] = [1.0, 0.0];
    for _ in 0..ROUNDS {
        // Normal equations of the changes from 1 and 0.
        let (mut xx, mut x, mut one) = (gains, 0.0, offsets);
        let (mut xy, mut y) = (0.0, 0.0);
        for [seen, truth] in pairs {
            let off = (truth - gain * seen - offset) / ROBUST;
            let weight = each / (1.0 + off * off);
            xx += weight * seen * seen;
            x += weight * seen;
            one += weight;
            xy += weight * seen * (truth - seen);
            y += weight * (truth - seen);
        }
        let determinant = xx * one - x * x;
        gain = 1.0 + (xy * one - y * x) / determinant;
        offset = (y * xx - xy * x) / determinant;
    }
    [gain, offset]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A textured person of 32 x 32 pixels, and the frame that an exposure makes of it.
    fn pair(exposure: &FrameExposure) -> (Vec<f32>, FrameImage) {
        let mut image = FrameImage::empty(32, 32);
        let mut picture = vec![0f32; 4 * 32 * 32];
        for pixel in 0..32 * 32 {
            let (x, y) = (pixel % 32, pixel / 32);
            if !(4..28).contains(&x) {
                continue;
            }
            image.mask[pixel] = 255;
            picture[4 * pixel + 3] = 1.0;
            for c in 0..3 {
                let value = 0.1 + 0.5 * ((x * (c + 1) + 3 * y) % 17) as f32 / 17.0;
                picture[4 * pixel + c] = value;
                let shown = exposure.gain[c] * value + exposure.offset[c];
                image.rgb[3 * pixel + c] = (255.0 * shown).round() as u8;
            }
        }
        (picture, image)
    }

    fn config() -> ExposureConfig {
        // Without noise, what is expected hardly matters.
        ExposureConfig {
            noise: 1e-3,
            ..ExposureConfig::default()
        }
    }

    #[test]
    fn a_known_exposure_is_found_through_wrong_pixels() {
        let truth = FrameExposure {
            gain: [1.2, 0.8, 1.05],
            offset: [-0.02, 0.01, 0.03],
        };
        let (picture, mut image) = pair(&truth);
        // Something stands in front of a tenth of the person.
        for pixel in 0..3 * 32 {
            image.rgb[3 * pixel..3 * pixel + 3].fill(240);
        }
        let found = exposure(&picture, &image, &config()).expect("enough blocks");
        for c in 0..3 {
            assert!((found.gain[c] - truth.gain[c]).abs() < 0.03, "{found:?}");
            assert!(
                (found.offset[c] - truth.offset[c]).abs() < 0.01,
                "{found:?}"
            );
        }
    }

    #[test]
    fn nothing_is_said_of_a_frame_without_the_person() {
        let (picture, mut image) = pair(&FrameExposure::NEUTRAL);
        image.mask.fill(0);
        assert_eq!(exposure(&picture, &image, &config()), None);
    }
}
