//! PSNR and SSIM on `[height, width, 3]` images with values in 0..1.
//!
//! A person covers a tenth of a frame, so a whole-image figure flatters: PSNR also comes
//! over the mask's bounding box.

/// A rectangle of pixels: first column and row, and one past the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MaskBox {
    /// First column.
    pub x0: usize,
    /// First row.
    pub y0: usize,
    /// One past the last column.
    pub x1: usize,
    /// One past the last row.
    pub y1: usize,
}

/// Side of the Gaussian window of SSIM, pixels.
const WINDOW: usize = 11;
/// Its standard deviation, pixels.
const SIGMA: f64 = 1.5;
/// The published constants, squared, for a data range of 1.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Peak signal-to-noise ratio of two images of the same size, dB, data range 1. Identical
/// images have an infinite one.
///
/// # Panics
/// When the images differ in length.
pub fn psnr(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len(), "images of different sizes");
    from_squares(a.iter().zip(b))
}

/// [`psnr`] over the pixels of `region` alone; `width` is that of the whole images.
///
/// # Panics
/// When the images differ in length or the region leaves them.
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

/// The bounding box of the pixels with any coverage; none where there is none.
///
/// # Panics
/// When the mask has fewer than `width * height` pixels.
pub fn mask_box(mask: &[u8], width: usize, height: usize) -> Option<MaskBox> {
    let mut found: Option<MaskBox> = None;
    for row in 0..height {
        let line = &mask[row * width..(row + 1) * width];
        let Some(first) = line.iter().position(|&m| m > 0) else {
            continue;
        };
        let last = line.iter().rposition(|&m| m > 0).unwrap_or(first);
        let so_far = found.get_or_insert(MaskBox {
            x0: first,
            y0: row,
            x1: last + 1,
            y1: row + 1,
        });
        so_far.x0 = so_far.x0.min(first);
        so_far.x1 = so_far.x1.max(last + 1);
        so_far.y1 = row + 1;
    }
    found
}

/// Structural similarity of two images, mean over pixels and channels: Gaussian window
/// 11x11 with standard deviation 1.5, only where it lies wholly inside the image, K1 0.01,
/// K2 0.03, data range 1, biased (population) variances.
///
/// Images smaller than the window have no such place: the result is NaN.
///
/// # Panics
/// When an image has not `width * height * 3` values.
pub fn ssim(a: &[f32], b: &[f32], width: usize, height: usize) -> f64 {
    assert_eq!(a.len(), width * height * 3, "not the size of the image");
    assert_eq!(b.len(), width * height * 3, "not the size of the image");
    if width < WINDOW || height < WINDOW {
        return f64::NAN;
    }
    let window = window();
    let mut sum = 0.0;
    let mut count = 0usize;
    for channel in 0..3 {
        let plane = |image: &[f32]| -> Vec<f64> {
            image[channel..]
                .iter()
                .step_by(3)
                .map(|&v| f64::from(v))
                .collect()
        };
        let (a, b) = (plane(a), plane(b));
        let blurred = |f: fn(f64, f64) -> f64| {
            let product: Vec<f64> = a.iter().zip(&b).map(|(&a, &b)| f(a, b)).collect();
            blur(&product, width, height, &window)
        };
        let mean_a = blurred(|a, _| a);
        let mean_b = blurred(|_, b| b);
        let square_a = blurred(|a, _| a * a);
        let square_b = blurred(|_, b| b * b);
        let product = blurred(|a, b| a * b);
        for i in 0..mean_a.len() {
            let (ma, mb) = (mean_a[i], mean_b[i]);
            let variances = square_a[i] - ma * ma + square_b[i] - mb * mb;
            let covariance = product[i] - ma * mb;
            sum += (2.0 * ma * mb + C1) * (2.0 * covariance + C2)
                / ((ma * ma + mb * mb + C1) * (variances + C2));
        }
        count += mean_a.len();
    }
    sum / count as f64
}

fn window() -> [f64; WINDOW] {
    let middle = (WINDOW / 2) as f64;
    let weights: [f64; WINDOW] =
        std::array::from_fn(|i| (-(i as f64 - middle).powi(2) / (2.0 * SIGMA * SIGMA)).exp());
    let total: f64 = weights.iter().sum();
    weights.map(|w| w / total)
}

