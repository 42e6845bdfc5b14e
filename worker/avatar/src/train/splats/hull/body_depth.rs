//! The depth of trunk and head where no frame bounds it. The hull of a person filmed from the front reaches far before
//! and behind them: two lines of sight at 40 degrees to either side of a ring meet at 1.6 times its radius. Bodies' own measures
//! say how deep a part is that looks so wide from there (docs/research/splats.md, "Sides that no frame shows").

use super::HullFrames;
use crate::host::read;
use crate::motion::posed;
use crate::motion::prior::is_torso;
use crate::motion::weights::strongest;
use crate::render::RenderError;
use rayon::prelude::*;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Skeleton;
use yoto_ops::warp::inverse::solve::{Skinning, apply};

/// Depth of a part of the body as a share of its breadth. Chest, waist and hips are 0.88, 0.73 and 0.72 of their
/// breadth deep and heads 1.29, from the mean measures of men in ANSUR II (Gordon et al. 2014, NATICK/TR-15/007); clothes
/// lie close to the breast and stand off at the waist.
const TRUNK: f32 = 0.75;
const HEAD: f32 = 1.25;
/// Cosine of the angle to a part's mean view up to which a frame shows its depth, and the share of the views that must do
/// so.
const FROM_THE_SIDE: f32 = 0.5;
const SIDE_VIEWS: f32 = 0.05;
/// Depth that is left to a part, as a multiple of the expected one.
const SLACK: f32 = 1.1;
/// Depth that is left everywhere, to either side of the middle, metres.
const LEAST: f32 = 0.015;
/// Height of a ring, metres.
const STEP: f32 = 0.02;
/// Fewest points of a ring.
const FEWEST: usize = 6;
/// Shares of a ring's points between which its extents are: a stray point makes no body deeper.
const WITHIN: [f32; 2] = [0.02, 0.98];
/// Heights whose mean a ring is.
const SMOOTHED: usize = 5;
/// Most times that a ring is as wide as the part's median ring for its depth: shoulders are wide and not deep.
const WIDEST: f32 = 1.15;
/// Exponent of the curve |across|ⁿ + |depth|ⁿ = 1 around a body: between an ellipse and a box.
const ROUND: f32 = 2.5;

/// The parts of a body whose depth no frame shows.
pub(super) struct BodyDepth {
    parts: Vec<Part>,
    /// The index in `parts` of each joint's part.
    of_joint: Vec<Option<usize>>,
}

/// An upright part of the body.
struct Part {
    /// Unit vector to the camera, x and z of the rest pose.
    front: [f32; 2],
    /// Extent along `front` as a share of that across it.
    ratio: f32,
    /// Height of the middle of the first ring, metres.
    first: f32,
    rings: Vec<Ring>,
    /// Half of the width above which a ring is no deeper, metres.
    widest: f32,
}

/// A ring around a part, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Ring {
    /// Position of its middle across the view.
    middle: f32,
    /// Half of its width.
    half: f32,
    /// Depth of its middle, towards the camera.
    depth: f32,
}

impl HullFrames<'_> {
    /// How deep the body is, whose hull has these canonical `points`, metres.
    pub(super) fn depth(&self, points: Vec<[f32; 3]>) -> Result<BodyDepth, RenderError> {
        let skeleton = &self.subject.body.skeleton;
        let mut towards = vec![Vec::new(); skeleton.joints()];
        for frame in &self.frames {
            let e = &frame.camera;
            let eye = std::array::from_fn(|a| -(0..3).map(|r| e[r][a] * e[r][3]).sum::<f32>());
            let transforms = frame.transforms.as_chunks::<12>().0;
            for ((own, rest), to_rest) in towards.iter_mut().zip(&skeleton.rest).zip(transforms) {
                let [x, _, z] = apply(to_rest, eye);
                own.push([x - rest[0] as f32, z - rest[2] as f32]);
            }
        }
        let bones = self.bones(&points)?;
        let points: Vec<_> = points.into_iter().zip(bones).collect();
        Ok(BodyDepth::new(skeleton, &towards, &points))
    }

    /// The bone that moves most of each of the canonical `points`.
    pub(super) fn bones(&self, points: &[[f32; 3]]) -> Result<Vec<usize>, RenderError> {
        let body = &self.subject.body;
        let rest = Pose::rest(body.skeleton.joints());
        let rest = read(posed::transforms(body, &rest).inner())?;
        let known = &rest[..12 * body.known_joints];
        let skinning = Skinning::new(&self.weights, known, &body.grid);
        let bones = points.par_iter().map(|point| strongest(&skinning, *point));
        Ok(bones.collect())
    }
}

