//! BVH motions on the skeletons of people.
//!
//! Joints are matched by name ([`JointMap`]); those between matched ones are folded into them, so
//! that no motion is lost. Or the file's own joints are kept, of which those below the wrists and the head
//! are folded into these: fingers and faces are too small for a person in a whole picture. A BVH
//! file's rest pose is arbitrary, while a person's is a T-pose facing +z: rotations are converted
//! ([`hierarchy`]) by means of a pose that stands ([`standing`]).

use super::kept::{self, Kept};
use super::standing::{self, Fallen, Reference};
use super::{JointMap, Motion, MotionFrame, MotionOptions, Up, gaps};
use crate::source::Source;
use crate::{ImportError, hierarchy};
use yoto_formats::bvh;

pub(super) fn read(
    source: &Source,
    name: &str,
    options: &MotionOptions,
) -> Result<Motion, ImportError> {
    read_up(source, name, options).map(|(motion, _)| motion)
}

/// The motion, and the axis of the file that is up.
pub(crate) fn read_up(
    source: &Source,
    name: &str,
    options: &MotionOptions,
) -> Result<(Motion, Up), ImportError> {
    let bytes = source.bytes(name, None)?;
    let file = bvh::read(&String::from_utf8_lossy(&bytes)).map_err(|error| {
        let field = format!("line {}", error.line);
        source.fault("UNREADABLE", name, None, field, error.message)
    })?;
    let names: Vec<String> = file.joints.iter().map(|joint| joint.name.clone()).collect();
    let map = JointMap::open(options.joint_map.as_deref())?;
    let matches = kept::rooted(&file, map.matches(&names));
    let kept = match options.keep_skeleton {
        true => Kept::own(&file, matches),
        false => Kept::matched(&file, matches),
    };
    if !kept.has_one_root() {
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
                    .to_owned()
            }
            Fallen::NotUpright(message) => message,
        };
        source.fault("NOT_STANDING", name, None, "MOTION", message)
    })?;
    let upright = reference.up.to_y();
    let standing = kept.hierarchy.retarget(&reference.placed);
    let mut notes = notes(&file, &reference, &kept, &names);
    let frames = file.frames.iter().map(|row| {
        let placed = kept.frame(&file, row).rotated(&upright);
        let mut rotations = standing.local_rotations(&placed.rotations);
        // Rotations of numbers that are not finite may be finite.
        if let Some(joint) = kept.not_finite(&file, row) {
            rotations[joint] = [f64::NAN; 3];
        }
        MotionFrame {
            rotations,
            root: placed.positions.first().copied().unwrap_or_default(),
        }
    });
    let (frames, fps) = gaps::closed(
        frames.collect(),
        1.0 / file.frame_time,
        &kept.hierarchy,
        &mut notes,
    )
    .map_err(|message| source.fault("NOT_FINITE", name, None, "MOTION", message))?;
    let pair = |(joint, at): (&hierarchy::Joint, &usize)| {
        let name = names.get(*at).cloned();
        (joint.name.clone(), name.unwrap_or_default())
    };
    let unmatched = names.iter().enumerate();
    let unmatched = unmatched.filter(|(at, _)| !kept.source.contains(at));
    let motion = Motion {
        frames,
        fps,
        matched: kept
            .hierarchy
            .0
            .iter()
            .zip(&kept.source)
            .map(pair)
            .collect(),
        unmatched: unmatched.map(|(_, name)| name.clone()).collect(),
        notes,
        skeleton: standing.skeleton(1.0),
    };
    Ok((motion, reference.up))
}

/// A limb moves as a whole only with these joints.
const LIMBS: [&str; 8] = [
    "l_hip",
    "r_hip",
    "l_knee",
    "r_knee",
    "l_shoulder",
    "r_shoulder",
    "l_elbow",
    "r_elbow",
];
/// A note names at most this number of joints.
const NAMED: usize = 6;

/// Notes about assumptions, and about joints that the motion lacks.
fn notes(file: &bvh::Bvh, reference: &Reference, kept: &Kept, names: &[String]) -> Vec<String> {
    let mut notes = file.notes.clone();
    notes.extend(reference.frame.map(|frame| {
        format!(
            "the rest pose is not a standing person: frame {frame}, which is, serves in its place"
        )
    }));
    notes.extend(reference.note.clone());
    let still: Vec<&str> = LIMBS
        .into_iter()
        .filter(|joint| kept.hierarchy.find(joint).is_none())
        .collect();
    if !still.is_empty() {
        let others = names
            .iter()
            .enumerate()
            .filter(|(at, _)| !kept.source.contains(at));
        let others: Vec<&str> = others.map(|(_, name)| &**name).take(NAMED).collect();
        notes.push(format!(
            "nothing in the file moves {}, which stay as they are at rest; joints of other names: {} (--joint-map)",
            still.join(", "),
            if others.is_empty() { "none".to_owned() } else { others.join(", ") }
        ));
    }
    notes
}
