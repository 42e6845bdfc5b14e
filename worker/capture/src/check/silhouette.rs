//! Outlines: capsules drawn onto a coarse grid, and their overlap with a mask.

use super::figure::Capsule;
use crate::camera::{Camera, fitted_size};
use crate::skeleton::transform::{Vec3, dot};

/// Longest side of the grid, cells. The arm of a person who fills the height is 5 cells wide.
const LONGEST: u32 = 192;

/// A coarse image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    pub width: usize,
    pub height: usize,
    /// Cells per pixel.
    pub scale: f64,
}

impl Grid {
    pub(super) fn of(size: [u32; 2]) -> Self {
        let (width, height) = fitted_size(size[0], size[1], LONGEST);
        Self {
            width: width as usize,
            height: height as usize,
            scale: f64::from(width) / f64::from(size[0].max(1)),
        }
    }

    /// Longest side, as [`crate::FrameImage::resized`] takes it.
    pub(super) const LONGEST: u32 = LONGEST;

    /// The cell at image coordinates, pixels.
    pub(super) fn cell(&self, [u, v]: [f64; 2]) -> Option<usize> {
        let (x, y) = ((u * self.scale).floor(), (v * self.scale).floor());
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64;
        inside.then(|| y as usize * self.width + x as usize)
    }
}

/// The cells that a drawing covers. It is reused for many drawings without clearing.
pub(super) struct Canvas {
    grid: Grid,
    /// For each cell, the last drawing that covered it.
    stamps: Vec<u32>,
    /// Number of the current drawing.
    stamp: u32,
    cells: Vec<u32>,
}

impl Canvas {
    pub(super) fn new(grid: Grid) -> Self {
        Self {
            grid,
            stamps: vec![0; grid.width * grid.height],
            stamp: 0,
            cells: Vec::new(),
        }
    }

    /// Draws the capsules through `camera`, `fatness` times as thick, and returns the cells that they cover.
    pub(super) fn draw(&mut self, capsules: &[Capsule], camera: &Camera, fatness: f64) -> &[u32] {
        self.stamp += 1;
        self.cells.clear();
        for capsule in capsules {
            let ends = capsule.ends.map(|end| self.projected(camera, end));
            if let [Some((a, per_metre_a)), Some((b, per_metre_b))] = ends {
                let radii = [
                    capsule.radii[0] * fatness * per_metre_a,
                    capsule.radii[1] * fatness * per_metre_b,
                ];
                self.capsule([a, b], radii);
            }
        }
        &self.cells
    }

    /// The projection of a point on the grid, and cells per metre at its depth.
    fn projected(&self, camera: &Camera, point: Vec3) -> Option<([f64; 2], f64)> {
        let [u, v] = camera.project(point)?;
        let [x, y, z, t] = camera.e[2];
        let depth = dot([x, y, z], point) + t;
        let focal = (camera.k[0][0] + camera.k[1][1]) / 2.0;
        let pixel = [u * self.grid.scale, v * self.grid.scale];
        // A body nearer than a centimetre would fill any image; only a wrong reading has one.
        (depth > 0.01).then_some((pixel, focal * self.grid.scale / depth))
    }

