//! The sharpness of a person in a picture.

use image::{GrayImage, RgbImage};

/// A frame's sharpness is compared with this number of frames on either side: in a walk, they show the same
/// clothes from the same side.
const AROUND: usize = 7;
/// Coverage of a pixel inside the person.
const INSIDE: u8 = 128;

/// The variance of the Laplacian of the luminance over the pixels that lie inside the person with
/// their four neighbours, so that the person's outline doesn't count. 0 without such pixels.
pub(super) fn of(picture: &RgbImage, mask: &GrayImage) -> f64 {
    let (width, height) = picture.dimensions();
    if mask.dimensions() != (width, height) {
        return 0.0;
    }
    // In thousandths, as integers: a plain colour has a Laplacian of exactly 0.
    let luminance = |x: u32, y: u32| {
        let [r, g, b] = picture.get_pixel(x, y).0.map(i32::from);
        299 * r + 587 * g + 114 * b
    };
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for y in 1..height.saturating_sub(1) {
        for x in 1..width.saturating_sub(1) {
            let cross = [(x, y), (x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)];
            if cross
                .iter()
                .any(|&(x, y)| mask.get_pixel(x, y).0[0] < INSIDE)
            {
                continue;
            }
            let all: i32 = cross.iter().map(|&(x, y)| luminance(x, y)).sum();
            let laplacian = f64::from(all - 5 * luminance(x, y)) / 1e3;
            count += 1.0;
            sum += laplacian;
            squares += laplacian * laplacian;
        }
    }
    if count == 0.0 {
        return 0.0;
    }
    let mean: f64 = sum / count;
    (squares / count - mean * mean).max(0.0)
}

/// Each frame's part of the median sharpness of the frames around it, at most 1: clothes and
/// distance change what is sharp over a clip, blur changes it from one frame to the next. 0 where
/// no person is seen.
pub(super) fn among_neighbours(sharp: &[f64]) -> Vec<f64> {
    let part = |(at, own): (usize, &f64)| {
        let from = at.saturating_sub(AROUND);
        let to = (at + AROUND + 1).min(sharp.len());
        let mut around = sharp.get(from..to).unwrap_or_default().to_vec();
        around.sort_by(f64::total_cmp);
        let median = around.get(around.len() / 2).copied().unwrap_or_default();
        if *own > 0.0 {
            (own / median).min(1.0)
        } else {
            0.0
        }
    };
    sharp.iter().enumerate().map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stripes(period: u32) -> RgbImage {
        RgbImage::from_fn(16, 16, |x, _| {
            image::Rgb(
                [if (x / period).is_multiple_of(2) {
                    200
                } else {
                    40
                }; 3],
            )
        })
    }

    #[test]
    fn detail_inside_the_mask_counts_and_nothing_else() {
        let all = GrayImage::from_pixel(16, 16, image::Luma([255]));
        assert!(of(&stripes(1), &all) > of(&stripes(4), &all));
        assert!(of(&stripes(4), &all) > 0.0);
        assert_eq!(of(&stripes(16), &all), 0.0);
        assert_eq!(of(&stripes(1), &GrayImage::new(16, 16)), 0.0, "nobody");
        assert_eq!(of(&stripes(1), &GrayImage::new(8, 16)), 0.0);
        // A plain person before a wild background: the outline is no detail.
        let inside = |x: u32, y: u32| (4..12).contains(&x) && (4..12).contains(&y);
        let person = RgbImage::from_fn(16, 16, |x, y| {
            if inside(x, y) {
                image::Rgb([90; 3])
            } else {
                *stripes(1).get_pixel(x, y)
            }
        });
        let mask = GrayImage::from_fn(16, 16, |x, y| image::Luma([255 * u8::from(inside(x, y))]));
        assert_eq!(of(&person, &mask), 0.0);
    }

    #[test]
    fn frames_are_compared_with_those_around_them() {
        // A plain side and a detailed one, each with a blurred frame.
        let mut sharp = vec![4.0; 40];
        sharp[20..].fill(400.0);
        (sharp[5], sharp[30], sharp[35]) = (1.0, 100.0, 0.0);
        let parts = among_neighbours(&sharp);
        assert_eq!((parts[5], parts[30], parts[35]), (0.25, 0.25, 0.0));
        assert_eq!(
            (parts[0], parts[15], parts[25], parts[39]),
            (1.0, 1.0, 1.0, 1.0)
        );
        assert_eq!(among_neighbours(&[0.0; 3]), [0.0; 3]);
    }
}
