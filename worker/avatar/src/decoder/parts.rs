//! Places on the body that correspond between people: the part of the body, how far along it, and on which side. They are
//! those of SMPL's joints in the rest pose; other skeletons have none.

use std::f32::consts::TAU;
use yoto_body::{hand_of, is_of_face};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::smpl::has_joints;
use yoto_proto::smpl::JOINTS;

/// Number of parts: trunk, head, and for the left and the right side each: upper arm, forearm, hand, thigh, shin, foot.
pub(crate) const PARTS: usize = 14;
const TRUNK: usize = 0;
const HEAD: usize = 1;
/// The left hand; the right one is the next.
const HAND: usize = 6;
/// Joints at the ends of the parts of the left limbs; the right side's is the next in SMPL's order.
const LIMBS: [[&str; 2]; 6] = [
    ["l_shoulder", "l_elbow"],
    ["l_elbow", "l_wrist"],
    ["l_wrist", "l_hand"],
    ["l_hip", "l_knee"],
    ["l_knee", "l_ankle"],
    ["l_ankle", "l_foot"],
];
/// The part of each of SMPL's joints, by what moves with it.
const PART_OF: [usize; 24] = [
    0, 8, 9, 0, 10, 11, 0, 12, 13, 0, 12, 13, 1, 0, 0, 1, 2, 3, 4, 5, 6, 7, 6, 7,
];
/// Height of the head above the neck as a share of that of the head's joint above the hips.
const CROWN: f32 = 0.25 / 0.6;

/// Length below which a vector has no direction, metres.
const LEAST: f32 = 1e-4;

/// A place on the body of any person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BodyPlace {
    pub part: usize,
    /// 0 at the first joint of the part, 1 at the last, and beyond both.
    pub along: f32,
    /// Angle around the part, 0 at the front (a foot's top) and a quarter at the outer side (the trunk's left), revolutions,
    /// 0 to 1.
    pub around: f32,
}

/// The parts of one person's body in the rest pose.
pub(crate) struct Parts {
    axes: [Axis; PARTS],
}

/// The middle line of a part.
#[derive(Clone, Copy, Debug)]
struct Axis {
    start: [f32; 3],
    /// Unit vector.
    along: [f32; 3],
    /// Metres.
    length: f32,
    /// Unit vectors across: to the front and to the outer side.
    front: [f32; 3],
    outer: [f32; 3],
}

impl Parts {
    /// The parts of a skeleton with SMPL's joints; `None` for others, and where joints coincide.
    pub(crate) fn of(skeleton: &Skeleton) -> Option<Self> {
        if !has_joints(skeleton) {
            return None;
        }
        let joint = |index: usize| skeleton.rest[index].map(|v| v as f32);
        let middle = |a: usize, b: usize| -> [f32; 3] {
            let (a, b) = (joint(a), joint(b));
            std::array::from_fn(|i| 0.5 * (a[i] + b[i]))
        };
        let (root, neck, head) = (joint(0), joint(12), joint(15));
        let (hips, shoulders) = (middle(1, 2), middle(16, 17));
        let mut ends = [[[0.0; 3]; 2]; PARTS];
        ends[TRUNK] = [
            [0.0, hips[1], 0.5 * (hips[2] + root[2])],
            [0.0, shoulders[1], shoulders[2]],
        ];
        ends[HEAD] = [
            neck,
            [neck[0], neck[1] + CROWN * (head[1] - hips[1]), head[2]],
        ];
        let index = |name: &str| JOINTS.iter().position(|(joint, _)| *joint == name);
        for (limb, names) in LIMBS.iter().enumerate() {
            for side in 0..2 {
                let [Some(start), Some(end)] = names.map(index) else {
                    return None;
                };
                ends[2 + 2 * limb + side] = [joint(start + side), joint(end + side)];
            }
        }
        let mut axes = [None; PARTS];
        for (part, (axis, ends)) in axes.iter_mut().zip(ends).enumerate() {
            *axis = Axis::new(part, ends);
        }
        let axes: Option<Vec<Axis>> = axes.into_iter().collect();
        Some(Self {
            axes: axes?.try_into().ok()?,
        })
    }

    /// The part that the joint belongs to.
    pub(crate) fn part(joint: usize) -> usize {
        let of_others = || match u8::try_from(joint).map(|it| (hand_of(it), is_of_face(it))) {
            Ok((Some(side), _)) => HAND + side,
            Ok((None, true)) => HEAD,
            _ => TRUNK,
        };
        PART_OF.get(joint).copied().unwrap_or_else(of_others)
    }

    /// The part on the other side of the body.
    pub(crate) fn other(part: usize) -> usize {
        match part {
            TRUNK | HEAD => part,
            _ => part ^ 1,
        }
    }

    /// Unit vector along a part.
    pub(crate) fn along(&self, part: usize) -> [f32; 3] {
        self.axes[part].along
    }

