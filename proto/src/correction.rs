//! Corrections of pose tracks that follow other conventions than the schema.
//!
//! Programs that write poses and cameras differ in units, in the direction of extrinsics, in
//! axes, and in left and right. Each difference is one field here, shared by the check, which
//! tries the values, and by the command line, which sets them.

mod rotation;
mod units;

pub use units::{Unit, Units};

use crate::pose_track::{Frame, PoseTrack, Skeleton};
use rotation::{turned, turned_about_x};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Direction of a file's extrinsics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Extrinsics {
    /// World to camera, as in the pose track's schema.
    #[default]
    #[serde(rename = "w2c")]
    WorldToCamera,
    /// Camera to world: the pose of the camera, as in renderers and NeRF files.
    #[serde(rename = "c2w")]
    CameraToWorld,
}

/// Axes of a file's cameras.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraAxes {
    /// x right, y down, z forward, as in the pose track's schema.
    #[default]
    OpenCv,
    /// x right, y up, z backward.
    OpenGl,
}

/// What is mirrored, left to right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mirror {
    /// Nothing.
    #[default]
    None,
    /// The poses: rotations and root positions mirrored about the world's x = 0, and joints exchanged with
    /// their counterparts on the other side. The output of pose estimators on flipped images.
    Poses,
    /// The limbs only: as [`Mirror::Poses`], but the root keeps its rotation and position.
    Limbs,
    /// The names only: each joint gets the rotation of its counterpart, unmirrored.
    Labels,
    /// Images and masks. The pictures are not changed: the scene and its cameras are mirrored,
    /// which fits the pictures exactly; the avatar is that of the mirrored person.
    Images,
}

/// Conventions of a pose track's numbers. The default changes nothing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Correction {
    /// Direction of its extrinsics.
    pub extrinsics: Extrinsics,
    /// Axes of its cameras.
    pub camera_axes: CameraAxes,
    /// Units of its lengths.
    pub units: Units,
    /// Rotates all bodies about the world's x axis, degrees: -90 makes z-up poses upright for cameras in a y-up
    /// world.
    pub turn_bodies: f64,
    /// What is mirrored.
    pub mirror: Mirror,
    /// Factor on intrinsics for images of another size.
    pub k_scale: f64,
    /// Offset in frames: the frame at position p has the mask at position p + this.
    pub mask_shift: i32,
    /// Offset in frames: the frame at position p has the pose at position p + this.
    pub pose_shift: i32,
}

impl Default for Correction {
    fn default() -> Self {
        Self {
            extrinsics: Extrinsics::default(),
            camera_axes: CameraAxes::default(),
            units: Units::default(),
            turn_bodies: 0.0,
            mirror: Mirror::default(),
            k_scale: 1.0,
            mask_shift: 0,
            pose_shift: 0,
        }
    }
}

/// Why a correction can't be applied.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CorrectionError {
    /// Mirroring exchanges joints with their counterparts, and this joint has no counterpart.
    #[error(
        "skeleton.rest_joints[{0}]: no other joint is across the body's middle from it, so \
         left and right can't be exchanged"
    )]
    NotSymmetric(usize),
    /// No frame is left.
    #[error("shifting by {shift} leaves none of {frames} frames")]
    NothingLeft {
        /// Frames of the track.
        frames: usize,
        /// The requested shift.
        shift: i32,
    },
}

/// Sources of a corrected frame's pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Source {
    /// Index in the name of its image file.
    pub image: u32,
    /// Index in the name of its mask file.
    pub mask: u32,
}

/// A corrected track, with the sources of each frame's pictures.
#[derive(Debug, Clone, PartialEq)]
pub struct Corrected {
    /// The corrected track.
    pub track: PoseTrack,
    /// One entry per frame.
    pub sources: Vec<Source>,
}

impl Correction {
    /// Whether the correction changes nothing.
    pub fn is_identity(&self) -> bool {
        *self == Self::default()
    }

