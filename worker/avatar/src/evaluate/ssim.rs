//! Structural similarity, with the windows that published figures use.
//!
//! Figures with different windows or data ranges can't be compared, and papers rarely state
//! theirs, so there is one function for each:
//!
//! | function | window | variances | data range |
//! |---|---|---|---|
//! | [`ssim`] | Gaussian 11x11, σ 1.5 (Wang et al. 2004) | of the population | 1 |
//! | [`ssim_uniform`] | uniform 7x7 (scikit-image's default) | of the sample, N/(N−1) | 1 |
//! | [`ssim_inflated`] | uniform 7x7 | of the sample, N/(N−1) | 2 |
//!
//! The last one is the result of scikit-image up to 0.19 for floats in [0, 1] without a
//! `data_range`: it assumes the interval of the data type, −1 to 1, so its constants are four
//! times too large and every figure is too high. Since 0.20 such a call is an error. HumanNeRF's
//! released program does not measure SSIM.
//!
//! Windows must lie entirely inside the image, and channels have equal weights.

/// K1 and K2 of the definition.
const K: (f64, f64) = (0.01, 0.03);
/// Side and standard deviation of the Gaussian window, pixels.
const GAUSSIAN: (usize, f64) = (11, 1.5);
/// Side of the uniform window, pixels.
const UNIFORM: usize = 7;
/// The data range that scikit-image up to 0.19 assumes for floats.
const INFLATED_RANGE: f64 = 2.0;

/// One axis of a separable window, with the normalisation of variances and the data range.
struct Window {
    weights: Vec<f64>,
    /// Factor on population variances.
    norm: f64,
    range: f64,
}

impl Window {
    fn gaussian() -> Self {
        let (side, sigma) = GAUSSIAN;
        let middle = (side / 2) as f64;
        let bell = |i: usize| (-(i as f64 - middle).powi(2) / (2.0 * sigma * sigma)).exp();
        let total: f64 = (0..side).map(bell).sum();
        Self {
            weights: (0..side).map(|i| bell(i) / total).collect(),
            norm: 1.0,
            range: 1.0,
        }
    }

    fn uniform(range: f64) -> Self {
        let pixels = (UNIFORM * UNIFORM) as f64;
        Self {
            weights: vec![1.0 / UNIFORM as f64; UNIFORM],
            norm: pixels / (pixels - 1.0),
            range,
        }
    }
}

/// SSIM with the Gaussian 11x11 window, data range 1, of two `[height, width, 3]` images; `None`
/// if they are smaller than the window.
///
/// # Panics
/// If an image does not have `width * height * 3` values.
pub fn ssim(a: &[f32], b: &[f32], width: usize, height: usize) -> Option<f64> {
    mean_ssim(a, b, width, height, &Window::gaussian())
}

/// SSIM with the defaults of scikit-image, uniform 7x7 window and sample variances, data range 1;
/// `None` if the images are smaller than the window.
///
/// # Panics
/// As [`ssim`].
pub fn ssim_uniform(a: &[f32], b: &[f32], width: usize, height: usize) -> Option<f64> {
    mean_ssim(a, b, width, height, &Window::uniform(1.0))
}

/// [`ssim_uniform`] with the data range that scikit-image up to 0.19 assumes: too high, for
/// comparison with figures that were published so.
///
/// # Panics
/// As [`ssim`].
pub fn ssim_inflated(a: &[f32], b: &[f32], width: usize, height: usize) -> Option<f64> {
    mean_ssim(a, b, width, height, &Window::uniform(INFLATED_RANGE))
}

