//! Rest joints: the user's, those that the tool's own joints give, or an average adult's.
//!
//! A tool that writes posed joints p and rotations tells its skeleton without a body model: a bone's
//! rest offset is the median over frames of `G_parentᵀ (p_j − p_parent)`.

use super::found::{PoseEstimate, TrackedPerson};
use super::reading::{Documented, SmplVariant};
use crate::clip::fault;
use crate::geometry::{Mat3, Vec3, add, dot, matmul, matvec, rodrigues, scale, sub, transpose};
use crate::rest_joints::RestJoints;
use crate::track::{SmplPose, median_rows};
use crate::{ImportError, Options};
use std::path::Path;
use yoto_capture::skeleton::smpl::{ASSUMED_HEIGHT, AVERAGE_HEIGHT, AVERAGE_REST};
use yoto_proto::smpl::JOINTS;

/// Most frames that measure a skeleton.
const MOST: usize = 200;

/// The pelvis of a body model at rest, from its origin, within a few centimetres for any shape.
fn pelvis_of(body: SmplVariant) -> Vec3 {
    match body {
        SmplVariant::Smpl => [0.0, -0.22, 0.03],
        SmplVariant::SmplX => [0.0, -0.35, 0.01],
    }
}

/// A skeleton at rest.
#[derive(Debug)]
pub(crate) struct Rest {
    /// 24, metres.
    pub joints: Vec<Vec3>,
    /// Whether the lengths of bones are this person's, rather than an average's.
    pub is_measured: bool,
    /// The user's, which give each frame's shape its pelvis.
    given: Option<RestJoints>,
    /// The pelvis at rest where no frame tells it.
    pelvis: Vec3,
}

impl Rest {
    /// The skeleton of `person`, with a note about its source.
    ///
    /// # Errors
    /// When the user's file can't be read, or joints say that left and right are exchanged.
    pub(crate) fn find(
        options: &Options,
        tool: &Documented,
        person: &TrackedPerson,
        at: &Path,
        notes: &mut Vec<String>,
    ) -> Result<Self, ImportError> {
        let betas: Vec<&[f64]> = person.seen.iter().map(|seen| &*seen.betas).collect();
        let betas = median_rows(&betas);
        let body = tool.body;
        if let Some(given) = RestJoints::find(options)? {
            let of = given.is_smplx().map(|is| {
                if is {
                    SmplVariant::SmplX
                } else {
                    SmplVariant::Smpl
                }
            });
            let is_other = of.is_some_and(|of| of != body);
            if let Some(of) = of.filter(|_| is_other) {
                notes.push(format!(
                    "{} writes shapes of {}, the body model is {}: its mean shape is taken, and the \
                     pelvis is off by some centimetres (a copy of {} makes it exact)",
                    tool.tool,
                    body.name(),
                    of.name(),
                    body.name()
                ));
            }
            let joints = given.joints(if is_other { &[] } else { &betas });
            let pelvis = match joints.first() {
                Some(pelvis) if !is_other => *pelvis,
                _ => pelvis_of(body),
            };
            return Ok(Self {
                joints,
                is_measured: true,
                given: (!is_other).then_some(given),
                pelvis,
            });
        }
        let height = options.height.unwrap_or(ASSUMED_HEIGHT);
        let offsets = average(height);
        if let Some(joints) = measured(person, &offsets, at)? {
            notes.push(
                "rest joints are measured from the joints that the tool wrote: no body model is needed"
                    .to_owned(),
            );
            let pelvis = joints.first().copied().unwrap_or_default();
            return Ok(Self {
                joints,
                is_measured: true,
                given: None,
                pelvis,
            });
        }
        notes.push(format!(
            "no body model (--smpl) and no joints in the file: rest joints are an average adult's, {height:.2} \
             m tall{}",
            if options.height.is_some() {
                ""
            } else {
                " before they are fitted to masks (--height)"
            }
        ));
        let pelvis = pelvis_of(body);
        Ok(Self {
            joints: joints_of(&offsets, pelvis),
            is_measured: options.height.is_some(),
            given: None,
            pelvis,
        })
    }

