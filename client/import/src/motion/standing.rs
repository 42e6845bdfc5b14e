//! The pose of a BVH file that shows a standing person.
//!
//! With all rotations zero, some writers' skeletons stand, and others' have every bone along +x. Only a
//! standing one says how the file's axes lie in a person: where the rest pose does not stand, the
//! most upright frame of the motion serves. A lean of the back in that frame is lost.

use super::kept::Kept;
use super::posture::Posture;
use super::up::{self, Up, Usual};
use crate::geometry::{Mat3, Vec3, dot, matvec, sub};
use crate::hierarchy::GlobalPose;
use yoto_formats::bvh::Bvh;

/// Cosine of the largest angle, 37°, between the vertical and the spine of a standing person.
const STANDING: f64 = 0.8;
/// Cosine of the largest angle, 60°, between the vertical and the spine of a person who does not lie, or
/// a thigh or a shin of a person who stands or walks.
const UPRIGHT: f64 = 0.5;
/// Frames looked at, at most, spread over the motion.
const LOOKED_AT: usize = 2000;
/// Parts of the legs, from one joint down to the first of the others that the file has.
const LEGS: [(&str, &[&str]); 4] = [
    ("l_hip", &["l_knee", "l_ankle", "l_foot"]),
    ("r_hip", &["r_knee", "r_ankle", "r_foot"]),
    ("l_knee", &["l_ankle", "l_foot"]),
    ("r_knee", &["r_ankle", "r_foot"]),
];
/// The upper end of the spine: the first that the file has.
const SPINE: [&str; 5] = ["neck", "head", "spine3", "spine2", "spine1"];

/// A standing pose.
pub(super) struct Reference {
    /// Frame of the motion; `None`: the rest pose itself.
    pub frame: Option<usize>,
    /// The axis that is up in the motion.
    pub up: Up,
    /// A note about the axis, if it differs from most files'.
    pub note: Option<String>,
    /// The pose, with y up.
    pub placed: GlobalPose,
}

/// Why no pose of a file stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Fallen {
    /// Neither the rest pose nor a frame stands.
    NeverStands,
    /// The motion does not tell which axis is up, in words.
    NotUpright(String),
}

/// The rest pose of `file` if it stands, else the most upright frame. The up axis is `up`, or the one along which the
/// person is upright in the motion, compared with the one along which the rest pose stands.
pub(super) fn reference(file: &Bvh, kept: &Kept, up: Option<Up>) -> Result<Reference, Fallen> {
    let step = file.frames.len().div_ceil(LOOKED_AT).max(1);
    let is_usable = |(_, row): &(usize, &Vec<f64>)| row.iter().all(|value| value.is_finite());
    let frames = file
        .frames
        .iter()
        .enumerate()
        .step_by(step)
        .filter(is_usable);
    let frames: Vec<(usize, GlobalPose)> = frames
        .map(|(at, row)| (at, kept.frame(file, row)))
        .collect();
    let rest = kept.rest(file);
    let rest_up = up::ALL
        .into_iter()
        .find(|up| Stance::of(kept, &rest, &up.to_y()).stands());
    let (up, note) = match up {
        // A given axis is not checked: the person may lie in the motion.
        Some(up) => (up, None),
        None => {
            let (up, note) = found_up(kept, &frames, rest_up)?;
            // Nearly all files are like this.
            let is_plain = up == Up::Y && rest_up == Some(Up::Y);
            (up, (!is_plain).then_some(note))
        }
    };
    if let Some(rest_up) = rest_up {
        return Ok(Reference {
            frame: None,
            up,
            note,
            placed: rest.rotated(&rest_up.to_y()),
        });
    }
    let stances = frames.iter();
    let stances = stances.map(|(at, placed)| (Stance::of(kept, placed, &up.to_y()), at, placed));
    let best = stances.max_by(|(a, ..), (b, ..)| a.least().total_cmp(&b.least()));
    match best {
        Some((stance, at, placed)) if stance.stands() => Ok(Reference {
            frame: Some(*at),
            up,
            note,
            placed: placed.rotated(&up.to_y()),
        }),
        _ => Err(Fallen::NeverStands),
    }
}

/// The axis that is up in the motion, and a note about it; the rest pose stands along `rest_up`.
fn found_up(
    kept: &Kept,
    frames: &[(usize, GlobalPose)],
    rest_up: Option<Up>,
) -> Result<(Up, String), Fallen> {
    let posture = |(_, placed): &(usize, GlobalPose)| {
        Posture::of(|name| kept.hierarchy.position(placed, name))
    };
    let usual = rest_up.map(|up| Usual {
        up,
        who: "the rest pose",
        is_documented: false,
    });
    if let Some(postures) = frames.iter().map(posture).collect::<Option<Vec<_>>>() {
        return up::find(&postures, usual).map_err(Fallen::NotUpright);
    }
    // A body without a head or legs has a spine at least.
    let upright = |up: Up| {
        let spines = frames
            .iter()
            .map(|(_, placed)| Stance::of(kept, placed, &up.to_y()).spine);
        spines.filter(|spine| *spine >= UPRIGHT).count()
    };
    let counts = up::ALL.map(|up| (upright(up), rest_up == Some(up), up));
    let of_rest = counts
        .into_iter()
        .find(|(count, is_rest, _)| *count > 0 && *is_rest);
    match of_rest.or_else(|| counts.into_iter().max_by_key(|(count, ..)| *count)) {
        Some((count, _, up)) if count > 0 => Ok((
            up,
            format!(
                "{up} is up: the spine is upright along it in {count} of {} frames (--up)",
                frames.len()
            ),
        )),
        _ => Err(Fallen::NotUpright(
            "the spine is upright in no frame: give the axis that is up (--up), if the person lies"
                .into(),
        )),
    }
}

/// Cosines between the vertical and parts of a body that are vertical when it stands; 1 for those
/// that a file lacks.
struct Stance {
    spine: f64,
    /// The least of both legs.
    legs: f64,
}

impl Stance {
    fn of(kept: &Kept, placed: &GlobalPose, to_y: &Mat3) -> Self {
        let position = |name: &str| -> Option<Vec3> {
            Some(matvec(to_y, kept.hierarchy.position(placed, name)?))
        };
        let rise = |from: &str, to: &[&str]| {
            let bone = sub(to.iter().find_map(|to| position(to))?, position(from)?);
            let length = dot(bone, bone).sqrt();
            (length > 0.0).then(|| bone[1] / length)
        };
        let legs = LEGS.iter().filter_map(|(from, to)| rise(from, to));
        Self {
            spine: rise("pelvis", &SPINE).unwrap_or(1.0),
            legs: legs.map(|rise| -rise).fold(1.0, f64::min),
        }
    }

    fn stands(&self) -> bool {
        self.spine >= STANDING && self.legs >= UPRIGHT
    }

    fn least(&self) -> f64 {
        self.spine.min(self.legs)
    }
}
