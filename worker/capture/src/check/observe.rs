//! The check's observation of a frame: coarse masks and a few numbers, never the pixels.

use super::silhouette::{Grid, Thumb};
use crate::FrameImage;

/// Luma above this is content, not black.
const BLACK: u8 = 8;
/// Least luma of a burnt-out pixel.
const BURNT: u8 = 250;
/// Least coverage of a pixel of the person.
const PERSON: u8 = 128;
/// Fewest pixels on which edges are measured.
const ENOUGH: usize = 64;

/// One frame that was looked at.
#[derive(Clone, Debug)]
pub(super) struct Observation {
    /// Position in the track.
    pub position: usize,
    /// The coarse mask.
    pub mask: Thumb,
    /// The part of the coarse image that is not black.
    pub content: Thumb,
    /// Luma of the coarse image.
    pub luma: Vec<u8>,
    /// Share of the image that the mask covers.
    pub covered: f64,
    /// Share of the mask outside its largest connected piece.
    pub scattered: f64,
    /// Whether the person reaches a border of the image.
    pub cut_off: bool,
    /// Width of the person's edges (sigma of a blur), pixels; `None` without texture.
    pub blur: Option<f64>,
    /// Mean luma of the person, 0 to 1.
    pub brightness: f64,
    /// Share of the person's pixels that are burnt out.
    pub burnt: f64,
    /// Share of the person's pixels that are black.
    pub black: f64,
    /// The 98th percentile of the person's luma, 0 to 1.
    pub lights: f64,
}

impl Observation {
    pub(super) fn of(position: usize, frame: &FrameImage) -> Self {
        let small = frame.resized(Grid::LONGEST);
        let luma: Vec<u8> = small.rgb.chunks_exact(3).map(luma).collect();
        let content = luma.iter().map(|&l| if l > BLACK { 255 } else { 0 });
        let light = Light::of(frame);
        Self {
            position,
            content: Thumb::new(content.collect()),
            scattered: scattered(&small.mask, small.width, small.height),
            cut_off: touches_border(&small.mask, small.width, small.height),
            covered: small.mask.iter().map(|&m| f64::from(m)).sum::<f64>()
                / (255.0 * small.mask.len().max(1) as f64),
            mask: Thumb::new(small.mask),
            luma,
            blur: edge_width(frame),
            brightness: light.mean,
            burnt: light.burnt,
            black: light.black,
            lights: light.lights,
        }
    }

    /// This observation with the mask inverted.
    pub(super) fn inverted(&self) -> Self {
        let cells = self.mask.cells.iter().map(|&value| 255 - value);
        Self {
            mask: Thumb::new(cells.collect()),
            ..self.clone()
        }
    }

    /// Whether the mask shows a person.
    pub(super) fn shows_person(&self) -> bool {
        self.mask.area >= 4.0
    }
}

fn luma(pixel: &[u8]) -> u8 {
    let [r, g, b] = [0, 1, 2].map(|i| u32::from(pixel.get(i).copied().unwrap_or(0)));
    ((r * 77 + g * 150 + b * 29) >> 8) as u8
}

struct Light {
    mean: f64,
    burnt: f64,
    black: f64,
    lights: f64,
}

impl Light {
    fn of(frame: &FrameImage) -> Self {
        let (mut sum, mut burnt, mut black, mut count) = (0u64, 0u64, 0u64, 0u64);
        let mut levels = [0u64; 256];
        for (pixel, &mask) in frame.rgb.chunks_exact(3).zip(&frame.mask) {
            if mask < PERSON {
                continue;
            }
            let luma = luma(pixel);
            sum += u64::from(luma);
            count += 1;
            levels[usize::from(luma)] += 1;
            burnt += u64::from(luma >= BURNT);
            black += u64::from(luma <= BLACK / 2);
        }
        let mut above = 0;
        let lights = levels.iter().rposition(|level| {
            above += level;
            above > count / 50
        });
        let share = |part: u64| part as f64 / count.max(1) as f64;
        Self {
            mean: share(sum) / 255.0,
            burnt: share(burnt),
            black: share(black),
            lights: lights.unwrap_or(0) as f64 / 255.0,
        }
    }
}