fn mean_ssim(a: &[f32], b: &[f32], width: usize, height: usize, window: &Window) -> Option<f64> {
    assert_eq!(a.len(), width * height * 3, "not the size of the image");
    assert_eq!(b.len(), width * height * 3, "not the size of the image");
    let side = window.weights.len();
    if width < side || height < side {
        return None;
    }
    let (c1, c2) = ((K.0 * window.range).powi(2), (K.1 * window.range).powi(2));
    let mut sum = 0.0;
    let mut count = 0usize;
    for channel in 0..3 {
        let plane = |image: &[f32]| -> Vec<f64> {
            let values = image[channel..].iter().step_by(3);
            values.map(|&v| f64::from(v)).collect()
        };
        let (a, b) = (plane(a), plane(b));
        let blurred = |f: fn(f64, f64) -> f64| {
            let product: Vec<f64> = a.iter().zip(&b).map(|(&a, &b)| f(a, b)).collect();
            blur(&product, width, height, &window.weights)
        };
        let mean_a = blurred(|a, _| a);
        let mean_b = blurred(|_, b| b);
        let square_a = blurred(|a, _| a * a);
        let square_b = blurred(|_, b| b * b);
        let product = blurred(|a, b| a * b);
        for i in 0..mean_a.len() {
            let (ma, mb) = (mean_a[i], mean_b[i]);
            let variances = window.norm * (square_a[i] - ma * ma + square_b[i] - mb * mb);
            let covariance = window.norm * (product[i] - ma * mb);
            sum += (2.0 * ma * mb + c1) * (2.0 * covariance + c2)
                / ((ma * ma + mb * mb + c1) * (variances + c2));
        }
        count += mean_a.len();
    }
    Some(sum / count as f64)
}

/// Separable filter at all positions at which the whole window is inside the plane.
fn blur(plane: &[f64], width: usize, height: usize, weights: &[f64]) -> Vec<f64> {
    let side = weights.len();
    let columns = width - side + 1;
    let rows: Vec<f64> = plane
        .chunks_exact(width)
        .flat_map(|line| {
            line.windows(side)
                .map(|part| part.iter().zip(weights).map(|(v, w)| v * w).sum())
        })
        .collect();
    let valid = (height - side + 1) * columns;
    (0..valid)
        .map(|at| {
            let down = rows[at..].iter().step_by(columns);
            down.zip(weights).map(|(v, w)| v * w).sum()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 19;
    const HEIGHT: usize = 14;

    /// The pictures of `tests/reference/image_metrics.py`.
    fn picture(seed: usize) -> Vec<f32> {
        let value = |i: usize| ((i * 37 + seed * 101) % 97) as f32 / 97.0;
        (0..WIDTH * HEIGHT * 3).map(value).collect()
    }

    fn near(a: &[f32], b: &[f32]) -> Vec<f32> {
        a.iter()
            .zip(b)
            .map(|(a, b)| a * 0.875 + b * 0.125)
            .collect()
    }

    #[test]
    fn every_window_matches_scikit_image() {
        let (truth, other) = (picture(0), picture(3));
        let near = near(&truth, &other);
        type Ssim = fn(&[f32], &[f32], usize, usize) -> Option<f64>;
        let cases: [(Ssim, &[f32], f64); 6] = [
            (ssim, &other, 0.351_320_281_709_631),
            (ssim_uniform, &other, 0.355_463_561_636_844),
            (ssim_inflated, &other, 0.365_489_663_323_624),
            (ssim, &near, 0.989_075_509_157_474),
            (ssim_uniform, &near, 0.989_151_978_263_305),
            (ssim_inflated, &near, 0.989_333_487_113_845),
        ];
        for (measure, render, expected) in cases {
            let found = measure(&truth, render, WIDTH, HEIGHT).expect("large enough");
            assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
        }
    }

    #[test]
    fn flat_images_have_their_luminance_term() {
        let a = vec![0.2f32; 12 * 13 * 3];
        let b = vec![0.6f32; 12 * 13 * 3];
        for (measure, c1) in [
            (
                ssim as fn(&[f32], &[f32], usize, usize) -> Option<f64>,
                1e-4,
            ),
            (ssim_uniform, 1e-4),
            (ssim_inflated, 4e-4),
        ] {
            let measure = |b| measure(&a, b, 12, 13).expect("large enough");
            assert!((measure(&a) - 1.0).abs() < 1e-12);
            let expected = (2.0 * 0.2 * 0.6 + c1) / (0.04 + 0.36 + c1);
            assert!((measure(&b) - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn an_image_smaller_than_the_window_has_no_similarity() {
        let small = vec![0.5f32; 10 * 10 * 3];
        assert_eq!(ssim(&small, &small, 10, 10), None);
        assert_eq!(ssim_uniform(&small, &small, 10, 10), Some(1.0));
        assert_eq!(
            ssim_uniform(&small[..6 * 6 * 3], &small[..6 * 6 * 3], 6, 6),
            None
        );
    }
}
