//! The posture of a person in the frames of a motion, in the file's axes, which shows the axis that is up.

use super::up::Up;
use crate::geometry::{Vec3, add, dot, scale, sub};
use yoto_capture::skeleton::{Pose, Skeleton};

/// Cosine of the largest angle, 45°, between the vertical and a person who is upright: from the feet to the head, and
/// from the pelvis to the head.
const UPRIGHT: f64 = 0.7;
/// Frames of a stride: a walking person sets down a foot at least once.
const STRIDE: usize = 20;
/// Largest unevenness of a floor, and largest distance of a floor from the origin, as shares of the height of the head
/// above the feet. The ankle of a standing person is a twentieth to a tenth above the floor.
const EVEN: f64 = 0.15;
/// Least height of the pelvis of a person who lies on a floor, in the same unit: a tenth of a metre is flesh.
const LYING: f64 = 0.03;
/// A person who gets this far, in heights of the head above the feet, across their own length, does not lie.
const TRAVEL: f64 = 1.0;

/// Positions of a person's joints in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Posture {
    pub root: Vec3,
    pub head: Vec3,
    /// The lowest joint of each leg.
    pub feet: [Vec3; 2],
}

impl Posture {
    /// The posture of a body with the `position` of each of SMPL's joints by name; `None` without a head or feet.
    pub(super) fn of(position: impl Fn(&str) -> Option<Vec3>) -> Option<Self> {
        let first = |names: &[&str]| names.iter().find_map(|name| position(name));
        Some(Self {
            root: first(&["pelvis"])?,
            head: first(&["head", "neck", "spine3", "spine2"])?,
            feet: [
                first(&["l_ankle", "l_foot", "l_knee"])?,
                first(&["r_ankle", "r_foot", "r_knee"])?,
            ],
        })
    }

    fn is_upright(&self, up: Up) -> bool {
        let along = |from: Vec3| {
            let way = sub(self.head, from);
            let length = dot(way, way).sqrt();
            length > 0.0 && dot(way, up.vector()) >= UPRIGHT * length
        };
        along(self.root) && along(self.between_feet())
    }

    fn between_feet(&self) -> Vec3 {
        scale(add(self.feet[0], self.feet[1]), 0.5)
    }

    fn height(&self) -> f64 {
        let body = sub(self.head, self.between_feet());
        dot(body, body).sqrt()
    }

    /// Height of the lowest joint along `up`: a foot, if that is up.
    fn lowest(&self, up: Up) -> f64 {
        let [left, right] = self.feet;
        let joints = [self.root, self.head, left, right];
        let heights = joints.map(|joint| dot(joint, up.vector()));
        heights.into_iter().fold(f64::INFINITY, f64::min)
    }
}

/// The postures of `poses`; `None` if the joints have other names than SMPL's.
pub(super) fn of_poses(skeleton: &Skeleton, poses: &[Pose]) -> Option<Vec<Posture>> {
    let posture = |pose: &Pose| {
        let joints = skeleton.posed_joints(pose);
        Posture::of(|wanted| {
            let at = skeleton.names.iter().position(|name| name == wanted)?;
            joints.get(at).copied()
        })
    };
    poses.iter().map(posture).collect()
}

/// The share of `postures` that are upright along `up`.
pub(super) fn upright_share(postures: &[Posture], up: Up) -> f64 {
    let upright = postures.iter().filter(|it| it.is_upright(up)).count();
    upright as f64 / postures.len().max(1) as f64
}

/// Whether foot contacts show that `up` is the up axis rather than `other`. Contacts lie on a level floor perpendicular
/// to the up axis: their heights along it stay equal while the person moves over the floor, or are near the file's origin.
pub(super) fn foot_contacts_favour(postures: &[Posture], up: Up, other: Up) -> bool {
    let mut heights: Vec<f64> = postures.iter().map(Posture::height).collect();
    heights.sort_by(f64::total_cmp);
    let size = heights.get(heights.len() / 2).copied().unwrap_or_default();
    // In the frames of each stride, the lowest joint touches the floor.
    let contact_heights = |up: Up| {
        let lowest = move |stride: &[Posture]| {
            let heights = stride.iter().map(|it| it.lowest(up));
            heights.fold(f64::INFINITY, f64::min)
        };
        postures.chunks(STRIDE).map(lowest)
    };
    let is_small = |height: f64| height.abs() <= EVEN * size;
    let is_level = |up: Up| {
        let least = contact_heights(up).fold(f64::INFINITY, f64::min);
        let most = contact_heights(up).fold(f64::NEG_INFINITY, f64::max);
        is_small(most - least)
    };
    let is_level_at_origin = |up: Up| {
        let roots = postures.iter().map(|it| dot(it.root, up.vector()));
        let root = roots.sum::<f64>() / postures.len().max(1) as f64;
        is_level(up) && contact_heights(up).all(is_small) && root > LYING * size
    };
    let moves_on_level_floor =
        is_level(up) && (!is_level(other) || travel(postures, up) > TRAVEL * size);
    moves_on_level_floor || is_level_at_origin(up) && !is_level_at_origin(other)
}

/// The largest distance of the root from its first position, perpendicular to `up`.
fn travel(postures: &[Posture], up: Up) -> f64 {
    let first = postures.first().map(|it| it.root).unwrap_or_default();
    let across = |posture: &Posture| {
        let way = sub(posture.root, first);
        let way = sub(way, scale(up.vector(), dot(way, up.vector())));
        dot(way, way).sqrt()
    };
    postures.iter().map(across).fold(0.0, f64::max)
}