/// Sigma of the Gaussian blur that makes an ideal edge as wide as the person's edges. For a Gaussian, the
/// rms values of first and second derivative have the ratio sigma √2. Pixels at the mask's border are left
/// out: they show the cut, not the lens.
fn edge_width(frame: &FrameImage) -> Option<f64> {
    let (width, height) = (frame.width, frame.height);
    let (mut first, mut second, mut count) = (0.0f64, 0.0f64, 0usize);
    let row = |y: usize| &frame.mask[y * width..(y + 1) * width];
    let at = |x: usize, y: usize| {
        let start = 3 * (y * width + x);
        f64::from(luma(&frame.rgb[start..start + 3]))
    };
    for y in 2..height.saturating_sub(2) {
        for x in 2..width.saturating_sub(2) {
            let inside = row(y)[x - 2..=x + 2].iter().all(|&m| m == 255)
                && [y - 2, y - 1, y + 1, y + 2]
                    .iter()
                    .all(|&y| row(y)[x] == 255);
            if !inside {
                continue;
            }
            let middle = at(x, y);
            for (before, after) in [(at(x - 1, y), at(x + 1, y)), (at(x, y - 1), at(x, y + 1))] {
                first += (after - middle).powi(2);
                second += (after - 2.0 * middle + before).powi(2);
            }
            count += 2;
        }
    }
    // Contrast of less than a level is quantisation, not an edge.
    let textured = count >= ENOUGH && first > count as f64 && second > 0.0;
    textured.then(|| (first / second).sqrt() / std::f64::consts::SQRT_2)
}

fn touches_border(mask: &[u8], width: usize, height: usize) -> bool {
    let covered = |x: usize, y: usize| mask[y * width + x] >= PERSON;
    (0..width).any(|x| covered(x, 0) || covered(x, height - 1))
        || (0..height).any(|y| covered(0, y) || covered(width - 1, y))
}

/// Share of the mask's cells that are not in its largest connected piece.
fn scattered(mask: &[u8], width: usize, height: usize) -> f64 {
    let mut seen = vec![false; mask.len()];
    let (mut total, mut largest) = (0usize, 0usize);
    let mut open = Vec::new();
    for start in 0..mask.len() {
        if seen[start] || mask[start] < PERSON {
            continue;
        }
        let mut piece = 0;
        seen[start] = true;
        open.push(start);
        while let Some(cell) = open.pop() {
            piece += 1;
            let (x, y) = (cell % width, cell / width);
            let mut visit = |x: usize, y: usize| {
                let cell = y * width + x;
                if mask[cell] >= PERSON && !seen[cell] {
                    seen[cell] = true;
                    open.push(cell);
                }
            };
            // Diagonal neighbours too: the cells of a thin arm may touch by their corners only.
            for near_y in y.saturating_sub(1)..(y + 2).min(height) {
                for near_x in x.saturating_sub(1)..(x + 2).min(width) {
                    visit(near_x, near_y);
                }
            }
        }
        total += piece;
        largest = largest.max(piece);
    }
    (total - largest) as f64 / total.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(pixel: impl Fn(usize, usize) -> (u8, u8)) -> FrameImage {
        let mut frame = FrameImage::empty(64, 48);
        for y in 0..48 {
            for x in 0..64 {
                let (level, mask) = pixel(x, y);
                frame.mask[y * 64 + x] = mask;
                frame.rgb[3 * (y * 64 + x)..][..3].fill(level);
            }
        }
        frame
    }

    #[test]
    fn edges_are_as_wide_as_their_blur() {
        for sigma in [1.5, 3.0] {
            // The integral of a Gaussian, by its logistic stand-in.
            let edge = |x: usize| {
                let t = (x as f64 - 31.7) / sigma;
                (40.0 + 160.0 / (1.0 + (-1.702 * t).exp())) as u8
            };
            let blurred = Observation::of(0, &frame(|x, _| (edge(x), 255)));
            let found = blurred.blur.expect("there is an edge");
            assert!((found - sigma).abs() < 0.25 * sigma, "{sigma}: {found}");
        }
        let flat = Observation::of(0, &frame(|_, _| (90, 255)));
        assert_eq!(flat.blur, None);
    }

    #[test]
    fn masks_tell_pieces_borders_and_light() {
        let two = Observation::of(
            0,
            &frame(|x, y| {
                let here = (4..14).contains(&y) && ((4..24).contains(&x) || (40..50).contains(&x));
                (if here { 255 } else { 0 }, if here { 255 } else { 0 })
            }),
        );
        assert!((two.scattered - 1.0 / 3.0).abs() < 1e-9 && !two.cut_off);
        assert_eq!((two.burnt, two.black), (1.0, 0.0));
        assert!(two.mask.overlap_with(&two.content) > 0.99);
        let cut = Observation::of(0, &frame(|x, _| (0, if x < 9 { 255 } else { 0 })));
        assert!(cut.cut_off && cut.black == 1.0 && cut.scattered == 0.0);
        assert!(!Observation::of(0, &frame(|_, _| (9, 0))).shows_person());
    }
}