    /// The place of a point of the rest pose, metres, that the `joint` moves.
    pub(crate) fn place(&self, point: [f32; 3], joint: usize) -> BodyPlace {
        let part = Self::part(joint);
        let axis = &self.axes[part];
        let off = minus(point, axis.start);
        let (front, outer) = (dot(off, axis.front), dot(off, axis.outer));
        BodyPlace {
            part,
            along: dot(off, axis.along) / axis.length,
            around: (outer.atan2(front) / TAU).rem_euclid(1.0),
        }
    }
}

impl Parts {
    /// How far a point is from the middle line of its part, metres, and the unit vector from there to it.
    pub(crate) fn across(&self, point: [f32; 3], joint: usize) -> (f32, [f32; 3]) {
        let axis = &self.axes[Self::part(joint)];
        let off = minus(point, axis.start);
        let along = dot(off, axis.along);
        let across: [f32; 3] = std::array::from_fn(|i| off[i] - along * axis.along[i]);
        let distance = dot(across, across).sqrt();
        (distance, across.map(|v| v / distance.max(1e-9)))
    }
}

impl Axis {
    /// `None` if the ends coincide.
    fn new(part: usize, [start, end]: [[f32; 3]; 2]) -> Option<Self> {
        let off = minus(end, start);
        let length = dot(off, off).sqrt();
        if length.is_nan() || length <= LEAST {
            return None;
        }
        let along = off.map(|v| v / length);
        let is_foot = part >= PARTS - 2;
        let ahead = if is_foot {
            [0.0, 1.0, 0.0]
        } else {
            [0.0, 0.0, 1.0]
        };
        let lean = dot(ahead, along);
        let across: [f32; 3] = std::array::from_fn(|i| ahead[i] - lean * along[i]);
        let wide = dot(across, across).sqrt();
        // A limb that points straight ahead has no front.
        if wide <= LEAST {
            return None;
        }
        let front = across.map(|v| v / wide);
        let outer = [
            along[1] * front[2] - along[2] * front[1],
            along[2] * front[0] - along[0] * front[2],
            along[0] * front[1] - along[1] * front[0],
        ];
        let is_right = part > HEAD && part % 2 == 1;
        Some(Self {
            start,
            along,
            length,
            front,
            outer: if is_right { outer.map(|v| -v) } else { outer },
        })
    }
}

fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_capture::skeleton::smpl::AVERAGE_REST;

    fn average() -> Skeleton {
        Skeleton {
            names: JOINTS.map(|(name, _)| name.to_owned()).to_vec(),
            parents: JOINTS.map(|(_, parent)| parent).to_vec(),
            rest: AVERAGE_REST.to_vec(),
        }
    }

    fn joint(name: &str) -> usize {
        let found = JOINTS.iter().position(|(joint, _)| *joint == name);
        found.expect("a joint of SMPL")
    }

    #[test]
    fn places_of_both_sides_mirror_each_other() {
        let parts = Parts::of(&average()).expect("SMPL's joints");
        for (left, right) in [
            ("l_elbow", "r_elbow"),
            ("l_knee", "r_knee"),
            ("l_foot", "r_foot"),
        ] {
            let (left, right) = (joint(left), joint(right));
            let [x, y, z] = AVERAGE_REST[left].map(|v| v as f32);
            let on_left = parts.place([x + 0.03, y + 0.01, z + 0.02], left);
            let on_right = parts.place([-x - 0.03, y + 0.01, z + 0.02], right);
            assert_eq!(Parts::other(on_left.part), on_right.part);
            assert!((on_left.along - on_right.along).abs() < 1e-4);
            assert!(
                (on_left.around - on_right.around).abs() < 1e-4,
                "{on_left:?} {on_right:?}"
            );
        }
        let spine = joint("spine2");
        let [left, right] = [0.1, -0.1].map(|x| parts.place([x, 1.2, 0.05], spine));
        assert!(
            (left.around + right.around - 1.0).abs() < 1e-4,
            "{left:?} {right:?}"
        );
    }

    #[test]
    fn a_place_is_the_same_on_a_body_of_another_size() {
        let parts = Parts::of(&average()).expect("SMPL's joints");
        let mut tall = average();
        tall.rest.iter_mut().flatten().for_each(|v| *v *= 1.2);
        let tall = Parts::of(&tall).expect("SMPL's joints");
        for (name, at) in [
            ("head", [0.02, 1.7, 0.09]),
            ("spine3", [0.1, 1.3, -0.1]),
            ("r_wrist", [-0.73, 1.4, 0.03]),
        ] {
            let (here, there) = (
                parts.place(at, joint(name)),
                tall.place(at.map(|v| 1.2 * v), joint(name)),
            );
            assert_eq!(here.part, there.part);
            assert!(
                (here.along - there.along).abs() < 1e-4
                    && (here.around - there.around).abs() < 1e-4
            );
        }
    }

    #[test]
    fn another_skeleton_has_no_such_places() {
        let mut other = average();
        other.names[3] = "belly".to_owned();
        assert!(Parts::of(&other).is_none());
        let mut flat = average();
        flat.rest[joint("l_knee")] = flat.rest[joint("l_hip")];
        assert!(Parts::of(&flat).is_none(), "a thigh without length");
    }
}