    /// The pelvis at rest in the shape of `seen`.
    pub(crate) fn pelvis(&self, seen: &PoseEstimate) -> Vec3 {
        if let Some(given) = &self.given {
            return given
                .joints(&seen.betas)
                .first()
                .copied()
                .unwrap_or(self.pelvis);
        }
        let own = seen.joints.iter().find(|(joint, _)| *joint == 0);
        own.map_or(self.pelvis, |(_, position)| *position)
    }

    /// This skeleton with bones `by` times as long.
    pub(crate) fn scale(&mut self, by: f64) {
        let root = self.joints.first().copied().unwrap_or_default();
        for joint in &mut self.joints {
            *joint = add(root, scale(sub(*joint, root), by));
        }
    }
}

/// Global rotations of a pose.
fn globals(pose: &SmplPose) -> Vec<Mat3> {
    let (axes, _) = pose.as_chunks::<3>();
    let mut all: Vec<Mat3> = Vec::with_capacity(axes.len());
    for ((_, parent), axis) in JOINTS.iter().zip(axes) {
        let local = rodrigues(*axis);
        let above = parent.and_then(|parent| all.get(parent));
        all.push(above.map_or(local, |above| matmul(above, &local)));
    }
    all
}

/// The joints of a body.
pub(crate) fn posed(rest: &[Vec3], pose: &SmplPose, root: Vec3) -> Vec<Vec3> {
    let rotations = globals(pose);
    let mut positions = Vec::with_capacity(rest.len());
    for (joint, (_, parent)) in JOINTS.iter().enumerate() {
        let position = parent.and_then(|parent| {
            let offset = sub(*rest.get(joint)?, *rest.get(parent)?);
            Some(add(
                *positions.get(parent)?,
                matvec(rotations.get(parent)?, offset),
            ))
        });
        positions.push(position.unwrap_or(root));
    }
    positions
}

/// Offsets from the parent of an average adult of `height`.
fn average(height: f64) -> Vec<Vec3> {
    let offset = |(joint, (_, parent)): (usize, &(&str, Option<usize>))| {
        let above = parent.and_then(|parent| AVERAGE_REST.get(parent));
        let position = AVERAGE_REST.get(joint).copied().unwrap_or_default();
        above.map_or([0.0; 3], |above| {
            scale(sub(position, *above), height / AVERAGE_HEIGHT)
        })
    };
    JOINTS.iter().enumerate().map(offset).collect()
}

/// Joints with `offsets` from their parents.
fn joints_of(offsets: &[Vec3], pelvis: Vec3) -> Vec<Vec3> {
    let mut joints: Vec<Vec3> = Vec::with_capacity(offsets.len());
    for ((_, parent), offset) in JOINTS.iter().zip(offsets) {
        let above = parent.and_then(|parent| joints.get(parent).copied());
        joints.push(above.map_or(pelvis, |above| add(above, *offset)));
    }
    joints
}

