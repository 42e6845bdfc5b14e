//! Splats in a grid, to find those near a point.

use std::collections::HashMap;
use yoto_avatar::render::SkinnedSplat;

/// Width of a cell, metres: a few splats.
const CELL: f32 = 0.03;

/// A splat on the surface in the rest pose.
pub(super) struct Disc {
    pub mean: [f32; 3],
    /// Unit vectors along its axes; the third points out of the body.
    pub axes: [[f32; 3]; 3],
    /// Standard deviations along them, metres.
    pub deviations: [f32; 3],
    pub opacity: f32,
    pub colour: [f32; 3],
    /// Joints and their skinning weights.
    pub bones: [(u16, f32); 4],
}

impl Disc {
    /// A splat with `colour`.
    fn new(splat: &SkinnedSplat, colour: [f32; 3]) -> Self {
        let [w, x, y, z] = splat.rotation;
        Self {
            mean: splat.mean,
            axes: [
                [
                    1.0 - 2.0 * (y * y + z * z),
                    2.0 * (x * y + w * z),
                    2.0 * (x * z - w * y),
                ],
                [
                    2.0 * (x * y - w * z),
                    1.0 - 2.0 * (x * x + z * z),
                    2.0 * (y * z + w * x),
                ],
                [
                    2.0 * (x * z + w * y),
                    2.0 * (y * z - w * x),
                    1.0 - 2.0 * (x * x + y * y),
                ],
            ],
            deviations: splat.deviations,
            opacity: splat.opacity,
            colour,
            bones: splat.bones,
        }
    }

    /// A point's coordinates along the axes, from the middle.
    pub(super) fn local(&self, point: [f32; 3]) -> [f32; 3] {
        let from = minus(point, self.mean);
        self.axes.map(|axis| dot(axis, from))
    }

    /// The outward unit vector.
    pub(super) fn normal(&self) -> [f32; 3] {
        self.axes[2]
    }
}

/// All splats of a person.
pub(super) struct Cloud {
    pub discs: Vec<Disc>,
    cells: HashMap<[i32; 3], Vec<u32>>,
}

impl Cloud {
    /// The cloud of `splats`; `colours` has the colour of each.
    pub(super) fn new(splats: &[SkinnedSplat], colours: &[[f32; 3]]) -> Self {
        let discs: Vec<Disc> = splats
            .iter()
            .zip(colours)
            .map(|(splat, colour)| Disc::new(splat, *colour))
            .collect();
        let mut cells: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
        for (index, disc) in discs.iter().enumerate() {
            cells.entry(cell(disc.mean)).or_default().push(index as u32);
        }
        Self { discs, cells }
    }

    /// Calls `take` with every splat that has its mean at most a cell's width from `point`, and with some farther
    /// ones.
    pub(super) fn near(&self, point: [f32; 3], mut take: impl FnMut(&Disc)) {
        let [x, y, z] = cell(point);
        for i in x - 1..=x + 1 {
            for j in y - 1..=y + 1 {
                for k in z - 1..=z + 1 {
                    for index in self.cells.get(&[i, j, k]).into_iter().flatten() {
                        take(&self.discs[*index as usize]);
                    }
                }
            }
        }
    }
}

fn cell(point: [f32; 3]) -> [i32; 3] {
    point.map(|value| (value / CELL).floor() as i32)
}

pub(super) fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

pub(super) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// `a` with length 1; a zero vector stays zero.
pub(super) fn unit(a: [f32; 3]) -> [f32; 3] {
    let length = dot(a, a).sqrt();
    if length > 0.0 {
        a.map(|v| v / length)
    } else {
        a
    }
}
