//! Motions in SMPL's parameters, as in AMASS.
//!
//! `poses` `[F, J · 3]` of SMPL's 24 joints, or of a model whose first 22 are SMPL's: SMPL-H (52), SMPL-X (55, or fewer
//! where parts of the face are left out); or AMASS's parts of them, `root_orient` and `pose_body`. `trans` `[F, 3]`
//! metres, `betas`, `mocap_framerate` or `mocap_frame_rate`; z is up in AMASS's files. Some files hold only `poses`
//! and `trans`. InstantAvatar's names for the same fields are supported as well. Fingers move where the file has rotations for them
//! (the 30 joints of SMPL-H and SMPL-X, or AMASS's `pose_hand`), and so do jaw and eyes (SMPL-X, or AMASS's `pose_jaw` and `pose_eye`).
//! Expressions in numbers of SMPL-X are not read: they belong to its licensed model.

use super::gaps::{self, MotionRow};
use super::smpl_parts::{self, Parts};
use super::up::{self, Up, Usual};
use super::{Motion, MotionFrame, MotionOptions, posture};
use crate::ImportError;
use crate::datasets::instant_avatar;
use crate::geometry::{Vec3, add, log_map, matmul, matvec, rodrigues, sub};
use crate::source::{FileData, Part, Source};
use crate::track::{SmplPose, smpl_skeleton};
use yoto_capture::skeleton::parts::with_count;
use yoto_capture::skeleton::smpl::{AVERAGE_REST, JOINTS, all_joints};
use yoto_capture::skeleton::{Pose, Skeleton};
use yoto_proto::pose_track::Skeleton as TrackSkeleton;

/// Numbers of the rotations that all of SMPL's models share: of 22 joints.
const SHARED: usize = 66;
/// Numbers of SMPL's own rotations.
const SMPL: usize = 72;
/// Most numbers of a pose: SMPL-X has 165.
const WIDEST: usize = 400;
/// Default frames per second.
const FPS: f64 = 30.0;
/// Rest position of the pelvis of SMPL's mean shape, metres.
const PELVIS: Vec3 = [0.0, -0.22, 0.03];
/// Names of the frame rate.
const RATES: [&str; 6] = [
    "mocap_framerate",
    "mocap_frame_rate",
    "fps",
    "frameRate",
    "frame_rate",
    "framerate",
];

/// The contents of a file.
struct Parameters {
    betas: Vec<f64>,
    poses: Vec<SmplPose>,
    translations: Vec<Vec3>,
    /// Rotations of the joints behind SMPL's, if any of them moves.
    parts: Parts,
    /// Whether the file is AMASS's, by its frame rate.
    is_amass: bool,
}

pub(super) fn read(
    source: &Source,
    name: &str,
    options: &MotionOptions,
) -> Result<Motion, ImportError> {
    let data = source.data(name, None)?;
    let read = parameters(&data)?;
    let mut notes = Vec::new();
    let fps = match rate(&data.root())? {
        Some(fps) => fps,
        None => {
            notes.push(format!(
                "the file has no frame rate: {FPS} frames per second are assumed"
            ));
            FPS
        }
    };
    let rest = options.rest_joints(&read.betas)?;
    if rest.is_none() {
        notes.push("no body model (--smpl): strides are not scaled to the length of legs".into());
    }
    let plain = smpl_skeleton(rest.clone().unwrap_or_default());
    let behind = read.parts.first().map_or(0, Vec::len) / 3;
    let skeleton = with_joints(plain, JOINTS.len() + behind);
    let rows = read.poses.iter().zip(&read.translations).enumerate();
    let rows = rows.map(|(at, (pose, translation))| {
        let parts = read.parts.get(at).map_or(&[][..], Vec::as_slice);
        MotionRow {
            rotations: [pose.as_chunks::<3>().0, parts.as_chunks::<3>().0].concat(),
            translation: *translation,
        }
    });
    let (poses, fps) = gaps::filled(rows.collect(), fps, &skeleton.names, &mut notes)
        .map_err(|message| source.fault("NOT_FINITE", name, None, "poses", message))?;
    let up = match options.up {
        Some(up) => up,
        None => {
            let (up, note) = found_up(&read, rest.as_deref(), &poses)
                .map_err(|message| source.fault("NOT_STANDING", name, None, "poses", message))?;
            notes.push(note);
            up
        }
    };
    let pelvis = rest.as_ref().and_then(|rest| rest.first().copied());
    let pelvis = pelvis.unwrap_or_default();
    let upright = up.to_y();
    let frame = |pose: &Pose| {
        let mut rotations = pose.rotations_f64();
        if let Some(root) = rotations.first_mut() {
            // The rest pose has y up in every file; only the world has another axis up.
            *root = log_map(&matmul(&upright, &rodrigues(*root)));
        }
        MotionFrame {
            rotations,
            root: matvec(&upright, add(pelvis, pose.translation.map(f64::from))),
        }
    };
    let names = skeleton.names.iter();
    Ok(Motion {
        frames: poses.iter().map(frame).collect(),
        fps,
        matched: names.map(|name| (name.clone(), name.clone())).collect(),
        unmatched: Vec::new(),
        notes,
        skeleton,
    })
}

