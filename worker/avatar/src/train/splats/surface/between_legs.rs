//! What a film shows between the legs: where cloth closes the gap, and where the cloth ends.

use super::outline::{blend, forward};
use crate::train::splats::hull::{HullFrame, HullFrames};
use yoto_body::Body;
use yoto_ops::warp::inverse::solve::apply;

/// Joints of hips, knees and ankles, left and right.
const JOINTS: [[usize; 2]; 3] = [[1, 2], [4, 5], [7, 8]];
/// Bones of thigh and shin, left and right.
pub(super) const LEGS: [[u8; 2]; 2] = [[1, 4], [2, 5]];
/// Height of a level, metres.
const LEVEL: f32 = 0.02;
/// Gap between the bare legs, across the line of sight, from which a frame tells whether something closes it, metres.
const GAP: f32 = 0.02;
/// Fewest frames that tell about a level, and the fewest such levels above a hem.
const FEWEST: usize = 4;
const FEWEST_LEVELS: usize = 3;
/// Coverage of a pixel of the person.
const COVERED: f32 = 127.5;
/// Share of the frames that may show background between the legs above a hem, and that which must show it somewhere below.
const CLOSED: f64 = 0.02;
const OPEN: f64 = 0.2;

/// Hips, knees and ankles in the rest pose, left and right, metres.
pub(super) struct Legs([[[f32; 3]; 2]; 3]);

impl Legs {
    /// The legs of a skeleton with SMPL's `joints`.
    pub(super) fn new(joints: &[[f32; 3]]) -> Self {
        Self(JOINTS.map(|pair| pair.map(|joint| joints[joint])))
    }

    /// Height of the lower hip in the rest pose, metres.
    pub(super) fn hips(&self) -> f32 {
        lower(self.0[0])
    }

    /// The height in the rest pose above which the frames of `hull` show something between the legs of the `bare` body `[V, 3]`, metres.
    /// `None` if they do not show it, or not where it ends.
    pub(super) fn closed_above(
        &self,
        body: &Body,
        bare: &[[f32; 3]],
        hull: &HullFrames<'_>,
    ) -> Option<f32> {
        let levels = self.levels();
        let widths: Vec<f32> = (levels.iter())
            .map(|level| self.width(*level, body, bare))
            .collect();
        let mut votes = vec![Votes::default(); levels.len()];
        for frame in &hull.frames {
            let forward = forward(frame);
            for ((own, level), width) in votes.iter_mut().zip(&levels).zip(&widths) {
                own.add(frame, self.at(*level, &forward), width + GAP);
            }
        }
        let open: Vec<Option<f64>> = votes.into_iter().map(Votes::open).collect();
        let forgiven = hull.forgiven() as f64 / hull.frames.len().max(1) as f64;
        Some(levels[lowest_closed(&open, forgiven)?])
    }

    /// Heights below the hips and above the ankles, from above.
    fn levels(&self) -> Vec<f32> {
        let [.., ankles] = self.0;
        let below = (1..).map(|level| self.hips() - LEVEL * level as f32);
        below.take_while(|level| *level > lower(ankles)).collect()
    }

    /// Whether a height is below the knees.
    fn is_shin(&self, level: f32) -> bool {
        let [_, knees, _] = self.0;
        level <= lower(knees)
    }

    /// The middle of a leg at a height.
    fn middle(&self, level: f32, side: usize) -> [f32; 3] {
        let bone = usize::from(self.is_shin(level));
        let [from, to] = [self.0[bone][side], self.0[bone + 1][side]];
        let share = (level - from[1]) / (to[1] - from[1]).min(-1e-3);
        std::array::from_fn(|a| from[a] + share * (to[a] - from[a]))
    }

    /// The middles of both legs at a height of the rest pose, where bones carry them with the transforms `forward`.
    fn at(&self, level: f32, forward: &[[f32; 12]]) -> [[f32; 3]; 2] {
        let bone = usize::from(self.is_shin(level));
        [0, 1].map(|side| {
            let transform = blend(forward, [(LEGS[side][bone], 1.0)].into_iter());
            apply(&transform, self.middle(level, side))
        })
    }

    /// The mean width of the `bare` legs at a height, metres.
    fn width(&self, level: f32, body: &Body, bare: &[[f32; 3]]) -> f32 {
        let (mut sum, mut count) = (0.0, 0);
        for (side, leg) in LEGS.iter().enumerate() {
            let [x, _, z] = self.middle(level, side);
            let own = (bare.iter().zip(&body.bones))
                .filter(|(at, bones)| (at[1] - level).abs() < LEVEL && leg.contains(&bones[0]));
            for (at, _) in own {
                sum += 2.0 * (at[0] - x).hypot(at[2] - z);
                count += 1;
            }
        }
        sum / count.max(1) as f32
    }
}

