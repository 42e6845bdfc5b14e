//! The pixels that a fit compares: a grid over the person, and its blur.
//!
//! A sharp picture says nothing about an arm that is farther away than its outline is wide. Blurred
//! by as much, both outlines overlap, and the difference points from one to the other.

use yoto_capture::FrameImage;

/// Number of pixels that a grid has at most, about: enough for the parameters of a pose many times
/// over.
const PIXELS: f64 = 600.0;

/// A grid of pixels, row by row.
pub(super) struct PixelGrid {
    columns: usize,
    rows: usize,
    /// Index of each pixel in the image.
    pub pixels: Vec<usize>,
    /// Weights of the blur, symmetric about the middle one; their sum is 1.
    taps: Vec<f64>,
    /// Standard deviation of the blur, pixels.
    pub spread: f64,
}

impl PixelGrid {
    /// A grid over the box of the `covered` pixels and a margin, for a blur with a standard
    /// deviation of the share `blur` of its longer side. `offset` in [0, 1)² shifts it within
    /// a cell. `None` if no pixel is covered.
    pub(super) fn new(
        image: &FrameImage,
        covered: &[u32],
        blur: f64,
        offset: [f64; 2],
    ) -> Option<Self> {
        let at = |p: &u32| [*p as usize % image.width, *p as usize / image.width];
        let first = at(covered.first()?);
        let (mut low, mut high) = (first, first);
        for p in covered {
            for (a, c) in at(p).into_iter().enumerate() {
                low[a] = low[a].min(c);
                high[a] = high[a].max(c);
            }
        }
        let longer = (0..2).map(|a| high[a] - low[a] + 1).fold(1, usize::max) as f64;
        let blur = blur * longer;
        let margin = (2.0 * blur + 0.05 * longer) as usize;
        let limits = [image.width, image.height];
        let low = low.map(|c| c.saturating_sub(margin));
        let high: [usize; 2] = std::array::from_fn(|a| (high[a] + margin).min(limits[a] - 1));
        Some(Self::over(image.width, [low, high], PIXELS, blur, offset))
    }

    /// A grid of at most some `most` pixels over a box of a picture of `width` pixels, from its first to its last pixel, for a
    /// blur with a standard deviation of `blur` pixels.
    pub(super) fn over(
        width: usize,
        [low, high]: [[usize; 2]; 2],
        most: f64,
        blur: f64,
        offset: [f64; 2],
    ) -> Self {
        let area: f64 = (0..2).map(|a| (high[a] - low[a] + 1) as f64).product();
        let stride = (0.75 * blur).max((area / most).sqrt()).round().max(1.0) as usize;
        let line = |a: usize| {
            let first = low[a] + (offset[a] * stride as f64) as usize;
            (first.min(high[a])..=high[a]).step_by(stride)
        };
        let pixels: Vec<usize> = line(1)
            .flat_map(|y| line(0).map(move |x| y * width + x))
            .collect();
        Self {
            columns: line(0).count(),
            rows: line(1).count(),
            pixels,
            taps: taps(blur / stride as f64),
            spread: blur,
        }
    }

    /// Number of independent values per pixel after the blur, at most 1.
    pub(super) fn independent(&self) -> f64 {
        self.taps.iter().map(|tap| tap * tap).sum::<f64>().powi(2)
    }

    /// Blurs `values` `[pixels, width]`; outside the grid they are 0.
    pub(super) fn blur(&self, values: &[f64], width: usize) -> Vec<f64> {
        let across = self.along(values, width, self.columns, 1);
        self.along(&across, width, self.rows, self.columns)
    }

    /// Blurs along an axis with `count` pixels, `step` apart in the list.
    fn along(&self, values: &[f64], width: usize, count: usize, step: usize) -> Vec<f64> {
        let reach = self.taps.len() / 2;
        let mut blurred = vec![0.0; values.len()];
        for (pixel, to) in blurred.chunks_exact_mut(width).enumerate() {
            let index = pixel / step % count;
            let from = index.saturating_sub(reach);
            for other in from..(index + reach + 1).min(count) {
                let tap = self.taps[other + reach - index];
                let at = (pixel + other * step - index * step) * width;
                for (to, value) in to.iter_mut().zip(&values[at..at + width]) {
                    *to += tap * value;
                }
            }
        }
        blurred
    }
}

/// Weights of a Gauss curve with a standard deviation of `spread` cells.
fn taps(spread: f64) -> Vec<f64> {
    let reach = (2.5 * spread).ceil() as i32;
    let curve = |i: i32| (-0.5 * (f64::from(i) / spread.max(1e-3)).powi(2)).exp();
    let sum: f64 = (-reach..=reach).map(curve).sum();
    (-reach..=reach).map(|i| curve(i) / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(blur: f64) -> PixelGrid {
        let image = FrameImage {
            width: 40,
            height: 30,
            rgb: vec![0; 3600],
            mask: vec![0; 1200],
        };
        let covered: Vec<u32> = (5..25)
            .flat_map(|y| (10..20).map(move |x| 40 * y + x))
            .collect();
        PixelGrid::new(&image, &covered, blur, [0.0; 2]).expect("covered")
    }

    #[test]
    fn a_grid_covers_the_person_and_a_margin() {
        let grid = grid(0.05);
        let columns = grid.pixels.iter().map(|p| p % 40);
        // 20 pixels long: 2 of blur and 1 more on each side.
        assert_eq!((columns.clone().min(), columns.max()), (Some(7), Some(22)));
        assert_eq!(grid.pixels.len(), grid.columns * grid.rows);
    }

    #[test]
    fn a_blur_spreads_a_value_and_keeps_its_sum() {
        let grid = grid(0.1);
        let middle = grid.rows / 2 * grid.columns + grid.columns / 2;
        let mut values = vec![0.0; 2 * grid.pixels.len()];
        values[2 * middle + 1] = 1.0;
        let blurred = grid.blur(&values, 2);
        let sum = |i: usize| blurred.iter().skip(i).step_by(2).sum::<f64>();
        assert!(sum(0) == 0.0 && (sum(1) - 1.0).abs() < 1e-9, "{}", sum(1));
        assert!(blurred[2 * middle + 1] < 0.2);
        assert_eq!(blurred[2 * middle - 1], blurred[2 * middle + 3]);
        let below = blurred[2 * (middle + grid.columns) + 1];
        assert!((below - blurred[2 * middle + 3]).abs() < 1e-15);
    }

    #[test]
    fn a_picture_without_the_person_has_no_grid() {
        let image = FrameImage {
            width: 4,
            height: 4,
            rgb: vec![0; 48],
            mask: vec![0; 16],
        };
        assert!(PixelGrid::new(&image, &[], 0.1, [0.0; 2]).is_none());
    }
}
