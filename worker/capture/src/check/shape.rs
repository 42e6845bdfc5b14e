//! The position and lean of outlines, and how much of their deviation a body's shape explains.
//!
//! Clothes, hair and build move the centre of an outline even where the pose is exact. They do so in the
//! same way in all frames: a part of the body is thicker, or farther forward. A deviation that no such
//! shape explains is an error of the poses.

use super::figure::{Capsule, CapsuleBody, Region, size};
use super::fit::view;
use super::least_squares::residual_rms;
use super::observe::Observation;
use super::silhouette::{Canvas, Grid};
use crate::skeleton::Skeleton;
use crate::skeleton::transform::{Vec3, add, dot, scale};
use yoto_proto::pose_track::PoseTrack;

/// Factor on a part's thickness, to find out how its thickness changes the outline.
const THICKER: f64 = 1.35;
/// Shift of a part to the front, as a share of the body's widest extent.
const FORWARD: f64 = 0.03;
/// Weight of vertical deviations. Hair, shoes and hems change them most, and the model here can't follow
/// the folds of a hem.
const HEIGHTS: f64 = 0.5;
/// Deviation of position and lean that remains with exact poses, metres.
const USUAL: f64 = 0.008;

/// Moments of an outline, metres in the plane of the image.
#[derive(Clone, Copy, Debug)]
struct Outline {
    /// Centre, across and down.
    centre: [f64; 2],
    /// Sideways distance of the upper and lower ends from the centre, in opposite directions.
    lean: f64,
}

impl Outline {
    /// The outline of weighted cells with sides of `metres`; `None` without any weight.
    fn of(cells: impl Iterator<Item = (usize, f64)>, grid: Grid, metres: f64) -> Option<Self> {
        let mut sums = [0.0; 5];
        for (cell, weight) in cells {
            let (x, y) = ((cell % grid.width) as f64, (cell / grid.width) as f64);
            for (sum, value) in sums.iter_mut().zip([1.0, x, y, x * y, y * y]) {
                *sum += weight * value;
            }
        }
        let [area, x, y, xy, yy] = sums;
        if area <= 0.0 {
            return None;
        }
        let (x, y) = (x / area, y / area);
        // At least a cell, so that a flat outline does not divide by 0.
        let spread = (yy / area - y * y).max(1.0).sqrt();
        // The ends of a uniform bar are √3 standard deviations from its middle.
        let ends = 3f64.sqrt();
        Some(Self {
            centre: [x * metres, y * metres],
            lean: ends * metres * (xy / area - x * y) / spread,
        })
    }

    /// The change from `from` to this outline: across, down and lean, weighted.
    fn change(&self, from: &Self) -> [f64; 3] {
        let [x, y] = [0, 1].map(|axis| self.centre[axis] - from.centre[axis]);
        [x, HEIGHTS * y, self.lean - from.lean]
    }
}

/// One frame's outlines.
struct Compared {
    /// From the drawing to the mask.
    off: [f64; 3],
    /// The drawing's change under each change of shape.
    shapes: Vec<[f64; 3]>,
    /// Direction of the body's front, across and along the view.
    front: [f64; 2],
}

/// Draws the bodies of a track beside their masks.
pub(super) struct Comparison<'a> {
    track: &'a PoseTrack,
    skeleton: &'a Skeleton,
    figure: CapsuleBody<'a>,
    regions: Vec<Region>,
    fatness: f64,
    grid: Grid,
    canvas: Canvas,
}

impl<'a> Comparison<'a> {
    pub(super) fn new(track: &'a PoseTrack, skeleton: &'a Skeleton, fatness: f64) -> Self {
        let figure = CapsuleBody::of(skeleton);
        let grid = Grid::of(track.image_size);
        Self {
            track,
            skeleton,
            regions: figure.regions(),
            figure,
            fatness,
            grid,
            canvas: Canvas::new(grid),
        }
    }

    /// Deviations of bodies from the masks of `seen` that no shape explains, in position and in lean:
    /// root mean squares, metres. `None` with too few frames.
    pub(super) fn wander(&mut self, seen: &[&Observation]) -> Option<[f64; 2]> {
        let frames: Vec<Compared> = seen.iter().filter_map(|it| self.compare(it)).collect();
        let of = |channels: &[usize]| {
            let (mut rows, mut values) = (Vec::new(), Vec::new());
            for frame in &frames {
                for (index, &channel) in channels.iter().enumerate() {
                    let mut row: Vec<f64> = frame.shapes.iter().map(|it| it[channel]).collect();
                    // For each channel, a constant and two terms that change with the body's heading.
                    for other in 0..channels.len() {
                        let own = f64::from(u8::from(other == index));
                        row.extend([own, own * frame.front[0], own * frame.front[1]]);
                    }
                    rows.push(row);
                    values.push(frame.off[channel]);
                }
            }
            let shapes = 2 * Region::ALL.len();
            // Shapes are expected to change by about the drawn amount (a factor with variance 1); the
            // other columns are free, with a ridge that only keeps the equations regular.
            let ridge = |column: usize| if column < shapes { USUAL * USUAL } else { 1e-9 };
            let rms = residual_rms(&rows, &values, ridge)?;
            Some(rms * (channels.len() as f64).sqrt())
        };
        Some([of(&[0, 1])?, of(&[2])?])
    }

    fn compare(&mut self, seen: &Observation) -> Option<Compared> {
        let (pose, camera) = view(self.track.frames.get(seen.position)?, self.track.image_size);
        let root = *self.skeleton.posed_joints(&pose).first()?;
        let [x, y, z, t] = camera.e[2];
        let metres = (dot([x, y, z], root) + t) / (camera.k[0][0] * self.grid.scale);
        let capsules = self.figure.posed(&pose);
        let fronts = self.figure.fronts(&pose);
        let (grid, fatness) = (self.grid, self.fatness);
        let mut draw = |capsules: &[Capsule]| {
            let cells = self.canvas.draw(capsules, &camera, fatness).iter();
            Outline::of(cells.map(|&cell| (cell as usize, 1.0)), grid, metres)
        };
        let drawn = draw(&capsules)?;
        let covered = seen.mask.cells.iter().enumerate();
        let covered = covered.filter(|(_, mask)| **mask > 0);
        let weighted = covered.map(|(cell, &mask)| (cell, f64::from(mask) / 255.0));
        let masked = Outline::of(weighted, grid, metres)?;
        let forward = FORWARD * size(self.skeleton);
        let mut shapes = Vec::with_capacity(2 * Region::ALL.len());
        for region in Region::ALL {
            let (mut thick, mut moved) = (capsules.clone(), capsules.clone());
            for (capsule, front) in fronts.iter().enumerate() {
                if self.regions.get(capsule) != Some(&region) {
                    continue;
                }
                thick[capsule].radii = thick[capsule].radii.map(|radius| THICKER * radius);
                let ends = &mut moved[capsule].ends;
                *ends = ends.map(|end| add(end, scale(*front, forward)));
            }
            for changed in [thick, moved] {
                shapes.push(draw(&changed)?.change(&drawn));
            }
        }
        let row = |axis: usize| -> Vec3 { std::array::from_fn(|i| camera.e[axis][i]) };
        let front = *fronts.first()?;
        Some(Compared {
            off: masked.change(&drawn),
            shapes,
            front: [0, 2].map(|axis| dot(row(axis), front)),
        })
    }
}