/// Frames that show the legs apart at a level.
#[derive(Clone, Copy, Default)]
struct Votes {
    closed: usize,
    open: usize,
}

impl Votes {
    /// Counts a frame with these middles of the legs, metres, if they are `apart` across the line of sight.
    fn add(&mut self, frame: &HullFrame, [left, right]: [[f32; 3]; 2], apart: f32) {
        let between: [f32; 3] = std::array::from_fn(|a| 0.5 * (left[a] + right[a]));
        let sight: [f32; 3] = std::array::from_fn(|r| {
            let [a, b, c, d] = frame.camera[r];
            a * between[0] + b * between[1] + c * between[2] + d
        });
        let across: [f32; 3] = std::array::from_fn(|r| {
            let row = frame.camera[r];
            (0..3).map(|c| row[c] * (left[c] - right[c])).sum()
        });
        let along = dot(sight, across).powi(2) / dot(sight, sight).max(1e-9);
        if dot(across, across) - along < apart * apart {
            return;
        }
        match frame.coverage(between) {
            Some(coverage) if coverage >= COVERED => self.closed += 1,
            Some(_) => self.open += 1,
            None => {}
        }
    }

    /// The share of the frames with background between the legs; `None` of too few.
    fn open(self) -> Option<f64> {
        let all = self.closed + self.open;
        (all >= FEWEST).then(|| self.open as f64 / all as f64)
    }
}

/// The index of the lowest level that is closed. `open` levels are given from above, with the share of the frames that show background
/// there; masks and poses are off in a share `forgiven` of the frames. `None` if too few levels are seen, or the end is not.
fn lowest_closed(open: &[Option<f64>], forgiven: f64) -> Option<usize> {
    let above = |bound: f64| move |open: &f64| *open > forgiven + bound;
    let first = open
        .iter()
        .position(|it| it.is_some_and(|it| above(CLOSED)(&it)))?;
    let ends = open.iter().flatten().any(above(OPEN));
    let closed = open[..first].iter().flatten().count();
    (ends && closed >= FEWEST_LEVELS).then(|| first - 1)
}

fn lower([left, right]: [[f32; 3]; 2]) -> f32 {
    left[1].min(right[1])
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cloth_ends_where_frames_show_background_between_legs_that_are_apart() {
        let seen = |open: &[f64]| open.iter().copied().map(Some).collect::<Vec<_>>();
        let mut skirt = vec![None; 4];
        skirt.extend(seen(&[0.0, 0.0, 0.0, 0.13, 0.4, 0.53]));
        assert_eq!(lowest_closed(&skirt, 0.0), Some(6));
        assert_eq!(lowest_closed(&skirt, 0.2), Some(7), "inexact masks");
        let trousers = seen(&[0.1, 0.4, 0.5]);
        assert_eq!(lowest_closed(&trousers, 0.0), None);
        let mut together = vec![None; 20];
        together.extend(seen(&[0.0, 0.3, 0.5]));
        assert_eq!(lowest_closed(&together, 0.0), None, "thighs touch");
        assert_eq!(lowest_closed(&seen(&[0.0; 20]), 0.0), None, "no end");
        assert_eq!(lowest_closed(&[], 0.0), None);
    }

    #[test]
    fn legs_are_followed_to_the_ankles() {
        let mut joints = [[0.0; 3]; 24];
        for (side, x) in [0.1, -0.1].into_iter().enumerate() {
            joints[1 + side] = [x, 1.0, 0.0];
            joints[4 + side] = [x, 0.5, 0.1];
            joints[7 + side] = [2.0 * x, 0.1, 0.1];
        }
        let legs = Legs::new(&joints);
        assert_eq!(legs.hips(), 1.0);
        let levels = legs.levels();
        assert!(levels.iter().all(|level| (0.1..1.0).contains(level)));
        assert!(levels.len() >= 44, "{}", levels.len());
        let near = |a: [f32; 3], b: [f32; 3]| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-5);
        assert!(near(legs.middle(0.75, 0), [0.1, 0.75, 0.05]));
        assert!(near(legs.middle(0.3, 1), [-0.15, 0.3, 0.1]));
    }
}
