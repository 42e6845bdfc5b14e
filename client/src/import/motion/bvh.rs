//! BVH motions on the skeletons of people.
//!
//! Joints are matched by name ([`JointMap`]); those between matched ones are folded into them, so
//! that no motion is lost. A BVH file's rest pose is arbitrary, while a person's is a T-pose facing
//! +z: rotations are converted so that limbs have the file's directions. With global rotations G of
//! the file from a pose that stands ([`standing`]), and D the rotation that takes a limb of a T-pose to
//! the limb of that pose, G' = G · D, and the local rotation is (G'_parent)ᵀ · G'.

use super::super::geometry::{
    IDENTITY, Mat3, Vec3, about_axis, add, apply, axis_angle, between, mul, sub, transpose,
};
use super::super::source::Source;
use super::standing::{self, Fallen, Reference};
use super::{JointMap, Motion, MotionFrame, MotionOptions, Up};
use crate::api::ClientError;
use yoto_formats::bvh::{self, Bvh, Channel, Joint};
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
    if !kept.is_one_tree() {
        let message = format!(
            "its root '{}' matches no joint of a person, nor is there a joint that matches the pelvis \
             and has all other matched joints below it: name it in a joint map (--joint-map)",
            names.first().map_or("", String::as_str)
        );
        return Err(source.fault("NO_MATCH", name, None, "ROOT", message));
    }
    let reference = standing::reference(&file, &kept, options.up).map_err(|fallen| {
        let message = match fallen {
            Fallen::NeverStands => {
                "the rest pose is not a standing person, and no frame shows one: a frame that stands \
                 with straight legs is needed to tell how the bones lie in a body"
            }
            Fallen::NeverUpright => {
                "the spine is upright in no frame: give the axis that is up (--up), if the person lies"
            }
        };
        source.fault("NOT_STANDING", name, None, "MOTION", message)
    })?;
    let upright = reference.up.to_y();
    let rest = kept.places(&reference.placed, &upright);
    let facing = facing(&kept, &rest);
    let rest: Vec<Vec3> = rest.iter().map(|place| apply(&facing, *place)).collect();
    let turns = kept.turns(&rest);
    let frames = file.frames.iter().map(|row| {
        let placed = Placed::of(&file, &kept, row);
        // From the turned reference to the upright world.
        let turned = |at: &usize| {
            let of = |placed: &Placed| placed.rotations.get(*at).copied().unwrap_or(IDENTITY);
            let rotation = mul(&of(&placed), &transpose(&of(&reference.placed)));
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
            root: apply(&upright, kept.root(&placed)),
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
        notes: notes(&reference, options.up),
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
pub(super) struct Kept {
    names: Vec<String>,
    /// Indices in the file.
    pub source: Vec<usize>,
    /// Nearest matched ancestor, as an index among the kept joints.
    parents: Vec<Option<usize>>,
    /// Joints of the file from its root to the first kept one, whose positions move the person.
    /// Those of others only stretch the person.
    moving: Vec<usize>,
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
        let first = source.first().copied();
        Self {
            moving: std::iter::successors(first, |at| above(*at)).collect(),
            parents: source.iter().map(parent).collect(),
            names,
            source,
        }
    }

    /// Place of the first kept joint.
    fn root(&self, placed: &Placed) -> Vec3 {
        let place = self.source.first().and_then(|at| placed.places.get(*at));
        place.copied().unwrap_or_default()
    }

    /// Whether all kept joints are below the first one, and that one is the file's root or the
    /// pelvis. Some files have a root on the ground, above the hips.
    fn is_one_tree(&self) -> bool {
        let roots = self.parents.iter().filter(|parent| parent.is_none());
        let is_root = self.source.first() == Some(&0);
        let is_pelvis = self.names.first().is_some_and(|name| name == "pelvis");
        roots.count() == 1 && (is_root || is_pelvis)
    }

    pub fn find(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|other| other == name)
    }

    /// Positions of the joints, y up.
    fn places(&self, placed: &Placed, upright: &Mat3) -> Vec<Vec3> {
        let place = |at: &usize| placed.places.get(*at).copied().unwrap_or_default();
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

/// A file's joints in a pose, in the file's axes.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    /// Global rotations.
    pub rotations: Vec<Mat3>,
    pub places: Vec<Vec3>,
}

impl Placed {
    /// The rest pose: all rotations zero, each joint where its offset says.
    pub fn rest(file: &Bvh) -> Self {
        Self::with(file, |_, joint| (joint.offset, IDENTITY))
    }

    /// The frame with the channel values `row`.
    pub fn of(file: &Bvh, kept: &Kept, row: &[f64]) -> Self {
        let mut values = row.iter().copied();
        Self::with(file, |at, joint| {
            let (mut place, mut local) = (joint.offset, IDENTITY);
            for channel in &joint.channels {
                let value = values.next().unwrap_or_default();
                match channel {
                    Channel::Rotation(axis) => local = mul(&local, &about_axis(*axis, value)),
                    Channel::Position(axis) if kept.moving.contains(&at) => place[*axis] = value,
                    Channel::Position(_) => {}
                }
            }
            (place, local)
        })
    }

    /// Every joint with the position and rotation from its parent that `local` gives.
    fn with(file: &Bvh, mut local: impl FnMut(usize, &Joint) -> (Vec3, Mat3)) -> Self {
        let count = file.joints.len();
        let (mut rotations, mut places) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for (at, joint) in file.joints.iter().enumerate() {
            let (place, rotation) = local(at, joint);
            let above = |parent: usize| Some((*rotations.get(parent)?, *places.get(parent)?));
            let (turn, from) = (joint.parent.and_then(above)).unwrap_or((IDENTITY, [0.0; 3]));
            places.push(add(from, apply(&turn, place)));
            rotations.push(mul(&turn, &rotation));
        }
        Self { rotations, places }
    }
}

/// What was assumed of a file.
fn notes(reference: &Reference, asked: Option<Up>) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some(frame) = reference.frame {
        notes.push(format!(
            "the rest pose is not a standing person: frame {frame}, which is, serves in its place"
        ));
    }
    if reference.up == Up::Z && asked.is_none() {
        notes.push("z is up: the spine is, in the motion (--up)".into());
    }
    notes
}
