//! Frequency encodings γ of points.

use burn::tensor::Tensor;

/// sin and cos of `points` `[N, C]` times 2⁰ … 2^(bands−1) times `unit`, band by band:
/// sin of all coordinates, then cos → `[N, 2 C bands]`. Each band is multiplied by its entry
/// of `window`, where one is given.
pub fn frequencies(
    points: Tensor<2>,
    bands: usize,
    unit: f32,
    window: Option<&[f32]>,
) -> Tensor<2> {
    let mut parts = Vec::with_capacity(2 * bands);
    for band in 0..bands {
        let angle = points.clone() * ((1u64 << band.min(62)) as f32 * unit);
        let weight = window.map_or(1.0, |w| w.get(band).copied().unwrap_or(0.0));
        let scaled = |t: Tensor<2>| if weight == 1.0 { t } else { t * weight };
        parts.push(scaled(angle.clone().sin()));
        parts.push(scaled(angle.cos()));
    }
    Tensor::cat(parts, 1)
}

/// The Hann window over bands: w_k = (1 − cos(π clamp(a − k, 0, 1))) / 2 (model.md §5).
pub fn hann_window(bands: usize, a: f32) -> Vec<f32> {
    (0..bands)
        .map(|k| (1.0 - (std::f32::consts::PI * (a - k as f32).clamp(0.0, 1.0)).cos()) / 2.0)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_opens_band_by_band() {
        assert_eq!(hann_window(3, 0.0), [0.0, 0.0, 0.0]);
        let half = hann_window(3, 1.5);
        assert!(
            (half[0] - 1.0).abs() < 1e-6 && (half[1] - 0.5).abs() < 1e-6 && half[2] == 0.0,
            "{half:?}"
        );
        assert!(hann_window(3, 9.0).iter().all(|w| (w - 1.0).abs() < 1e-6));
    }
}
