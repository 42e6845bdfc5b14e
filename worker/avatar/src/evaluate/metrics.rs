//! PSNR of `[height, width, 3]` images with values in [0, 1].
//!
//! A person covers only a small part of a frame, so the PSNR of a whole image is high even for a
//! poor render. PSNR is therefore also measured inside the mask's bounding box.

use yoto_capture::MaskBox;

/// Peak signal-to-noise ratio of two images of the same size, dB, data range 1. Identical
/// images have an infinite one.
///
/// # Panics
/// If the images differ in length.
pub fn psnr(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len(), "images of different sizes");
    from_squares(a.iter().zip(b))
}

/// [`psnr`] of the pixels in `region`; `width` is that of the whole images.
///
/// # Panics
/// If the images differ in length or the region exceeds them.
pub fn psnr_in_box(a: &[f32], b: &[f32], width: usize, region: &MaskBox) -> f64 {
    assert_eq!(a.len(), b.len(), "images of different sizes");
    from_squares((region.y0..region.y1).flat_map(|row| {
        let pixels = (row * width + region.x0) * 3..(row * width + region.x1) * 3;
        a[pixels.clone()].iter().zip(&b[pixels])
    }))
}

fn from_squares<'a>(pairs: impl Iterator<Item = (&'a f32, &'a f32)>) -> f64 {
    let (sum, count) = pairs.fold((0.0, 0u64), |(sum, count), (a, b)| {
        let difference = f64::from(*a) - f64::from(*b);
        (sum + difference * difference, count + 1)
    });
    if sum == 0.0 {
        f64::INFINITY
    } else {
        -10.0 * (sum / count as f64).log10()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn psnr_is_what_its_formula_says() {
        let a = vec![0.5f32; 12];
        assert_eq!(psnr(&a, &a), f64::INFINITY);
        let b: Vec<f32> = a.iter().map(|v| v + 0.25).collect();
        // MSE 1/16.
        assert!((psnr(&a, &b) - 12.041_199_826_559_248).abs() < 1e-9);
    }

    #[test]
    fn psnr_matches_scikit_image() {
        // The pictures of `tests/reference/image_metrics.py`.
        let picture = |seed: usize| -> Vec<f32> {
            let value = |i: usize| ((i * 37 + seed * 101) % 97) as f32 / 97.0;
            (0..19 * 14 * 3).map(value).collect()
        };
        let (truth, other) = (picture(0), picture(3));
        let near: Vec<f32> = truth
            .iter()
            .zip(&other)
            .map(|(a, b)| a * 0.875 + b * 0.125)
            .collect();
        assert!((psnr(&truth, &other) - 9.676_783_729_967_186).abs() < 1e-9);
        assert!((psnr(&truth, &near) - 27.738_582_560_443_326).abs() < 1e-9);
    }

    #[test]
    fn outside_of_the_box_nothing_counts() {
        let region = MaskBox {
            x0: 1,
            y0: 1,
            x1: 4,
            y1: 3,
        };
        let a = vec![0.0f32; 5 * 4 * 3];
        let mut b = a.clone();
        b[0] = 1.0;
        assert_eq!(psnr_in_box(&a, &b, 5, &region), f64::INFINITY);
        b[(5 + 3) * 3] = 1.0;
        // One of 18 values off by 1.
        assert!((psnr_in_box(&a, &b, 5, &region) - 10.0 * 18f64.log10()).abs() < 1e-9);
    }
}
