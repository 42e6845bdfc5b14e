//! Scores of one picture, and their means over pictures and people.

use super::{EvaluateError, psnr, psnr_in_box, ssim, ssim_inflated, ssim_uniform};
use serde::{Deserialize, Serialize};
use yoto_capture::{FrameImage, mask_box};
use yoto_proto::v1::Scores;

/// PSNR of two equal pictures in a mean, dB. Their actual PSNR is infinite, and so would be every
/// mean with it.
pub(crate) const EQUAL: f64 = 100.0;
/// Scores of one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureScore {
    /// PSNR of the whole picture, dB.
    pub psnr: f64,
    /// PSNR inside the bounding box of the truth's mask, dB; `None` if the mask is empty.
    pub psnr_mask_box: Option<f64>,
    /// SSIM with Gaussian window, data range 1.
    pub ssim: f64,
    /// SSIM with uniform window, data range 1.
    pub ssim_uniform: f64,
    /// SSIM with uniform window, data range 2: too high.
    pub ssim_inflated: f64,
    /// LPIPS with VGG, lower is better; `None` without weights.
    pub lpips: Option<f64>,
    /// PSNR of an all-black picture, dB, as a baseline.
    pub black_psnr: f64,
}

/// Means over pictures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// PSNR of the whole picture, dB.
    pub psnr: f64,
    /// PSNR inside the bounding box of the person's mask, dB; a mean over the pictures that have
    /// one, 0 if none has.
    pub psnr_mask_box: f64,
    /// SSIM with Gaussian 11x11 window, data range 1.
    pub ssim: f64,
    /// SSIM with scikit-image's uniform 7x7 window, data range 1.
    pub ssim_uniform: f64,
    /// SSIM with uniform window, data range 2, as in some published tables: too high.
    pub ssim_inflated: f64,
    /// LPIPS with VGG, lower is better; absent if it was not measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lpips: Option<f64>,
    /// PSNR of an all-black picture, dB.
    pub black_psnr: f64,
    /// Number of pictures.
    pub pictures: usize,
}

/// Compares a picture with its `render` of `size` (width, height), 8-bit colours row by row.
///
/// # Errors
/// If the sizes differ or are too small for SSIM.
pub fn compare(
    truth: &FrameImage,
    render: &[u8],
    size: (usize, usize),
) -> Result<PictureScore, EvaluateError> {
    let (width, height) = (truth.width, truth.height);
    if (width, height) != size || render.len() != truth.rgb.len() {
        return Err(EvaluateError::Size {
            expected: (width, height),
            found: size,
        });
    }
    let (real, seen) = (unit(&truth.rgb), unit(render));
    let black = vec![0.0; real.len()];
    let similarity = |measure: fn(&[f32], &[f32], usize, usize) -> Option<f64>| {
        measure(&real, &seen, width, height).ok_or(EvaluateError::TooSmall(width, height))
    };
    Ok(PictureScore {
        psnr: psnr(&real, &seen).min(EQUAL),
        psnr_mask_box: mask_box(&truth.mask, width, height)
            .map(|region| psnr_in_box(&real, &seen, width, &region).min(EQUAL)),
        ssim: similarity(ssim)?,
        ssim_uniform: similarity(ssim_uniform)?,
        ssim_inflated: similarity(ssim_inflated)?,
        lpips: None,
        black_psnr: psnr(&real, &black).min(EQUAL),
    })
}

/// 8-bit values as floats in [0, 1].
pub(crate) fn unit(bytes: &[u8]) -> Vec<f32> {
    bytes
        .iter()
        .map(|&value| f32::from(value) / 255.0)
        .collect()
}

/// A running mean over pictures.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mean {
    sum: Sums,
    boxes: usize,
    lpips: usize,
    pictures: usize,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    psnr: f64,
    psnr_mask_box: f64,
    ssim: f64,
    ssim_uniform: f64,
    ssim_inflated: f64,
    lpips: f64,
    black_psnr: f64,
}

impl Mean {
    /// Adds a picture.
    pub fn add(&mut self, score: &PictureScore) {
        let sum = &mut self.sum;
        sum.psnr += score.psnr;
        sum.ssim += score.ssim;
        sum.ssim_uniform += score.ssim_uniform;
        sum.ssim_inflated += score.ssim_inflated;
        sum.black_psnr += score.black_psnr;
        self.pictures += 1;
        if let Some(psnr) = score.psnr_mask_box {
            sum.psnr_mask_box += psnr;
            self.boxes += 1;
        }
        if let Some(lpips) = score.lpips {
            sum.lpips += lpips;
            self.lpips += 1;
        }
    }

