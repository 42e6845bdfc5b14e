//! The frequency window, which opens the bands of an encoding one after the other.

/// The Hann window over bands: w_k = (1 − cos(π clamp(a − k, 0, 1))) / 2
/// (HumanNeRF).
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
