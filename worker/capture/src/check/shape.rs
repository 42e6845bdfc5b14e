//! Where an outline is and how it leans, and what of that a body's shape explains.
//!
//! Clothes, hair and build move the centre of an outline as exactly known poses do not. They do so by
//! the same rule in all frames: a part of the body is thicker, or stands farther forward. What no such
//! shape explains is an error of the poses.

use super::figure::{Capsule, Figure, Region, size};
use super::fit::view;
use super::least_squares::unexplained;
use super::observe::Observation;
use super::silhouette::{Canvas, Grid};
use crate::skeleton::Skeleton;
use crate::skeleton::transform::{Vec3, add, dot, scale};
use yoto_proto::pose_track::PoseTrack;

/// How much thicker a part is drawn to see what its thickness changes.
const THICKER: f64 = 1.35;
/// How far forward a part is drawn, a share of the body's widest extent.
const FORWARD: f64 = 0.03;
/// Share at which heights count: hair, shoes and hems change them most, and no rule that is fitted here
/// follows the folds of a hem.
const HEIGHTS: f64 = 0.5;
/// What of an outline's place and lean no shape explains of exact poses, metres.
const USUAL: f64 = 0.008;

/// Of an outline, metres in the plane of the image.
#[derive(Clone, Copy, Debug)]
struct Outline {
    /// Its centre, across and down.
    centre: [f64; 2],
    /// How far its upper and lower end are aside of its centre, to opposite sides.
    lean: f64,
}

impl Outline {
    /// Of weighted cells, as long as `metres` each; none of nothing.
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
        let spread = (yy / area - y * y).max(1.0).sqrt();
        // The ends of an even bar are so many standard deviations from its middle.
        let ends = 3f64.sqrt();
        Some(Self {
            centre: [x * metres, y * metres],
            lean: ends * metres * (xy / area - x * y) / spread,
        })
    }

    /// From `from` to this: across, down and lean, as they count.
    fn change(&self, from: &Self) -> [f64; 3] {
        let [x, y] = [0, 1].map(|axis| self.centre[axis] - from.centre[axis]);
        [x, HEIGHTS * y, self.lean - from.lean]
    }
}

/// One frame's outlines.
struct Compared {
    /// From the drawing to the mask.
    off: [f64; 3],
    /// What each change of shape does to the drawing.
    shapes: Vec<[f64; 3]>,
    /// Across and along the view, where the body's front points.
    front: [f64; 2],
}

/// Draws the bodies of a track beside their masks.
pub(super) struct Comparison<'a> {
    track: &'a PoseTrack,
    skeleton: &'a Skeleton,
    figure: Figure<'a>,
    regions: Vec<Region>,
    fatness: f64,
    grid: Grid,
    canvas: Canvas,
}

impl<'a> Comparison<'a> {
    pub(super) fn new(track: &'a PoseTrack, skeleton: &'a Skeleton, fatness: f64) -> Self {
        let figure = Figure::of(skeleton);
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

    /// How far bodies are off the masks of `seen` beyond what one shape explains, in place and in
    /// lean: root mean squares, metres. None with too few frames.
    pub(super) fn wander(&mut self, seen: &[&Observation]) -> Option<[f64; 2]> {
        let frames: Vec<Compared> = seen.iter().filter_map(|it| self.compare(it)).collect();
        let of = |channels: &[usize]| {
            let (mut rows, mut values) = (Vec::new(), Vec::new());
            for frame in &frames {
                for (place, &channel) in channels.iter().enumerate() {
                    let mut row: Vec<f64> = frame.shapes.iter().map(|it| it[channel]).collect();
                    // A mean, and what changes with the heading, for each by itself.
                    for other in 0..channels.len() {
                        let own = f64::from(u8::from(other == place));
                        row.extend([own, own * frame.front[0], own * frame.front[1]]);
                    }
                    rows.push(row);
                    values.push(frame.off[channel]);
                }
            }
            let shapes = 2 * Region::ALL.len();
            // A part changes by the amount it was drawn with, or by less.
            let doubt = |column: usize| if column < shapes { USUAL * USUAL } else { 1e-9 };
            let rms = unexplained(&rows, &values, doubt)?;
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
            for (place, front) in fronts.iter().enumerate() {
                if self.regions.get(place) != Some(&region) {
                    continue;
                }
                thick[place].radii = thick[place].radii.map(|radius| THICKER * radius);
                let ends = &mut moved[place].ends;
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