    /// Corrects `track`. Frames whose mask or pose a shift moves past the end
    /// are left out. The result is not checked: [`PoseTrack::check`] does that.
    ///
    /// # Errors
    /// When a skeleton without two sides is to be mirrored, or a shift leaves no frame.
    pub fn apply(&self, track: &PoseTrack) -> Result<Corrected, CorrectionError> {
        let mut skeleton = track.skeleton.clone();
        for value in skeleton.rest_joints.iter_mut().flatten() {
            *value *= self.units.skeleton.metres();
        }
        let sides = match self.mirror {
            Mirror::None => Vec::new(),
            _ => other_sides(&skeleton)?,
        };
        let root = skeleton.rest_joints.first().copied().unwrap_or_default();
        let width = f64::from(track.image_size[0]);
        let frames = &track.frames;
        let at = |position: usize, shift: i32| {
            let moved = i64::try_from(position).ok()? + i64::from(shift);
            frames.get(usize::try_from(moved).ok()?)
        };
        let mut corrected = Vec::with_capacity(frames.len());
        let mut sources = Vec::with_capacity(frames.len());
        for (position, frame) in frames.iter().enumerate() {
            let (Some(mask), Some(posed)) =
                (at(position, self.mask_shift), at(position, self.pose_shift))
            else {
                continue;
            };
            let mut frame = Frame {
                pose: posed.pose.clone(),
                translation: posed.translation,
                ..frame.clone()
            };
            self.camera(&mut frame);
            self.body(&mut frame, root, &sides, width);
            sources.push(Source {
                image: frame.index,
                mask: mask.index,
            });
            corrected.push(frame);
        }
        if corrected.is_empty() && !frames.is_empty() {
            let shift = if self.mask_shift == 0 {
                self.pose_shift
            } else {
                self.mask_shift
            };
            return Err(CorrectionError::NothingLeft {
                frames: frames.len(),
                shift,
            });
        }
        if self.mirror == Mirror::Images {
            let rest = &skeleton.rest_joints;
            let mirrored = |&other: &usize| rest.get(other).copied().map(flipped);
            skeleton.rest_joints = sides.iter().filter_map(mirrored).collect();
        }
        Ok(Corrected {
            track: PoseTrack {
                skeleton,
                frames: corrected,
                ..track.clone()
            },
            sources,
        })
    }

    /// Units, direction, axes and intrinsics of a frame's camera.
    fn camera(&self, frame: &mut Frame) {
        for row in &mut frame.e[..3] {
            row[3] *= self.units.camera.metres();
        }
        if self.extrinsics == Extrinsics::CameraToWorld {
            frame.e = inverse(&frame.e);
        }
        if self.camera_axes == CameraAxes::OpenGl {
            for row in &mut frame.e[1..3] {
                *row = row.map(|value| -value);
            }
        }
        for value in frame.k[..2].iter_mut().flatten() {
            *value *= self.k_scale;
        }
    }

    /// Units, upright axis and sides of a frame's body. `root` is the root's rest position, `sides` the
    /// counterpart of each joint, `width` the width of the images in pixels.
    fn body(&self, frame: &mut Frame, root: [f64; 3], sides: &[usize], width: f64) {
        frame.translation = frame.translation.map(|v| v * self.units.root.metres());
        if self.turn_bodies != 0.0 {
            let degrees = self.turn_bodies;
            if let Some(rotation) = frame.pose.first_chunk_mut::<3>() {
                *rotation = turned(*rotation, degrees);
            }
            let position = std::array::from_fn(|i| root[i] + frame.translation[i]);
            let position = turned_about_x(position, degrees);
            frame.translation = std::array::from_fn(|i| position[i] - root[i]);
        }
        if self.mirror == Mirror::None {
            return;
        }
        let pose = frame.pose.clone();
        let (old, new) = (pose.as_chunks::<3>().0, frame.pose.as_chunks_mut::<3>().0);
        for (joint, (rotation, &other)) in new.iter_mut().zip(sides).enumerate() {
            let Some(&[x, y, z]) = old.get(other) else {
                continue;
            };
            match self.mirror {
                Mirror::Labels => *rotation = [x, y, z],
                Mirror::Limbs if joint == 0 => {}
                _ => *rotation = [x, -y, -z],
            }
        }
        match self.mirror {
            Mirror::Poses => frame.translation[0] = -2.0 * root[0] - frame.translation[0],
            Mirror::Images => {
                frame.translation = flipped(frame.translation);
                for (i, row) in frame.e[..3].iter_mut().enumerate() {
                    for (j, value) in row.iter_mut().enumerate() {
                        if (i == 0) != (j == 0) {
                            *value = -*value;
                        }
                    }
                }
                frame.k[0][1] = -frame.k[0][1];
                frame.k[0][2] = width - frame.k[0][2];
            }
            Mirror::None | Mirror::Limbs | Mirror::Labels => {}
        }
    }
}

