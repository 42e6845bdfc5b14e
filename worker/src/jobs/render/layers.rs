//! Pictures of depth and opacity, in grey.

use std::ops::Range;
use yoto_avatar::render::Rendered;
use yoto_film::Layer;

/// Least opacity of a pixel that has a depth: half of the light comes from the person.
const SOLID: f32 = 0.5;

/// The picture of `layer` of `frame`: `[H, W, 3]`.
pub(super) fn rgb8(layer: &Layer, frame: &Rendered) -> Vec<u8> {
    let grey = |values: &mut dyn Iterator<Item = u8>| values.flat_map(|v| [v; 3]).collect();
    match layer {
        Layer::Colours => frame.to_rgb8(),
        Layer::Opacity => {
            let byte = |alpha: &f32| (alpha.clamp(0.0, 1.0) * 255.0).round() as u8;
            grey(&mut frame.alpha.iter().map(byte))
        }
        Layer::Depth(range) => {
            let pixels = frame.depth.iter().zip(&frame.alpha);
            grey(&mut pixels.map(|(depth, alpha)| match *alpha >= SOLID {
                true => brightness(f64::from(depth / alpha), range),
                false => 0,
            }))
        }
    }
}

/// 255 for the nearest depth, 1 for the farthest one.
fn brightness(depth: f64, range: &Range<f64>) -> u8 {
    let share = (range.end - depth) / (range.end - range.start);
    (1.0 + 254.0 * share.clamp(0.0, 1.0)).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_avatar::render::SceneView;
    use yoto_synthetic::SyntheticPerson;

    #[test]
    fn near_is_bright_far_is_dark_and_nobody_is_black() {
        let view = SceneView {
            actors: Vec::new(),
            camera: SyntheticPerson::train_camera(2).resized(2, 2),
            background: [0.0; 3],
        };
        let frame = Rendered {
            // Half-opaque pixels have half of their depth in the sum.
            depth: vec![2.0, 1.0, 4.0, 0.3],
            alpha: vec![1.0, 0.5, 1.0, 0.1],
            ..Rendered::empty(&view)
        };
        let first = |rgb: Vec<u8>| -> Vec<u8> { rgb.iter().step_by(3).copied().collect() };
        let depth = Layer::Depth(2.0..4.0);
        assert_eq!(first(rgb8(&depth, &frame)), [255, 255, 1, 0]);
        assert_eq!(depth.range(), Some([2.0, 4.0]));
        assert_eq!(first(rgb8(&Layer::Opacity, &frame)), [255, 128, 255, 26]);
        assert_eq!(rgb8(&depth, &frame).len(), 12);
        assert_eq!(brightness(3.0, &(2.0..4.0)), 128);
        assert_eq!(brightness(9.0, &(2.0..4.0)), 1);
    }
}
