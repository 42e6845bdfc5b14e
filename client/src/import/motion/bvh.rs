//! BVH motions on the skeletons of people.
//!
//! Joints are matched by name ([`JointMap`]); those between matched ones are folded into them, so
//! that no motion is lost. A BVH file's rest pose is arbitrary, while a person's is a T-pose facing
//! +z: rotations are converted so that limbs have the file's directions, by (with global rotations G of the file, and D the rotation that takes a limb of a
//! T-pose to the file's limb at rest) G' = G · D, local rotation = (G'_parent)ᵀ · G'.

use super::super::geometry::{
    IDENTITY, Mat3, Vec3, about_axis, add, apply, axis_angle, between, mul, sub, transpose,
};
use super::super::source::Source;
use super::{JointMap, Motion, MotionFrame, MotionOptions, Up};
use crate::api::ClientError;
use std::f64::consts::FRAC_PI_2;
use yoto_formats::bvh::{self, Bvh, Channel};
use yoto_proto::pose_track::Skeleton;

/// Limbs, from one joint to the next, and their directions in a T-pose.
const LIMBS: [(&str, &str, Vec3); 8] = [
    ("l_shoulder", "l_elbow", [1.0, 0.0, 0.0]),
    ("l_elbow", "l_wrist", [1.0, 0.0, 0.0]),
    ("r_shoulder", "r_elbow", [-1.0, 0.0, 0.0]),
    ("r_elbow", "r_wrist", [-1.0, 0.0, 0.0]),
    ("l_hip", "l_knee", [0.0, -1.0, 0.0]),
    ("l_knee", "l_ankle", [0.0, -1.0, 0.0]),
    ("r_hip", "r_knee", [0.0, -1.0, 0.0]),
    ("r_knee", "r_ankle", [0.0, -1.0, 0.0]),
];
/// Joints without a limb, which continue the direction of the previous one.
const FOLLOW: [&str; 4] = ["l_wrist", "r_wrist", "l_hand", "r_hand"];
/// Pairs that define left.
const SIDES: [(&str, &str); 2] = [("l_hip", "r_hip"), ("l_shoulder", "r_shoulder")];

pub(super) fn read(
    source: &Source,
    name: &str,
    options: &MotionOptions,
) -> Result<Motion, ClientError> {
    let bytes = source.bytes(name, None)?;
    let file = bvh::read(&String::from_utf8_lossy(&bytes)).map_err(|error| {
        let field = format!("line {}", error.line);
        source.fault("UNREADABLE", name, None, field, error.message)
    })?;
    let names: Vec<String> = file.joints.iter().map(|joint| joint.name.clone()).collect();
    let map = JointMap::open(options.joint_map.as_deref())?;
    let kept = Kept::new(&file, map.matches(&names));
    if kept.source.first() != Some(&0) {
        let message = format!(
            "its root '{}' matches no joint of a person: name it in a joint map (--joint-map)",
            names.first().map_or("", String::as_str)
        );
        return Err(source.fault("NO_MATCH", name, None, "ROOT", message));
    }
    let upright = match options.up {
        Some(Up::Z) => about_axis(0, -FRAC_PI_2),
        Some(Up::Y) | None => IDENTITY,
    };
    let rest = kept.rest(&file, &upright);
    let facing = facing(&kept, &rest);
    let rest: Vec<Vec3> = rest.iter().map(|place| apply(&facing, *place)).collect();
    let turns = kept.turns(&rest);
    let frames = file.frames.iter().map(|row| {
        let (rotations, root) = world(&file, row);
        // From the turned rest pose to the upright world.
        let turned = |at: &usize| {
            let rotation = rotations.get(*at).copied().unwrap_or(IDENTITY);
            let standing = mul(&mul(&upright, &rotation), &transpose(&upright));
            mul(&standing, &transpose(&facing))
        };
        let global: Vec<Mat3> = kept
            .source
            .iter()
            .zip(&turns)
            .map(|(at, turn)| mul(&turned(at), turn))
            .collect();
        MotionFrame {
            rotations: kept.local(&global),
            root: apply(&upright, root),
        }
    });
    let pair = |(joint, at): (&String, &usize)| {
        let name = names.get(*at).cloned();
        (joint.clone(), name.unwrap_or_default())
    };
    let unmatched = names.iter().enumerate();
    let unmatched = unmatched.filter(|(at, _)| !kept.source.contains(at));
    Ok(Motion {
        frames: frames.collect(),
        fps: 1.0 / file.frame_time,
        matched: kept.names.iter().zip(&kept.source).map(pair).collect(),
        unmatched: unmatched.map(|(_, name)| name.clone()).collect(),
        notes: Vec::new(),
        skeleton: Skeleton {
            rest_joints: kept.t_pose(&rest, &turns),
            parents: kept
                .parents
                .iter()
                .map(|p| p.map_or(-1, |p| p as i32))
                .collect(),
            names: kept.names,
        },
    })
}

