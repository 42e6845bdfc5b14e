//! Enlargement of a frame rendered at a reduced size.

use super::{RenderError, Rendered};
use image::imageops::{FilterType, resize};
use image::{ImageBuffer, Luma, Pixel, Rgb};

/// `frame` at `width` by `height` pixels, enlarged by a cubic filter (Catmull-Rom), which rings
/// less far than the `image` crate's Lanczos filter.
pub(super) fn enlarge(
    frame: &Rendered,
    width: usize,
    height: usize,
) -> Result<Rendered, RenderError> {
    let from = (frame.width, frame.height);
    // The filter clamps to [0, 1], the range of colours and opacities but not of metres.
    let farthest = frame.depth.iter().fold(0.0f32, |far, &z| far.max(z));
    let unit = if farthest > 0.0 { farthest } else { 1.0 };
    let depth = frame.depth.iter().map(|z| z / unit).collect();
    let depth = resized::<Luma<f32>>(depth, from, (width, height))?;
    Ok(Rendered {
        width,
        height,
        counts: frame.counts,
        rgb: resized::<Rgb<f32>>(frame.rgb.clone(), from, (width, height))?,
        alpha: resized::<Luma<f32>>(frame.alpha.clone(), from, (width, height))?,
        depth: depth.into_iter().map(|z| z * unit).collect(),
    })
}

fn resized<P: Pixel<Subpixel = f32> + 'static>(
    values: Vec<f32>,
    from: (usize, usize),
    to: (usize, usize),
) -> Result<Vec<f32>, RenderError> {
    let side = |length: usize| {
        u32::try_from(length).map_err(|_| RenderError::Settings("the frame is too large".into()))
    };
    let image = ImageBuffer::<P, Vec<f32>>::from_raw(side(from.0)?, side(from.1)?, values)
        .ok_or_else(|| RenderError::Settings("the frame's data does not have its size".into()))?;
    Ok(resize(&image, side(to.0)?, side(to.1)?, FilterType::CatmullRom).into_raw())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::SampleCounts;

    #[test]
    fn colours_stay_and_metres_are_not_clamped() {
        let small = Rendered {
            width: 2,
            height: 3,
            rgb: [0.25, 0.5, 0.75].repeat(6),
            alpha: vec![1.0; 6],
            depth: vec![3.5; 6],
            counts: SampleCounts::default(),
        };
        let large = enlarge(&small, 4, 6).expect("enlarges");
        assert_eq!((large.width, large.height), (4, 6));
        assert_eq!((large.rgb.len(), large.alpha.len()), (72, 24));
        let near = |a: &f32, b: f32| (a - b).abs() < 1e-5;
        assert!(
            large.depth.iter().all(|z| near(z, 3.5)),
            "{:?}",
            large.depth
        );
        assert!(
            large
                .rgb
                .chunks(3)
                .all(|c| near(&c[0], 0.25) && near(&c[2], 0.75))
        );
    }

    #[test]
    fn an_empty_frame_stays_empty() {
        let small = Rendered {
            width: 1,
            height: 1,
            rgb: vec![0.0; 3],
            alpha: vec![0.0],
            depth: vec![0.0],
            counts: SampleCounts::default(),
        };
        let large = enlarge(&small, 3, 3).expect("enlarges");
        assert!(large.depth.iter().chain(&large.rgb).all(|v| *v == 0.0));
    }
}