    fn capsule(&mut self, [a, b]: [[f64; 2]; 2], radii: [f64; 2]) {
        let reach = |axis: usize, cells: usize| {
            let low = (a[axis] - radii[0]).min(b[axis] - radii[1]);
            let high = (a[axis] + radii[0]).max(b[axis] + radii[1]);
            let clamp = |value: f64| value.clamp(0.0, cells as f64) as usize;
            clamp(low.floor())..clamp(high.ceil())
        };
        let (columns, rows) = (reach(0, self.grid.width), reach(1, self.grid.height));
        let axis = [b[0] - a[0], b[1] - a[1]];
        let squared = axis[0] * axis[0] + axis[1] * axis[1];
        for row in rows {
            for column in columns.clone() {
                let from = [column as f64 + 0.5 - a[0], row as f64 + 0.5 - a[1]];
                let along = if squared > 0.0 {
                    ((from[0] * axis[0] + from[1] * axis[1]) / squared).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let off = [from[0] - along * axis[0], from[1] - along * axis[1]];
                // At least half a cell, so that thin limbs don't vanish.
                let radius = (radii[0] + along * (radii[1] - radii[0])).max(0.5);
                if off[0] * off[0] + off[1] * off[1] > radius * radius {
                    continue;
                }
                let cell = row * self.grid.width + column;
                if self.stamps[cell] != self.stamp {
                    self.stamps[cell] = self.stamp;
                    self.cells.push(cell as u32);
                }
            }
        }
    }
}

/// A mask on the grid.
#[derive(Clone, Debug)]
pub(super) struct Thumb {
    /// Coverage of each cell, 0 to 255.
    pub cells: Vec<u8>,
    /// Covered area, cells.
    pub area: f64,
}

impl Thumb {
    pub(super) fn new(cells: Vec<u8>) -> Self {
        let area = cells.iter().map(|&v| f64::from(v)).sum::<f64>() / 255.0;
        Self { cells, area }
    }

    /// Intersection over union with the drawn `cells`.
    pub(super) fn overlap(&self, cells: &[u32]) -> f64 {
        let covered: u64 = cells
            .iter()
            .map(|&cell| u64::from(self.cells[cell as usize]))
            .sum();
        let both = covered as f64 / 255.0;
        let either = self.area + cells.len() as f64 - both;
        if either > 0.0 { both / either } else { 0.0 }
    }

    /// This mask's share of its union with another.
    pub(super) fn share_with(&self, other: &Self) -> f64 {
        let pairs = self.cells.iter().zip(&other.cells);
        let either: u64 = pairs.map(|(a, b)| u64::from(*a.max(b))).sum();
        if either > 0 {
            255.0 * self.area / either as f64
        } else {
            0.0
        }
    }

    /// Intersection over union with another mask.
    pub(super) fn overlap_with(&self, other: &Self) -> f64 {
        let (mut both, mut either) = (0u64, 0u64);
        for (&a, &b) in self.cells.iter().zip(&other.cells) {
            both += u64::from(a.min(b));
            either += u64::from(a.max(b));
        }
        if either > 0 {
            both as f64 / either as f64
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_capsule_covers_its_area_and_overlaps_itself() {
        let grid = Grid::of([384, 192]);
        assert_eq!((grid.width, grid.height, grid.scale), (192, 96, 0.5));
        let camera = Camera::look_at([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 200.0, 384, 192);
        let mut canvas = Canvas::new(grid);
        let capsule = Capsule {
            ends: [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]],
            radii: [0.2; 2],
        };
        let cells = canvas.draw(&[capsule, capsule], &camera, 1.0).to_vec();
        // 25 cells per metre: a strip of 25 x 10 and a disc of radius 5.
        let area = 250.0 + std::f64::consts::PI * 25.0;
        assert!((cells.len() as f64 - area).abs() < 12.0, "{}", cells.len());
        let mut mask = vec![0; grid.width * grid.height];
        for &cell in &cells {
            mask[cell as usize] = 255;
        }
        let thumb = Thumb::new(mask);
        assert_eq!(thumb.overlap(&cells), 1.0);
        assert_eq!(thumb.overlap_with(&thumb), 1.0);
        let fat = thumb.overlap(canvas.draw(&[capsule], &camera, 2.0));
        assert!((0.3..0.6).contains(&fat), "{fat}");
        let behind = Camera::look_at(
            [0.0, 0.0, -4.0],
            [0.0, 0.0, -9.0],
            [0.0, 1.0, 0.0],
            200.0,
            384,
            192,
        );
        assert!(canvas.draw(&[capsule], &behind, 1.0).is_empty());
    }
}