/// The matched joints of a file, in the file's order.
struct Kept {
    names: Vec<String>,
    /// Indices in the file.
    source: Vec<usize>,
    /// Nearest matched ancestor, as an index among the kept joints.
    parents: Vec<Option<usize>>,
}

impl Kept {
    fn new(file: &Bvh, mut matches: Vec<(String, usize)>) -> Self {
        matches.sort_by_key(|(_, at)| *at);
        let (names, source): (Vec<String>, Vec<usize>) = matches.into_iter().unzip();
        let above = |at: usize| file.joints.get(at).and_then(|joint| joint.parent);
        let parent = |&at: &usize| {
            let mut next = above(at);
            while let Some(place) = next {
                if let Some(found) = source.iter().position(|other| *other == place) {
                    return Some(found);
                }
                next = above(place);
            }
            None
        };
        Self {
            parents: source.iter().map(parent).collect(),
            names,
            source,
        }
    }

    fn find(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|other| other == name)
    }

    /// Positions of the joints at rest, y up.
    fn rest(&self, file: &Bvh, upright: &Mat3) -> Vec<Vec3> {
        let mut places: Vec<Vec3> = Vec::with_capacity(file.joints.len());
        for joint in &file.joints {
            let above = joint.parent.and_then(|parent| places.get(parent)).copied();
            places.push(add(above.unwrap_or_default(), joint.offset));
        }
        let place = |at: &usize| places.get(*at).copied().unwrap_or_default();
        self.source
            .iter()
            .map(|at| apply(upright, place(at)))
            .collect()
    }

    /// D of each joint.
    fn turns(&self, rest: &[Vec3]) -> Vec<Mat3> {
        let mut turns: Vec<Mat3> = Vec::with_capacity(self.names.len());
        for (at, name) in self.names.iter().enumerate() {
            let limb = LIMBS.iter().find(|(from, ..)| from == name);
            let limb = limb.and_then(|(_, to, direction)| {
                let end = rest.get(self.find(to)?).copied()?;
                between(*direction, sub(end, rest.get(at).copied()?))
            });
            let above = self.parents.get(at).copied().flatten();
            let before = above.and_then(|above| turns.get(above)).copied();
            turns.push(match limb {
                Some(turn) => turn,
                None if FOLLOW.contains(&name.as_str()) => before.unwrap_or(IDENTITY),
                None => IDENTITY,
            });
        }
        turns
    }

    /// Rest positions with the limbs in a T-pose.
    fn t_pose(&self, rest: &[Vec3], turns: &[Mat3]) -> Vec<Vec3> {
        let mut places: Vec<Vec3> = Vec::with_capacity(rest.len());
        for (at, place) in rest.iter().enumerate() {
            let Some(parent) = self.parents.get(at).copied().flatten() else {
                places.push(*place);
                continue;
            };
            let bone = sub(*place, rest.get(parent).copied().unwrap_or_default());
            let turn = transpose(&turns.get(parent).copied().unwrap_or(IDENTITY));
            let from = places.get(parent).copied().unwrap_or_default();
            places.push(add(from, apply(&turn, bone)));
        }
        places
    }

    fn local(&self, global: &[Mat3]) -> Vec<Vec3> {
        let parent = |at: usize| self.parents.get(at).copied().flatten();
        let local = |(at, rotation): (usize, &Mat3)| {
            let above = parent(at).and_then(|above| global.get(above));
            let above = above.copied().unwrap_or(IDENTITY);
            axis_angle(&mul(&transpose(&above), rotation))
        };
        global.iter().enumerate().map(local).collect()
    }
}

/// The rotation about the vertical that turns the rest pose's left to +x.
fn facing(kept: &Kept, rest: &[Vec3]) -> Mat3 {
    let left = SIDES.iter().find_map(|(left, right)| {
        let place = |name: &str| rest.get(kept.find(name)?).copied();
        let mut across = sub(place(left)?, place(right)?);
        across[1] = 0.0;
        (across[0].hypot(across[2]) > 1e-6).then_some(across)
    });
    match left {
        Some(left) => about_axis(1, left[2].atan2(left[0])),
        None => IDENTITY,
    }
}

/// Global rotations of a frame, in the file's axes, and the root's position.
fn world(file: &Bvh, row: &[f64]) -> (Vec<Mat3>, Vec3) {
    let mut values = row.iter().copied();
    let mut rotations: Vec<Mat3> = Vec::with_capacity(file.joints.len());
    let mut root = file.joints.first().map_or([0.0; 3], |joint| joint.offset);
    for (at, joint) in file.joints.iter().enumerate() {
        let mut local = IDENTITY;
        for channel in &joint.channels {
            let value = values.next().unwrap_or_default();
            match channel {
                Channel::Rotation(axis) => local = mul(&local, &about_axis(*axis, value)),
                // Other joints' positions only stretch them.
                Channel::Position(axis) if at == 0 => root[*axis] = value,
                Channel::Position(_) => {}
            }
        }
        let above = joint.parent.and_then(|parent| rotations.get(parent));
        rotations.push(match above {
            Some(above) => mul(above, &local),
            None => local,
        });
    }
    (rotations, root)
}
