//! The joints of a BVH file that a motion keeps, and their poses.

use crate::geometry::{IDENTITY_ROTATION, Mat3, Vec3, about_axis, add, matmul, matvec};
use crate::hierarchy::{self, GlobalPose, JointHierarchy};
use yoto_formats::bvh::{Bvh, Channel, Joint as FileJoint};

/// No joints of the file are kept below these joints of SMPL.
const LAST: [&str; 3] = ["l_wrist", "r_wrist", "head"];

/// `matches` with the common ancestor of both legs and the back as the pelvis, if the file has no pelvis or one that is not above
/// them all (Daz has a pelvis of the legs alone, below its hip).
pub(super) fn rooted(file: &Bvh, mut matches: Vec<(String, usize)>) -> Vec<(String, usize)> {
    let above = |at: usize| file.joints.get(at).and_then(|joint| joint.parent);
    let line = |at: usize| std::iter::successors(Some(at), |at| above(*at)).collect::<Vec<_>>();
    let found = |role: &str| matches.iter().find(|(of, _)| of == role).map(|(_, at)| *at);
    let pelvis = found("pelvis");
    let is_above_all = |at: usize| matches.iter().all(|(_, other)| line(*other).contains(&at));
    if pelvis.is_some_and(is_above_all) {
        return matches;
    }
    let back = ["spine1", "spine2", "spine3", "neck", "head"]
        .iter()
        .find_map(|role| found(role));
    let (Some(left), Some(right), Some(back)) = (found("l_hip"), found("r_hip"), back) else {
        return matches;
    };
    let (right, back) = (line(right), line(back));
    let mut shared = line(left)
        .into_iter()
        .filter(|at| right.contains(at) && back.contains(at));
    let free = |at: &usize| {
        matches
            .iter()
            .all(|(role, other)| other != at || role == "pelvis")
    };
    if let Some(at) = shared.next().filter(free).filter(|at| {
        matches
            .iter()
            .all(|(role, other)| role == "pelvis" || line(*other).contains(at))
    }) {
        matches.retain(|(role, _)| role != "pelvis");
        matches.push(("pelvis".to_owned(), at));
    }
    matches
}

/// The joints of a file that are kept, in the file's order.
pub(super) struct Kept {
    pub hierarchy: JointHierarchy,
    /// Indices in the file.
    pub source: Vec<usize>,
    /// Joints of the file from its root to the first kept one, whose positions move the person.
    /// Positions of other joints only stretch the person.
    moving: Vec<usize>,
}

impl Kept {
    /// Keeps the joints that match SMPL's, with SMPL's names.
    pub(super) fn matched(file: &Bvh, mut matches: Vec<(String, usize)>) -> Self {
        matches.sort_by_key(|(_, at)| *at);
        let joint = |(role, at): (String, usize)| (at, role.clone(), Some(role));
        Self::new(file, matches.into_iter().map(joint).collect())
    }

    /// Keeps the file's own joints from the pelvis down, without those below [`LAST`].
    pub(super) fn own(file: &Bvh, matches: Vec<(String, usize)>) -> Self {
        let role = |at: usize| {
            let found = matches.iter().find(|(_, index)| *index == at);
            found.map(|(role, _)| role.clone())
        };
        let index = |role: &str| matches.iter().find(|(of, _)| of == role).map(|(_, at)| *at);
        let first = index("pelvis").unwrap_or(0);
        let last: Vec<usize> = LAST.iter().filter_map(|role| index(role)).collect();
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

    /// Keeps `joints`: their indices in the file, in ascending order, names and roles.
    fn new(file: &Bvh, joints: Vec<(usize, String, Option<String>)>) -> Self {
        let source: Vec<usize> = joints.iter().map(|(at, ..)| *at).collect();
        let above = |at: usize| file.joints.get(at).and_then(|joint| joint.parent);
        // The nearest kept ancestor.
        let parent = |at: usize| {
            let mut ancestors = std::iter::successors(above(at), |at| above(*at));
            ancestors.find_map(|above| source.iter().position(|other| *other == above))
        };
        let joint = |(at, name, role)| hierarchy::Joint {
            name,
            role,
            parent: parent(at),
        };
        let hierarchy = JointHierarchy(joints.into_iter().map(joint).collect());
        let moving = std::iter::successors(source.first().copied(), |at| above(*at)).collect();
        Self {
            hierarchy,
            source,
            moving,
        }
    }

    /// Whether all kept joints are below the first one, and that one is the file's root or the
    /// pelvis. Some files have a root on the ground, above the hips.
    pub(super) fn has_one_root(&self) -> bool {
        let roots = self
            .hierarchy
            .0
            .iter()
            .filter(|joint| joint.parent.is_none());
        let is_root = self.source.first() == Some(&0);
        roots.count() == 1 && (is_root || self.hierarchy.find("pelvis") == Some(0))
    }

    /// The kept joint that the first number of `row` that is not finite moves, or the nearest kept joint above.
    pub(super) fn not_finite(&self, file: &Bvh, row: &[f64]) -> Option<usize> {
        let at = row.iter().position(|value| !value.is_finite())?;
        let owners = file.joints.iter().enumerate();
        let mut owners = owners.flat_map(|(joint, it)| it.channels.iter().map(move |_| joint));
        let above = |at: usize| file.joints.get(at).and_then(|joint| joint.parent);
        let mut line = std::iter::successors(owners.nth(at), |at| above(*at));
        let kept = line.find_map(|at| self.source.iter().position(|other| *other == at));
        // What is above all kept joints moves the first.
        Some(kept.unwrap_or(0))
    }

    /// The rest pose: all rotations zero, each joint at its offset; in the file's axes, as all poses.
    pub(super) fn rest(&self, file: &Bvh) -> GlobalPose {
        self.posed(file, |_, joint| (joint.offset, IDENTITY_ROTATION))
    }

    /// The frame with the channel values `row`.
    pub(super) fn frame(&self, file: &Bvh, row: &[f64]) -> GlobalPose {
        let mut values = row.iter().copied();
        self.posed(file, |at, joint| {
            let (mut position, mut local) = (joint.offset, IDENTITY_ROTATION);
            for channel in &joint.channels {
                let value = values.next().unwrap_or_default();
                match channel {
                    Channel::Rotation(axis) => local = matmul(&local, &about_axis(*axis, value)),
                    Channel::Position(axis) if self.moving.contains(&at) => position[*axis] = value,
                    Channel::Position(_) => {}
                }
            }
            (position, local)
        })
    }

    /// The pose of the kept joints; `local` gives each joint's position and rotation relative to its parent.
    fn posed(
        &self,
        file: &Bvh,
        mut local: impl FnMut(usize, &FileJoint) -> (Vec3, Mat3),
    ) -> GlobalPose {
        let count = file.joints.len();
        let (mut rotations, mut positions) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for (at, joint) in file.joints.iter().enumerate() {
            let (position, rotation) = local(at, joint);
            let above = |parent: usize| Some((*rotations.get(parent)?, *positions.get(parent)?));
            let (turn, from) =
                (joint.parent.and_then(above)).unwrap_or((IDENTITY_ROTATION, [0.0; 3]));
            positions.push(add(from, matvec(&turn, position)));
            rotations.push(matmul(&turn, &rotation));
        }
        GlobalPose {
            rotations: self.source.iter().map(|at| rotations[*at]).collect(),
            positions: self.source.iter().map(|at| positions[*at]).collect(),
        }
    }
}
