//! BVH motions on the skeletons of people.
//!
//! Joints are matched by name ([`JointMap`]); those between matched ones are folded into them, so
//! that no motion is lost. Or the file's own joints are kept, of which those below the wrists and the head
//! are folded into these: fingers and faces are too small for a person in a whole picture. A BVH
//! file's rest pose is arbitrary, while a person's is a T-pose facing +z: rotations are converted
//! ([`tree`](crate::tree)) by means of a pose that stands ([`standing`]).

use super::super::geometry::{IDENTITY, Mat3, Vec3, about_axis, add, apply, mul};
use super::super::source::Source;
use super::super::tree::{self, Placed, Tree};
use super::standing::{self, Fallen, Reference};
use super::{JointMap, Motion, MotionFrame, MotionOptions, Up};
use yoto_client::ClientError;
use yoto_formats::bvh::{self, Bvh, Channel, Joint as FileJoint};

/// Joints of SMPL below which none of a file's own is kept.
const LAST: [&str; 3] = ["l_wrist", "r_wrist", "head"];

pub(super) fn read(
    source: &Source,
    name: &str,
    options: &MotionOptions,
) -> Result<Motion, ClientError> {
    read_up(source, name, options).map(|(motion, _)| motion)
}

/// The motion, and the axis of the file that is up.
pub(crate) fn read_up(
    source: &Source,
    name: &str,
    options: &MotionOptions,
) -> Result<(Motion, Up), ClientError> {
    let bytes = source.bytes(name, None)?;
    let file = bvh::read(&String::from_utf8_lossy(&bytes)).map_err(|error| {
        let field = format!("line {}", error.line);
        source.fault("UNREADABLE", name, None, field, error.message)
    })?;
    let names: Vec<String> = file.joints.iter().map(|joint| joint.name.clone()).collect();
    let map = JointMap::open(options.joint_map.as_deref())?;
    let matches = map.matches(&names);
    let kept = match options.keep_skeleton {
        true => Kept::own(&file, matches),
        false => Kept::matched(&file, matches),
    };
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
    let standing = kept.tree.standing(&reference.placed.turned(&upright));
    let frames = file.frames.iter().map(|row| {
        let placed = kept.frame(&file, row).turned(&upright);
        MotionFrame {
            rotations: standing.local(&placed.rotations),
            root: placed.places.first().copied().unwrap_or_default(),
        }
    });
    let pair = |(joint, at): (&tree::Joint, &usize)| {
        let name = names.get(*at).cloned();
        (joint.name.clone(), name.unwrap_or_default())
    };
    let unmatched = names.iter().enumerate();
    let unmatched = unmatched.filter(|(at, _)| !kept.source.contains(at));
    let motion = Motion {
        frames: frames.collect(),
        fps: 1.0 / file.frame_time,
        matched: kept.tree.0.iter().zip(&kept.source).map(pair).collect(),
        unmatched: unmatched.map(|(_, name)| name.clone()).collect(),
        notes: notes(&reference, options.up),
        skeleton: standing.skeleton(1.0),
    };
    Ok((motion, reference.up))
}

/// The joints of a file that are kept, in the file's order.
pub(super) struct Kept {
    pub tree: Tree,
    /// Indices in the file.
    source: Vec<usize>,
    /// Joints of the file from its root to the first kept one, whose positions move the person.
    /// Those of others only stretch the person.
    moving: Vec<usize>,
}

impl Kept {
    /// The joints that match SMPL's, called as those.
    fn matched(file: &Bvh, mut matches: Vec<(String, usize)>) -> Self {
        matches.sort_by_key(|(_, at)| *at);
        let joint = |(role, at): (String, usize)| (at, role.clone(), Some(role));
        Self::new(file, matches.into_iter().map(joint).collect())
    }

