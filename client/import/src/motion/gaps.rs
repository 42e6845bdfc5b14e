//! Replaces frames of a motion that are not usable by poses between their neighbours.

use super::MotionFrame;
use crate::geometry::Vec3;
use crate::hierarchy::JointHierarchy;
use crate::source::{FEW, is_number};
use yoto_capture::skeleton::{Pose, timing};

/// A note names at most this number of frames.
const NAMED: usize = 4;

/// A frame of a file.
pub(super) struct MotionRow {
    /// Axis-angle of each joint, radians.
    pub rotations: Vec<Vec3>,
    pub translation: Vec3,
}

/// Fills gaps as [`filled`] does. Frames of `hierarchy` stay as they are if all are usable.
pub(super) fn closed(
    frames: Vec<MotionFrame>,
    fps: f64,
    hierarchy: &JointHierarchy,
    notes: &mut Vec<String>,
) -> Result<(Vec<MotionFrame>, f64), String> {
    let is_usable = |frame: &MotionFrame| {
        let numbers = frame.rotations.as_flattened().iter().chain(&frame.root);
        numbers.copied().all(is_number)
    };
    if frames.iter().all(is_usable) {
        return Ok((frames, fps));
    }
    let names: Vec<String> = hierarchy.0.iter().map(|joint| joint.name.clone()).collect();
    let rows = frames.into_iter().map(|frame| MotionRow {
        rotations: frame.rotations,
        translation: frame.root,
    });
    let (poses, fps) = filled(rows.collect(), fps, &names, notes)?;
    let frame = |pose: &Pose| MotionFrame {
        rotations: pose.rotations_f64(),
        root: pose.translation.map(f64::from),
    };
    Ok((poses.iter().map(frame).collect(), fps))
}

/// The poses of `rows`, of joints with these `names`, at `fps` frames per second, and their rate. Rows with numbers that
/// are not finite are left out, with a note; the motion takes its time over them.
///
/// # Errors
/// When many frames are not usable.
pub(super) fn filled(
    rows: Vec<MotionRow>,
    fps: f64,
    names: &[String],
    notes: &mut Vec<String>,
) -> Result<(Vec<Pose>, f64), String> {
    let count = rows.len();
    let (mut poses, mut numbers, mut bad) = (Vec::new(), Vec::new(), Vec::new());
    for (number, row) in rows.into_iter().enumerate() {
        let is_bad = |of: &Vec3| of.iter().any(|value| !is_number(*value));
        let joint = row.rotations.iter().position(is_bad);
        match joint.and_then(|joint| names.get(joint)) {
            Some(name) => bad.push(format!("{number} (rotation of {name})")),
            None if joint.is_some() || is_bad(&row.translation) => {
                bad.push(format!("{number} (translation)"));
            }
            None => {
                numbers.push(u32::try_from(number).unwrap_or(u32::MAX));
                poses.push(Pose {
                    rotations: row
                        .rotations
                        .iter()
                        .map(|it| it.map(|v| v as f32))
                        .collect(),
                    translation: row.translation.map(|v| v as f32),
                });
            }
        }
    }
    if bad.is_empty() {
        return Ok((poses, fps));
    }
    let named = bad
        .iter()
        .take(NAMED)
        .cloned()
        .collect::<Vec<_>>()
        .join(", ");
    let more = if bad.len() > NAMED { ", …" } else { "" };
    if bad.len() as f64 > FEW * count as f64 {
        return Err(format!(
            "{} of {count} frames have numbers that are not finite: {named}{more}",
            bad.len()
        ));
    }
    notes.push(format!(
        "left out: {} of {count} frames, with numbers that are not finite: {named}{more}; the poses around them are \
         joined",
        bad.len()
    ));
    Ok(timing::even(poses, &numbers, fps))
}
