//! How close a rendered picture is to the truth.

use super::Score;
use crate::pictures::PictureError;
use image::RgbImage;
use yoto_avatar::evaluate;

/// Figures of one picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureScore {
    /// Over the whole picture, dB.
    pub psnr: f64,
    /// Inside the box of the truth's mask, dB; `None` when nobody is in the picture.
    pub psnr_mask_box: Option<f64>,
    /// Over the whole picture.
    pub ssim: f64,
    /// PSNR of an all-black picture, dB.
    pub black_psnr: f64,
}

/// Compares 8-bit pictures; `mask` is the truth's coverage, one byte a pixel.
///
/// # Errors
/// When the sizes differ.
pub fn compare(
    what: &str,
    truth: &RgbImage,
    mask: &[u8],
    render: &RgbImage,
) -> Result<PictureScore, PictureError> {
    let (width, height) = (truth.width() as usize, truth.height() as usize);
    if truth.dimensions() != render.dimensions() || mask.len() != width * height {
        return Err(PictureError::Size {
            what: format!("the render or mask of {what}"),
            width,
            height,
            expected: 3 * width * height,
            found: render.as_raw().len(),
        });
    }
    let (truth, render) = (unit(truth), unit(render));
    let black = vec![0.0; truth.len()];
    Ok(PictureScore {
        psnr: evaluate::psnr(&truth, &render),
        psnr_mask_box: evaluate::mask_box(mask, width, height)
            .map(|mask_box| evaluate::psnr_in_box(&truth, &render, width, &mask_box)),
        ssim: evaluate::ssim(&truth, &render, width, height),
        black_psnr: evaluate::psnr(&truth, &black),
    })
}

fn unit(picture: &RgbImage) -> Vec<f32> {
    picture
        .as_raw()
        .iter()
        .map(|&value| f32::from(value) / 255.0)
        .collect()
}

/// A running mean over pictures.
#[derive(Debug, Clone, Copy, Default)]
pub struct Mean {
    psnr: f64,
    psnr_mask_box: f64,
    boxes: usize,
    ssim: f64,
    black_psnr: f64,
    pictures: usize,
}

impl Mean {
    /// Adds a picture.
    pub fn add(&mut self, score: &PictureScore) {
        self.psnr += score.psnr;
        self.ssim += score.ssim;
        self.black_psnr += score.black_psnr;
        self.pictures += 1;
        if let Some(psnr) = score.psnr_mask_box {
            self.psnr_mask_box += psnr;
            self.boxes += 1;
        }
    }

    /// The mean; all zero when no picture was added.
    pub fn score(&self) -> Score {
        let count = self.pictures.max(1) as f64;
        Score {
            psnr: self.psnr / count,
            psnr_mask_box: self.psnr_mask_box / self.boxes.max(1) as f64,
            ssim: self.ssim / count,
            black_psnr: self.black_psnr / count,
            pictures: self.pictures,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn an_error_of_a_tenth_is_20_db() {
        let truth = RgbImage::from_pixel(16, 16, Rgb([153; 3]));
        let mut render = truth.clone();
        for pixel in render.pixels_mut() {
            *pixel = Rgb([153 + 26; 3]);
        }
        let mut mask = vec![0; 256];
        mask[5 * 16 + 5] = 255;
        let score = compare("a", &truth, &mask, &render).expect("same sizes");
        let expected = 20.0 * (255.0f64 / 26.0).log10();
        assert!((score.psnr - expected).abs() < 1e-3, "{score:?}");
        assert!(
            (score.psnr_mask_box.expect("a box") - expected).abs() < 1e-3,
            "{score:?}"
        );
        assert!(
            (score.black_psnr - 20.0 * (255.0f64 / 153.0).log10()).abs() < 1e-3,
            "{score:?}"
        );
    }

    #[test]
    fn pictures_of_different_sizes_are_refused() {
        let truth = RgbImage::new(16, 16);
        let error = compare("ada", &truth, &[0; 256], &RgbImage::new(16, 15)).expect_err("differs");
        assert!(error.to_string().contains("ada"), "{error}");
    }

    #[test]
    fn the_mean_leaves_out_boxes_nobody_is_in() {
        let mut mean = Mean::default();
        let score = PictureScore {
            psnr: 20.0,
            psnr_mask_box: Some(15.0),
            ssim: 1.0,
            black_psnr: 10.0,
        };
        mean.add(&score);
        mean.add(&PictureScore {
            psnr: 30.0,
            psnr_mask_box: None,
            ssim: 0.5,
            black_psnr: 12.0,
        });
        let mean = mean.score();
        assert_eq!(
            (mean.psnr, mean.psnr_mask_box, mean.ssim, mean.black_psnr),
            (25.0, 15.0, 0.75, 11.0)
        );
        assert_eq!(mean.pictures, 2);
    }
}