/// The command-line options for this correction, e.g. `--extrinsics c2w --units camera=mm`.
impl fmt::Display for Correction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut options = Vec::new();
        if self.extrinsics == Extrinsics::CameraToWorld {
            options.push("--extrinsics c2w".to_owned());
        }
        if self.camera_axes == CameraAxes::OpenGl {
            options.push("--camera-axes opengl".to_owned());
        }
        let units = self.units;
        if units != Units::default() {
            let parts = [
                ("camera", units.camera),
                ("root", units.root),
                ("skeleton", units.skeleton),
            ];
            let text = if units == Units::all(units.camera) {
                units.camera.symbol().to_owned()
            } else {
                let parts = parts.iter().filter(|(_, unit)| *unit != Unit::Metre);
                let parts = parts.map(|(name, unit)| format!("{name}={}", unit.symbol()));
                parts.collect::<Vec<_>>().join(",")
            };
            options.push(format!("--units {text}"));
        }
        if self.turn_bodies != 0.0 {
            options.push(format!("--turn-bodies {}", self.turn_bodies));
        }
        let mirror = match self.mirror {
            Mirror::None => None,
            Mirror::Poses => Some("poses"),
            Mirror::Limbs => Some("limbs"),
            Mirror::Labels => Some("labels"),
            Mirror::Images => Some("images"),
        };
        options.extend(mirror.map(|what| format!("--mirror {what}")));
        if self.k_scale != 1.0 {
            let digits = (self.k_scale * 1e4).round() / 1e4;
            options.push(format!("--k-scale {digits}"));
        }
        for (name, shift) in [("mask", self.mask_shift), ("pose", self.pose_shift)] {
            if shift != 0 {
                options.push(format!("--{name}-shift {shift}"));
            }
        }
        f.write_str(&options.join(" "))
    }
}

/// For each joint, its counterpart across the body's middle (x of the root); a joint in the middle is its own.
///
/// # Errors
/// [`CorrectionError::NotSymmetric`].
pub fn other_sides(skeleton: &Skeleton) -> Result<Vec<usize>, CorrectionError> {
    let rest = &skeleton.rest_joints;
    let middle = rest.first().map_or(0.0, |root| root[0]);
    let distance = |a: [f64; 3], b: [f64; 3]| -> f64 {
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
    };
    let mut sides = Vec::with_capacity(rest.len());
    for &[x, y, z] in rest {
        let across = [2.0 * middle - x, y, z];
        let nearest = (0..rest.len())
            .min_by(|&a, &b| distance(rest[a], across).total_cmp(&distance(rest[b], across)));
        sides.extend(nearest);
    }
    let lonely = |&joint: &usize| sides.get(sides[joint]) != Some(&joint);
    match (0..sides.len()).find(lonely) {
        Some(joint) => Err(CorrectionError::NotSymmetric(joint)),
        None => Ok(sides),
    }
}

fn flipped([x, y, z]: [f64; 3]) -> [f64; 3] {
    [-x, y, z]
}

/// The inverse of a rigid motion.
fn inverse(e: &[[f64; 4]; 4]) -> [[f64; 4]; 4] {
    let mut out = [[0.0; 4]; 4];
    for i in 0..3 {
        for j in 0..3 {
            out[i][j] = e[j][i];
            out[i][3] -= e[j][i] * e[j][3];
        }
    }
    out[3][3] = 1.0;
    out
}

#[cfg(test)]
mod tests;