impl BodyDepth {
    /// The depth of the body of `skeleton`, whose hull has the `points`, each with its bone. Each frame shows each joint from
    /// the direction `towards` the camera, x and z of the rest pose. Parts that frames show from the side are left out.
    fn new(skeleton: &Skeleton, towards: &[Vec<[f32; 2]>], points: &[([f32; 3], usize)]) -> Self {
        let mut body = Self {
            parts: Vec::new(),
            of_joint: vec![None; skeleton.joints()],
        };
        let joints = |wanted: fn(&str) -> bool| -> Vec<usize> {
            let joints = 0..skeleton.joints();
            joints
                .filter(|joint| wanted(&skeleton.names[*joint]))
                .collect()
        };
        for (joints, ratio) in [(joints(is_torso), TRUNK), (joints(is_head), HEAD)] {
            let own = points.iter().filter(|(_, bone)| joints.contains(bone));
            let own: Vec<[f32; 3]> = own.map(|(point, _)| *point).collect();
            let towards = joints.iter().flat_map(|joint| &towards[*joint]);
            if let Some(part) = Part::new(towards, ratio, &own) {
                let index = Some(body.parts.len());
                joints
                    .iter()
                    .for_each(|joint| body.of_joint[*joint] = index);
                body.parts.push(part);
            }
        }
        body
    }

    /// Whether the depth of any part is bounded.
    pub(super) fn bounds(&self) -> bool {
        !self.parts.is_empty()
    }

    /// Whether the point of this bone is in the body, as far as its depth tells.
    pub(super) fn holds(&self, point: [f32; 3], bone: usize) -> bool {
        let part = self.of_joint.get(bone).copied().flatten();
        part.is_none_or(|part| self.parts[part].holds(point))
    }
}

impl Part {
    /// `None` if frames show the depth of its `points`, or they are no rings.
    fn new<'a>(
        towards: impl Iterator<Item = &'a [f32; 2]>,
        ratio: f32,
        points: &[[f32; 3]],
    ) -> Option<Self> {
        let towards: Vec<[f32; 2]> = towards.map(|to| unit(*to)).collect();
        let sum = towards.iter().fold([0.0; 2], |sum: [f32; 2], it| {
            std::array::from_fn(|a| sum[a] + it[a])
        });
        let front = unit(sum);
        let mut cosines: Vec<f32> = towards.iter().map(|to| dot(*to, front)).collect();
        if cosines.is_empty() || quantile(&mut cosines, SIDE_VIEWS) < FROM_THE_SIDE {
            return None;
        }
        let (ahead, square) = (front[1] * front[1], ratio * ratio);
        let heights = points.iter().map(|point| point[1]);
        let lowest = heights.clone().fold(f32::INFINITY, f32::min);
        let highest = heights.fold(f32::NEG_INFINITY, f32::max);
        let count = ((highest - lowest).max(0.0) / STEP) as usize + 1;
        let mut levels: Vec<Vec<[f32; 2]>> = vec![Vec::new(); count];
        for point in points {
            let level = ((point[1] - lowest) / STEP) as usize;
            levels[level.min(count - 1)].push(placed(*point, front));
        }
        let rings = smoothed(&filled(
            &levels.iter().map(|it| ring(it)).collect::<Vec<_>>(),
        )?);
        let mut halves: Vec<f32> = rings.iter().map(|ring| ring.half).collect();
        Some(Self {
            front,
            // The extents of an ellipse whose axes are 1 and `ratio`, of which `front` is not one.
            ratio: ((1.0 - ahead + square * ahead) / (ahead + square * (1.0 - ahead))).sqrt(),
            first: lowest + 0.5 * STEP,
            widest: WIDEST * quantile(&mut halves, 0.5),
            rings,
        })
    }

    fn holds(&self, point: [f32; 3]) -> bool {
        let ring = self.at(point[1]);
        let [across, depth] = placed(point, self.front);
        let half = ring.half.max(LEAST);
        let beside = ((across - ring.middle) / half).abs().min(1.0);
        let round = (1.0 - beside.powf(ROUND)).powf(1.0 / ROUND);
        let deep = SLACK * self.ratio * half.min(self.widest) * round;
        (depth - ring.depth).abs() <= deep.max(LEAST)
    }

    /// The ring at a height.
    fn at(&self, height: f32) -> Ring {
        let at = ((height - self.first) / STEP).max(0.0);
        let below = (at as usize).min(self.rings.len() - 1);
        let above = (below + 1).min(self.rings.len() - 1);
        self.rings[below].towards(self.rings[above], (at - below as f32).min(1.0))
    }
}

