//! The pose of a BVH file that shows a standing person.
//!
//! With all rotations zero, some writers' skeletons stand, and others' have every bone along +x. Only a
//! standing one says how the file's axes lie in a person: where the rest pose does not stand, the
//! most upright frame of the motion serves. A lean of the back in that frame is lost.

use super::Up;
use super::kept::Kept;
use crate::geometry::{Mat3, Vec3, dot, matvec, sub};
use crate::tree::Placed;
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

/// A pose that stands.
pub(super) struct Reference {
    /// Frame of the motion; `None`: the rest pose itself.
    pub frame: Option<usize>,
    /// Which axis is up.
    pub up: Up,
    /// The pose, in the file's axes.
    pub placed: Placed,
}

/// Why no pose of a file stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fallen {
    /// Neither the rest pose nor a frame stands.
    NeverStands,
    /// The spine is upright in no frame.
    NeverUpright,
}

/// The rest pose of `file` if it stands, else the most upright frame. The up axis is `up`, or the one
/// with which the rest pose stands and the person is upright in the motion, or the one with which they
/// are upright in more frames.
pub(super) fn reference(file: &Bvh, kept: &Kept, up: Option<Up>) -> Result<Reference, Fallen> {
    let step = file.frames.len().div_ceil(LOOKED_AT).max(1);
    let frames = file.frames.iter().enumerate().step_by(step);
    let frames: Vec<(usize, Placed)> = frames
        .map(|(at, row)| (at, kept.frame(file, row)))
        .collect();
    let rest = kept.rest(file);
    let view = |up: Up| View::new(kept, up, &rest, &frames);
    let view = match up {
        // A given axis is not checked: the person may lie in the motion.
        Some(up) => view(up),
        None => {
            let [y, z] = [view(Up::Y), view(Up::Z)];
            let stands = |it: &View| it.rest_stands;
            match (stands(&y), stands(&z)) {
                (true, _) => y,
                (false, true) => z,
                (false, false) if z.upright() > y.upright() => z,
                (false, false) => y,
            }
        }
    };
    if up.is_none() && view.upright() == 0 {
        return Err(Fallen::NeverUpright);
    }
    if view.rest_stands {
        return Ok(Reference {
            frame: None,
            up: view.up,
            placed: rest,
        });
    }
    let best = view.stances.iter().zip(&frames);
    let best = best.max_by(|(a, _), (b, _)| a.least().total_cmp(&b.least()));
    match best {
        Some((stance, (at, placed))) if stance.stands() => Ok(Reference {
            frame: Some(*at),
            up: view.up,
            placed: placed.clone(),
        }),
        _ => Err(Fallen::NeverStands),
    }
}

/// A motion with one axis up.
struct View {
    up: Up,
    rest_stands: bool,
    /// Of each frame.
    stances: Vec<Stance>,
}

impl View {
    fn new(kept: &Kept, up: Up, rest: &Placed, frames: &[(usize, Placed)]) -> Self {
        let stance = |placed: &Placed| Stance::of(kept, placed, &up.to_y());
        Self {
            up,
            rest_stands: stance(rest).stands(),
            stances: frames.iter().map(|(_, placed)| stance(placed)).collect(),
        }
    }

    /// Number of frames whose spine is upright.
    fn upright(&self) -> usize {
        let upright = |it: &&Stance| it.spine >= UPRIGHT;
        self.stances.iter().filter(upright).count()
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
    fn of(kept: &Kept, placed: &Placed, to_y: &Mat3) -> Self {
        let position =
            |name: &str| -> Option<Vec3> { Some(matvec(to_y, kept.tree.position(placed, name)?)) };
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