/// Rest joints from the posed joints of `person`; bones between unknown joints are the average's, as
/// long as the known ones say. `None` where fewer than six bones are known.
fn measured(
    person: &TrackedPerson,
    average: &[Vec3],
    at: &Path,
) -> Result<Option<Vec<Vec3>>, ImportError> {
    let step = person.seen.len().div_ceil(MOST).max(1);
    let mut samples: Vec<Vec<Vec3>> = vec![Vec::new(); JOINTS.len()];
    for seen in person
        .seen
        .iter()
        .step_by(step)
        .filter(|seen| !seen.joints.is_empty())
    {
        let rotations = globals(&seen.pose);
        let position = |joint: usize| {
            seen.joints
                .iter()
                .find(|(of, _)| *of == joint)
                .map(|(_, p)| *p)
        };
        for (joint, (_, parent)) in JOINTS.iter().enumerate() {
            let sample = match parent {
                None => position(joint),
                Some(parent) => {
                    position(joint)
                        .zip(position(*parent))
                        .and_then(|(below, above)| {
                            Some(matvec(
                                &transpose(rotations.get(*parent)?),
                                sub(below, above),
                            ))
                        })
                }
            };
            if let Some(list) = samples.get_mut(joint) {
                list.extend(sample);
            }
        }
    }
    let medians: Vec<Option<Vec3>> = samples
        .iter()
        .map(|list| {
            let rows: Vec<&[f64]> = list.iter().map(<[f64; 3]>::as_slice).collect();
            median_rows(&rows).try_into().ok()
        })
        .collect();
    let known = |joint: usize| medians.get(joint).copied().flatten();
    let length = |v: Vec3| dot(v, v).sqrt();
    let bones = (1..JOINTS.len()).filter_map(|joint| Some((known(joint)?, average.get(joint)?)));
    let (mut count, mut ratio) = (0, [0.0, 0.0]);
    for (found, usual) in bones {
        count += 1;
        ratio = [ratio[0] + length(found), ratio[1] + length(*usual)];
    }
    if count < 6 {
        return Ok(None);
    }
    // SMPL's left is +x.
    for (left, right, what) in [(1, 2, "hip"), (18, 19, "elbow")] {
        if let (Some(left), Some(right)) = (known(left), known(right))
            && left[0] < right[0]
        {
            let message = format!(
                "the left {what} is on the person's right in the joints that the tool wrote: left and \
                 right are exchanged, in the joints or in the poses"
            );
            return Err(fault(at, "MIRRORED", message));
        }
    }
    let grown = ratio[0] / ratio[1].max(1e-9);
    let offset = |(joint, usual): (usize, &Vec3)| known(joint).unwrap_or(scale(*usual, grown));
    let mut offsets: Vec<Vec3> = average.iter().enumerate().map(offset).collect();
    spread(person, &mut offsets, &medians, step);
    let pelvis = known(0).unwrap_or_default();
    Ok(Some(joints_of(&offsets, pelvis)))
}

/// Chains of bones whose ends alone are known: ends, and the bones from the first on.
const CHAINS: [(usize, usize, &[usize]); 3] = [
    (0, 12, &[3, 6, 9, 12]),
    (12, 16, &[13, 16]),
    (12, 17, &[14, 17]),
];

/// Moves the bones of chains between known joints, so that the far ends land where they are.
fn spread(person: &TrackedPerson, offsets: &mut [Vec3], medians: &[Option<Vec3>], step: usize) {
    let neck_up = |offsets: &[Vec3]| offsets.get(12).copied().unwrap_or_default();
    for (from, to, bones) in CHAINS {
        if medians.get(to).copied().flatten().is_some() {
            continue;
        }
        for _ in 0..8 {
            let mut misses: Vec<Vec3> = Vec::new();
            for seen in person.seen.iter().step_by(step) {
                let position = |joint: usize| {
                    seen.joints
                        .iter()
                        .find(|(of, _)| *of == joint)
                        .map(|(_, p)| *p)
                };
                let (Some(mut at), Some(end)) = (position(from), position(to)) else {
                    continue;
                };
                let rotations = globals(&seen.pose);
                let rotation = |joint: usize| {
                    let parent = JOINTS.get(joint).and_then(|(_, parent)| *parent)?;
                    rotations.get(parent)
                };
                // Shoulders hang on the chest below the neck, from which collars start.
                if from == 12
                    && let Some(chest) = rotation(12)
                {
                    at = sub(at, matvec(chest, neck_up(offsets)));
                }
                for &bone in bones {
                    if let (Some(rotation), Some(offset)) = (rotation(bone), offsets.get(bone)) {
                        at = add(at, matvec(rotation, *offset));
                    }
                }
                if let Some(rotation) = rotation(to) {
                    misses.push(matvec(&transpose(rotation), sub(end, at)));
                }
            }
            let rows: Vec<&[f64]> = misses.iter().map(<[f64; 3]>::as_slice).collect();
            let Ok(miss) = <Vec3>::try_from(median_rows(&rows)) else {
                break;
            };
            for &bone in bones {
                if let Some(offset) = offsets.get_mut(bone) {
                    *offset = add(*offset, scale(miss, 1.0 / bones.len() as f64));
                }
            }
        }
    }
}