/// Separable filter over the valid region: `[height - 10, width - 10]`.
fn blur(plane: &[f64], width: usize, height: usize, window: &[f64; WINDOW]) -> Vec<f64> {
    let columns = width - WINDOW + 1;
    let rows: Vec<f64> = plane
        .chunks_exact(width)
        .flat_map(|line| {
            line.windows(WINDOW)
                .map(|part| part.iter().zip(window).map(|(v, w)| v * w).sum())
        })
        .collect();
    let valid = (height - WINDOW + 1) * columns;
    (0..valid)
        .map(|at| {
            let down = rows[at..].iter().step_by(columns);
            down.zip(window).map(|(v, w)| v * w).sum()
        })
        .collect()
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
    fn the_box_holds_the_mask_and_nothing_else_counts() {
        let mut mask = vec![0u8; 5 * 4];
        mask[5 + 3] = 1;
        mask[2 * 5 + 1] = 200;
        let region = mask_box(&mask, 5, 4).expect("two pixels");
        assert_eq!(
            region,
            MaskBox {
                x0: 1,
                y0: 1,
                x1: 4,
                y1: 3
            }
        );
        assert_eq!(mask_box(&[0; 20], 5, 4), None);

        let a = vec![0.0f32; 5 * 4 * 3];
        let mut b = a.clone();
        b[0] = 1.0;
        assert_eq!(psnr_in_box(&a, &b, 5, &region), f64::INFINITY);
        b[(5 + 3) * 3] = 1.0;
        // One of 18 values off by 1.
        assert!((psnr_in_box(&a, &b, 5, &region) - 10.0 * 18f64.log10()).abs() < 1e-9);
    }

    #[test]
    fn ssim_of_flat_images_is_its_luminance_term() {
        let a = vec![0.2f32; 12 * 13 * 3];
        let b = vec![0.6f32; 12 * 13 * 3];
        assert!((ssim(&a, &a, 12, 13) - 1.0).abs() < 1e-12);
        let expected = (2.0 * 0.2 * 0.6 + 1e-4) / (0.04 + 0.36 + 1e-4);
        assert!((ssim(&a, &b, 12, 13) - expected).abs() < 1e-6);
        assert!(ssim(&a[..10 * 10 * 3], &a[..10 * 10 * 3], 10, 10).is_nan());
    }

    #[test]
    fn ssim_of_one_window_matches_the_sums_written_out() {
        let at = |i: usize, seed: usize| ((i * 37 + seed * 101) % 97) as f32 / 97.0;
        let a: Vec<f32> = (0..WINDOW * WINDOW * 3).map(|i| at(i, 0)).collect();
        let b: Vec<f32> = (0..WINDOW * WINDOW * 3).map(|i| at(i, 3)).collect();
        let g = |i: usize, j: usize| {
            let d = (i as f64 - 5.0).powi(2) + (j as f64 - 5.0).powi(2);
            (-d / 4.5).exp()
        };
        let total: f64 = (0..121).map(|n| g(n / 11, n % 11)).sum();
        let mut expected = 0.0;
        for channel in 0..3 {
            let value = |image: &[f32], n: usize| f64::from(image[n * 3 + channel]);
            let mean = |f: &dyn Fn(usize) -> f64| -> f64 {
                (0..121).map(|n| g(n / 11, n % 11) / total * f(n)).sum()
            };
            let (ma, mb) = (mean(&|n| value(&a, n)), mean(&|n| value(&b, n)));
            let va = mean(&|n| (value(&a, n) - ma).powi(2));
            let vb = mean(&|n| (value(&b, n) - mb).powi(2));
            let cov = mean(&|n| (value(&a, n) - ma) * (value(&b, n) - mb));
            expected += (2.0 * ma * mb + C1) * (2.0 * cov + C2)
                / ((ma * ma + mb * mb + C1) * (va + vb + C2))
                / 3.0;
        }
        assert!((ssim(&a, &b, 11, 11) - expected).abs() < 1e-12);
    }
}