impl Ring {
    /// The mixture with `other`, of which it has the `share`.
    fn towards(self, other: Self, share: f32) -> Self {
        let mix = |a: f32, b: f32| a + share * (b - a);
        Self {
            middle: mix(self.middle, other.middle),
            half: mix(self.half, other.half),
            depth: mix(self.depth, other.depth),
        }
    }
}

/// A point across the view from `front`, and along it.
fn placed([x, _, z]: [f32; 3], front: [f32; 2]) -> [f32; 2] {
    [dot([x, z], [front[1], -front[0]]), dot([x, z], front)]
}

/// The ring of the points of a level, across and depth; `None` of too few.
fn ring(level: &[[f32; 2]]) -> Option<Ring> {
    let extent = |axis: usize| {
        let mut numbers: Vec<f32> = level.iter().map(|at| at[axis]).collect();
        WITHIN.map(|share| quantile(&mut numbers, share))
    };
    (level.len() >= FEWEST).then(|| {
        let ([left, right], [back, front]) = (extent(0), extent(1));
        Ring {
            middle: 0.5 * (left + right),
            half: 0.5 * (right - left),
            depth: 0.5 * (back + front),
        }
    })
}

/// `known` rings, with mixtures of the nearest ones in between and the nearest one beyond; `None` if none is known.
fn filled(known: &[Option<Ring>]) -> Option<Vec<Ring>> {
    let places: Vec<(usize, Ring)> = (known.iter().enumerate())
        .filter_map(|(at, ring)| Some((at, (*ring)?)))
        .collect();
    let ring = |at: usize| {
        let above = places.partition_point(|(place, _)| *place < at);
        let below = above.checked_sub(1).map(|it| places[it]);
        match (below, places.get(above)) {
            (Some((low, a)), Some((high, b))) => {
                Some(a.towards(*b, (at - low) as f32 / (high - low) as f32))
            }
            (Some((_, only)), None) => Some(only),
            (None, Some((_, only))) => Some(*only),
            (None, None) => None,
        }
    };
    (0..known.len()).map(ring).collect()
}

/// Rings that change slowly with height.
fn smoothed(rings: &[Ring]) -> Vec<Ring> {
    let (last, half) = (rings.len() as isize - 1, SMOOTHED as isize / 2);
    let mean = |at: isize, number: fn(&Ring) -> f32| {
        let near = (at - half..=at + half).map(|it| number(&rings[it.clamp(0, last) as usize]));
        near.sum::<f32>() / SMOOTHED as f32
    };
    let ring = |at: isize| Ring {
        middle: mean(at, |ring| ring.middle),
        half: mean(at, |ring| ring.half),
        depth: mean(at, |ring| ring.depth),
    };
    (0..=last).map(ring).collect()
}

