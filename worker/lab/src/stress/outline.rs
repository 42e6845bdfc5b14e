//! How far a render leaves the outline of the truth.

use serde::{Deserialize, Serialize};
use yoto_capture::FrameImage;

/// Distance from the outline within which nothing counts: inside, where edges blur, and outside, metres.
const INSIDE: f64 = 0.01;
const OUTSIDE: f64 = 0.03;
/// Opacity from which a pixel is a surface.
const SURFACE: f32 = 0.5;
/// Coverage from which a pixel of the truth is the person.
const COVERED: u8 = 128;

/// How well the outline of a render is that of the truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Outline {
    /// Area of the intersection of both over that of their union.
    pub overlap: f64,
    /// Pixels more than 1 cm inside of the outline that are not covered, as a share of the person's area.
    pub holes: f64,
    /// Covered pixels more than 3 cm outside of it, as a share of that area.
    pub strays: f64,
}

impl Outline {
    /// Compares the opacity `alpha` `[H, W]` with the picture of the truth, in which a metre has `per_metre` pixels.
    pub(super) fn of(truth: &FrameImage, alpha: &[f32], per_metre: f64) -> Self {
        let (width, height) = (truth.width, truth.height);
        let person: Vec<bool> = truth.mask.iter().map(|mask| *mask >= COVERED).collect();
        let area = person.iter().filter(|inside| **inside).count().max(1) as f64;
        let disk = |radius: f64| -> Vec<[isize; 2]> {
            let reach = radius.floor() as isize;
            let all = (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| [x, y]));
            all.filter(|[x, y]| ((x * x + y * y) as f64) <= radius * radius)
                .collect()
        };
        let near = |pixel: usize, disk: &[[isize; 2]], is: bool| {
            let (x, y) = ((pixel % width) as isize, (pixel / width) as isize);
            disk.iter().any(|[dx, dy]| {
                let (x, y) = (x + dx, y + dy);
                let within = x >= 0 && y >= 0 && x < width as isize && y < height as isize;
                within && person[y as usize * width + x as usize] == is
            })
        };
        let [inner, outer] = [INSIDE, OUTSIDE].map(|metres| disk(metres * per_metre));
        let (mut holes, mut strays) = (0usize, 0usize);
        let (mut both, mut either) = (0usize, 0usize);
        for (pixel, alpha) in alpha.iter().enumerate() {
            let covered = *alpha >= SURFACE;
            both += usize::from(person[pixel] && covered);
            either += usize::from(person[pixel] || covered);
            match (person[pixel], covered) {
                (true, false) if !near(pixel, &inner, false) => holes += 1,
                (false, true) if !near(pixel, &outer, true) => strays += 1,
                _ => {}
            }
        }
        Self {
            overlap: both as f64 / either.max(1) as f64,
            holes: holes as f64 / area,
            strays: strays as f64 / area,
        }
    }

    /// The mean; 0 of none.
    pub(super) fn mean(all: &[Self]) -> Self {
        let mean = |of: fn(&Self) -> f64| all.iter().map(of).sum::<f64>() / all.len().max(1) as f64;
        Self {
            overlap: mean(|it| it.overlap),
            holes: mean(|it| it.holes),
            strays: mean(|it| it.strays),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_and_strays_are_counted_away_from_the_edge_alone() {
        const SIDE: usize = 40;
        // A square of 20 pixels in the middle, 100 pixels per metre.
        let inside = |pixel: usize| {
            let (x, y) = (pixel % SIDE, pixel / SIDE);
            (10..30).contains(&x) && (10..30).contains(&y)
        };
        let mut truth = FrameImage::empty(SIDE, SIDE);
        for pixel in 0..SIDE * SIDE {
            truth.mask[pixel] = if inside(pixel) { 255 } else { 0 };
        }
        let mut alpha: Vec<f32> = (0..SIDE * SIDE)
            .map(|pixel| if inside(pixel) { 1.0 } else { 0.0 })
            .collect();
        let same = Outline {
            overlap: 1.0,
            holes: 0.0,
            strays: 0.0,
        };
        assert_eq!(Outline::of(&truth, &alpha, 100.0), same);
        // A pixel of the edge, two beside it, and a hole and a stray.
        alpha[15 * SIDE + 10] = 0.0;
        alpha[15 * SIDE + 9] = 1.0;
        alpha[15 * SIDE + 7] = 1.0;
        let edge = Outline::of(&truth, &alpha, 100.0);
        assert_eq!((edge.holes, edge.strays), (0.0, 0.0));
        assert_eq!(edge.overlap, 399.0 / 402.0);
        alpha[20 * SIDE + 20] = 0.0;
        alpha[2 * SIDE + 2] = 1.0;
        alpha[15 * SIDE + 6] = 1.0;
        let found = Outline::of(&truth, &alpha, 100.0);
        assert_eq!(found.holes, 1.0 / 400.0);
        assert_eq!(found.strays, 2.0 / 400.0);
    }
}