    /// The mean; all zero if no picture was added. It has LPIPS only if every picture has.
    pub fn score(&self) -> Score {
        let count = self.pictures.max(1) as f64;
        let all_have_lpips = self.pictures > 0 && self.lpips == self.pictures;
        Score {
            psnr: self.sum.psnr / count,
            psnr_mask_box: self.sum.psnr_mask_box / self.boxes.max(1) as f64,
            ssim: self.sum.ssim / count,
            ssim_uniform: self.sum.ssim_uniform / count,
            ssim_inflated: self.sum.ssim_inflated / count,
            lpips: all_have_lpips.then(|| self.sum.lpips / count),
            black_psnr: self.sum.black_psnr / count,
            pictures: self.pictures,
        }
    }
}

impl Score {
    /// The mean of people's scores with equal weights, whatever their numbers of pictures. People
    /// without pictures don't count; all zero if nobody has any.
    pub fn mean(scores: &[Self]) -> Self {
        let scores: Vec<&Self> = scores.iter().filter(|it| it.pictures > 0).collect();
        let count = scores.len().max(1) as f64;
        let over = |value: fn(&Self) -> f64| scores.iter().map(|it| value(it)).sum::<f64>() / count;
        let lpips: Option<Vec<f64>> = scores.iter().map(|score| score.lpips).collect();
        Self {
            psnr: over(|score| score.psnr),
            psnr_mask_box: over(|score| score.psnr_mask_box),
            ssim: over(|score| score.ssim),
            ssim_uniform: over(|score| score.ssim_uniform),
            ssim_inflated: over(|score| score.ssim_inflated),
            lpips: lpips
                .filter(|values| !values.is_empty())
                .map(|values| values.iter().sum::<f64>() / count),
            black_psnr: over(|score| score.black_psnr),
            pictures: scores.iter().map(|score| score.pictures).sum(),
        }
    }
}

impl From<&Score> for Scores {
    fn from(score: &Score) -> Self {
        Self {
            // Too many pictures to ever be measured.
            pictures: u32::try_from(score.pictures).unwrap_or(u32::MAX),
            psnr: score.psnr,
            psnr_mask_box: score.psnr_mask_box,
            ssim: score.ssim,
            ssim_uniform: score.ssim_uniform,
            ssim_inflated: score.ssim_inflated,
            lpips: score.lpips,
            black_psnr: score.black_psnr,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(level: u8) -> FrameImage {
        let mut image = FrameImage::empty(16, 16);
        image.rgb.fill(level);
        image.mask[5 * 16 + 5] = 255;
        image
    }

    #[test]
    fn an_error_of_a_tenth_is_20_db() {
        let score = compare(&flat(153), &flat(153 + 26).rgb, (16, 16)).expect("same sizes");
        let expected = 20.0 * (255.0f64 / 26.0).log10();
        let black = 20.0 * (255.0f64 / 153.0).log10();
        assert!((score.psnr - expected).abs() < 1e-3, "{score:?}");
        let in_box = score.psnr_mask_box.expect("a box");
        assert!((in_box - expected).abs() < 1e-3, "{score:?}");
        assert!((score.black_psnr - black).abs() < 1e-3, "{score:?}");
        assert!(score.ssim_inflated > score.ssim_uniform && score.lpips.is_none());
    }

    #[test]
    fn equal_pictures_stay_finite() {
        let score = compare(&flat(7), &flat(7).rgb, (16, 16)).expect("same sizes");
        assert_eq!((score.psnr, score.ssim), (100.0, 1.0));
    }

    #[test]
    fn sizes_that_can_not_be_compared_are_refused() {
        let render = FrameImage::empty(8, 32).rgb;
        let error = compare(&flat(1), &render, (8, 32)).expect_err("another shape");
        assert!(error.to_string().contains("(8, 32)"), "{error}");
        let small = FrameImage::empty(40, 10);
        let error = compare(&small, &small.rgb, (40, 10)).expect_err("no window fits");
        assert!(error.to_string().contains("40x10"), "{error}");
    }

    #[test]
    fn means_leave_out_what_was_not_measured() {
        let one = PictureScore {
            psnr: 20.0,
            psnr_mask_box: Some(15.0),
            ssim: 1.0,
            ssim_uniform: 0.9,
            ssim_inflated: 0.95,
            lpips: Some(0.1),
            black_psnr: 10.0,
        };
        let other = PictureScore {
            psnr: 30.0,
            psnr_mask_box: None,
            ssim: 0.5,
            lpips: None,
            ..one
        };
        let mut mean = Mean::default();
        mean.add(&one);
        assert_eq!(mean.score().lpips, Some(0.1));
        mean.add(&other);
        let score = mean.score();
        assert_eq!(
            (score.psnr, score.psnr_mask_box, score.ssim),
            (25.0, 15.0, 0.75)
        );
        assert_eq!((score.lpips, score.pictures), (None, 2));

        let people = [
            Score {
                lpips: Some(0.3),
                psnr: 31.0,
                ..score
            },
            score,
        ];
        let mean = Score::mean(&people);
        assert_eq!((mean.psnr, mean.lpips, mean.pictures), (28.0, None, 4));
        assert_eq!(Score::mean(&people[..1]).lpips, Some(0.3));
    }
}