    /// The file's own joints from the one that matches the pelvis down, without those below [`LAST`].
    fn own(file: &Bvh, matches: Vec<(String, usize)>) -> Self {
        let role = |at: usize| {
            let found = matches.iter().find(|(_, place)| *place == at);
            found.map(|(role, _)| role.clone())
        };
        let place = |role: &str| matches.iter().find(|(of, _)| of == role).map(|(_, at)| *at);
        let first = place("pelvis").unwrap_or(0);
        let last: Vec<usize> = LAST.iter().filter_map(|role| place(role)).collect();
        let mut is_kept: Vec<bool> = Vec::with_capacity(file.joints.len());
        for (at, joint) in file.joints.iter().enumerate() {
            let above = joint.parent;
            let goes_on = above.is_some_and(|above| is_kept.get(above) == Some(&true));
            is_kept.push(at == first || goes_on && above.is_some_and(|it| !last.contains(&it)));
        }
        let kept = file.joints.iter().enumerate().zip(is_kept);
        let kept = kept.filter(|(_, is_kept)| *is_kept);
        let joint =
            |((at, joint), _): ((usize, &FileJoint), bool)| (at, joint.name.clone(), role(at));
        Self::new(file, kept.map(joint).collect())
    }

    /// Of joints with their places in the file, which rise, their names and roles.
    fn new(file: &Bvh, joints: Vec<(usize, String, Option<String>)>) -> Self {
        let source: Vec<usize> = joints.iter().map(|(at, ..)| *at).collect();
        let above = |at: usize| file.joints.get(at).and_then(|joint| joint.parent);
        // The nearest kept ancestor.
        let parent = |at: usize| {
            let mut ancestors = std::iter::successors(above(at), |at| above(*at));
            ancestors.find_map(|above| source.iter().position(|other| *other == above))
        };
        let joint = |(at, name, role)| tree::Joint {
            name,
            role,
            parent: parent(at),
        };
        let tree = Tree(joints.into_iter().map(joint).collect());
        let moving = std::iter::successors(source.first().copied(), |at| above(*at)).collect();
        Self {
            tree,
            source,
            moving,
        }
    }

    /// Whether all kept joints are below the first one, and that one is the file's root or the
    /// pelvis. Some files have a root on the ground, above the hips.
    fn is_one_tree(&self) -> bool {
        let roots = self.tree.0.iter().filter(|joint| joint.parent.is_none());
        let is_root = self.source.first() == Some(&0);
        roots.count() == 1 && (is_root || self.tree.find("pelvis") == Some(0))
    }

    /// The rest pose: all rotations zero, each joint where its offset says; in the file's axes, as all
    /// poses.
    pub fn rest(&self, file: &Bvh) -> Placed {
        self.posed(file, |_, joint| (joint.offset, IDENTITY))
    }

    /// The frame with the channel values `row`.
    pub fn frame(&self, file: &Bvh, row: &[f64]) -> Placed {
        let mut values = row.iter().copied();
        self.posed(file, |at, joint| {
            let (mut place, mut local) = (joint.offset, IDENTITY);
            for channel in &joint.channels {
                let value = values.next().unwrap_or_default();
                match channel {
                    Channel::Rotation(axis) => local = mul(&local, &about_axis(*axis, value)),
                    Channel::Position(axis) if self.moving.contains(&at) => place[*axis] = value,
                    Channel::Position(_) => {}
                }
            }
            (place, local)
        })
    }

    /// The kept joints, where every joint of the file has the position and rotation from its parent that
    /// `local` gives.
    fn posed(
        &self,
        file: &Bvh,
        mut local: impl FnMut(usize, &FileJoint) -> (Vec3, Mat3),
    ) -> Placed {
        let count = file.joints.len();
        let (mut rotations, mut places) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for (at, joint) in file.joints.iter().enumerate() {
            let (place, rotation) = local(at, joint);
            let above = |parent: usize| Some((*rotations.get(parent)?, *places.get(parent)?));
            let (turn, from) = (joint.parent.and_then(above)).unwrap_or((IDENTITY, [0.0; 3]));
            places.push(add(from, apply(&turn, place)));
            rotations.push(mul(&turn, &rotation));
        }
        Placed {
            rotations: self.source.iter().map(|at| rotations[*at]).collect(),
            places: self.source.iter().map(|at| places[*at]).collect(),
        }
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