/// The number below which the `share` of `numbers` is; 0 without any.
fn quantile(numbers: &mut [f32], share: f32) -> f32 {
    if numbers.is_empty() {
        return 0.0;
    }
    let rank = (share * (numbers.len() - 1) as f32).round() as usize;
    *numbers.select_nth_unstable_by(rank, f32::total_cmp).1
}

fn is_head(name: &str) -> bool {
    name.to_ascii_lowercase().contains("head")
}

fn dot([a, b]: [f32; 2], [x, y]: [f32; 2]) -> f32 {
    a * x + b * y
}

fn unit(v: [f32; 2]) -> [f32; 2] {
    let length = dot(v, v).sqrt().max(1e-9);
    v.map(|v| v / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A trunk of `points` between pelvis and spine, seen from `towards`.
    fn body(towards: &[[f32; 2]], points: &[[f32; 3]]) -> BodyDepth {
        let skeleton = Skeleton {
            names: ["pelvis", "spine", "knee"].map(String::from).to_vec(),
            parents: vec![None, Some(0), Some(0)],
            rest: vec![[0.0; 3], [0.0, 0.3, 0.0], [0.0, -0.5, 0.0]],
        };
        let points: Vec<_> = points.iter().map(|point| (*point, 0)).collect();
        BodyDepth::new(&skeleton, &vec![towards.to_vec(); 3], &points)
    }

    /// The hull of a trunk 30 cm wide, 60 cm high, which views at 40 degrees leave 50 cm deep.
    fn hull() -> Vec<[f32; 3]> {
        let cells = |at: i32, step: f32| step * at as f32;
        let mut points = Vec::new();
        for y in 0..30 {
            for x in -7..=7 {
                for z in -12..=12 {
                    points.push([cells(x, 0.02), cells(y, 0.02), cells(z, 0.02)]);
                }
            }
        }
        points
    }

    /// How deep a body is in the middle of a trunk, metres.
    fn depth(body: &BodyDepth) -> f32 {
        let inside = (0..40).filter(|z| body.holds([0.0, 0.3, 0.01 * *z as f32], 1));
        0.02 * inside.count() as f32
    }

    #[test]
    fn a_trunk_seen_from_the_front_is_as_deep_as_its_width_tells() {
        let body = body(&[[0.0, 1.0], [0.5, 0.8], [-0.5, 0.8]], &hull());
        assert!(
            (depth(&body) - SLACK * TRUNK * 0.28).abs() < 0.02,
            "{}",
            depth(&body)
        );
        assert!(body.holds([0.0, -0.5, 0.3], 2), "a leg has no bound");
        for [x, z] in [[0.14, 0.0], [-0.14, 0.01], [0.0, 0.0]] {
            assert!(body.holds([x, 0.3, z], 0), "the outline stays: {x} {z}");
        }
        assert!(!body.holds([0.13, 0.3, 0.2], 0), "corners are round");
    }

    #[test]
    fn a_trunk_seen_from_its_side_is_deeper_than_it_looks_wide() {
        let turned: Vec<_> = hull().iter().map(|[x, y, z]| [*z, *y, *x]).collect();
        let body = body(&[[1.0, 0.0]], &turned);
        let inside = (0..60).filter(|x| body.holds([0.01 * *x as f32, 0.3, 0.0], 1));
        let deep = 0.02 * inside.count() as f32;
        assert!((deep - SLACK / TRUNK * 0.28).abs() < 0.02, "{deep}");
    }

    #[test]
    fn what_frames_show_from_the_side_keeps_its_shape() {
        let around = [[0.0, 1.0], [1.0, 0.0], [0.0, -1.0]];
        assert!(!body(&around, &hull()).bounds());
        // One view of a hundred is an error of poses.
        let mut ahead = vec![[0.0, 1.0]; 99];
        ahead.push([1.0, 0.0]);
        assert!(body(&ahead, &hull()).bounds());
        assert!(!body(&[], &hull()).bounds(), "no frame");
        assert!(!body(&[[0.0, 1.0]], &[]).bounds(), "no hull");
    }
}