/// SMPL's `skeleton` with `count` joints: with fingers, and with a face.
fn with_joints(skeleton: TrackSkeleton, count: usize) -> TrackSkeleton {
    let placed = Skeleton::from_track(&skeleton).ok();
    match placed.and_then(|it| with_count(&it, count)) {
        Some(placed) => placed.to_track(),
        // Without rest joints it has the body's that it moves.
        None => TrackSkeleton {
            names: all_joints()
                .take(count)
                .map(|(name, _)| name.to_owned())
                .collect(),
            parents: all_joints()
                .take(count)
                .map(|(_, parent)| parent.map_or(-1, |parent| parent as i32))
                .collect(),
            rest_joints: skeleton.rest_joints,
        },
    }
}

/// The axis that is up, and a note about it, of a body with the rest joints `rest` or an average adult's.
fn found_up(
    read: &Parameters,
    rest: Option<&[Vec3]>,
    poses: &[Pose],
) -> Result<(Up, String), String> {
    let average = || {
        let from = AVERAGE_REST.first().copied().unwrap_or_default();
        let moved = AVERAGE_REST
            .iter()
            .map(|joint| add(sub(*joint, from), PELVIS));
        moved.collect::<Vec<_>>()
    };
    let rest = rest.map_or_else(average, <[Vec3]>::to_vec);
    let skeleton = Skeleton::from_track(&smpl_skeleton(rest)).map_err(|error| error.to_string())?;
    let body = poses.iter().cloned().map(|mut pose| {
        pose.rotations.truncate(skeleton.joints());
        pose
    });
    let postures = posture::of_poses(&skeleton, &body.collect::<Vec<_>>()).unwrap_or_default();
    let usual = Usual {
        up: Up::Z,
        who: "AMASS",
        is_documented: true,
    };
    up::find(&postures, read.is_amass.then_some(usual))
}

fn rate(root: &Part<'_>) -> Result<Option<f64>, ImportError> {
    let documented = RATES[..3].iter().find_map(|name| root.find(name));
    // Names that scripts choose may hold anything.
    let others = || {
        RATES[3..]
            .iter()
            .find_map(|name| root.find(name).filter(|it| it.number().is_ok()))
    };
    let Some(part) = documented.or_else(others) else {
        return Ok(None);
    };
    let fps = part.number()?;
    if fps > 0.0 && fps <= 1000.0 {
        return Ok(Some(fps));
    }
    Err(part.fault("OUT_OF_RANGE", format!("{fps} frames per second")))
}

fn parameters(data: &FileData<'_>) -> Result<Parameters, ImportError> {
    let root = data.root();
    let (poses, parts) = match (
        root.find("poses"),
        root.find("root_orient"),
        root.find("pose_body"),
    ) {
        (Some(part), ..) => poses(&part)?,
        (None, Some(orient), Some(body)) => {
            let poses = joined(&orient, &body)?;
            let parts = smpl_parts::of_amass(&root, poses.len())?;
            (poses, parts)
        }
        _ => {
            let read = instant_avatar::read_poses(data)?;
            return Ok(Parameters {
                betas: read.betas,
                poses: read.poses,
                translations: read.translations,
                parts: Parts::new(),
                is_amass: false,
            });
        }
    };
    let trans = match root.find("trans") {
        Some(trans) => trans,
        None => root.get("transl")?,
    };
    let betas = root.find("betas").map(|betas| betas.vector());
    Ok(Parameters {
        betas: betas.transpose()?.unwrap_or_default(),
        translations: trans.unchecked_rows::<3>(Some(poses.len()))?,
        poses,
        parts,
        // Similar files of other programs lack it, and most of them have y up.
        is_amass: RATES[..2].iter().any(|name| root.find(name).is_some()),
    })
}

/// The poses of `[F, J · 3]` or `[F, J, 3]`.
fn poses(part: &Part<'_>) -> Result<(Vec<SmplPose>, Parts), ImportError> {
    let array = part.unchecked()?;
    let (rows, width) = match array.shape[..] {
        [rows, width] => (rows, width),
        [rows, joints, 3] => (rows, 3 * joints),
        _ => (0, 0),
    };
    // 63 and 69 are poses without the root.
    if !(SHARED..=WIDEST).contains(&width) || !width.is_multiple_of(3) || width == SMPL - 3 {
        let message = format!(
            "the shape is {:?}: [F, 72] of SMPL is needed, or [F, 156] of SMPL-H, or [F, 165] of SMPL-X",
            array.shape
        );
        return Err(part.fault("SIZE_MISMATCH", message));
    }
    let taken = if width == SMPL { SMPL } else { SHARED };
    let body = |row: &[f64]| {
        let mut pose = [0.0; SMPL];
        pose.iter_mut()
            .zip(row)
            .take(taken)
            .for_each(|(to, from)| *to = *from);
        pose
    };
    let rows = || array.values.chunks_exact(width).take(rows);
    let bodies = rows().map(body).collect();
    Ok((bodies, smpl_parts::of_rows(rows(), width)))
}

/// The poses of AMASS's `root_orient` `[F, 3]` and `pose_body` `[F, 63]`.
fn joined(orient: &Part<'_>, body: &Part<'_>) -> Result<Vec<SmplPose>, ImportError> {
    let orient = orient.unchecked_rows::<3>(None)?;
    let body = body.unchecked_rows::<63>(Some(orient.len()))?;
    let join = |(orient, body): (&Vec3, &[f64; 63])| {
        let mut pose = [0.0; SMPL];
        pose[..3].copy_from_slice(orient);
        pose[3..SHARED].copy_from_slice(body);
        pose
    };
    Ok(orient.iter().zip(&body).map(join).collect())
}
