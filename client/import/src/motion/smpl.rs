//! Motions in SMPL's parameters, as in AMASS.
//!
//! `poses` `[F, 156]` (SMPL with hands) or `[F, 72]`, `trans` `[F, 3]` metres, `betas`,
//! `mocap_framerate`; z is up. Some files hold only `poses` and `trans`. InstantAvatar's names for
//! the same fields are supported as well. The first 22 joints of both models are the same; hands do
//! not move.

use super::{Motion, MotionFrame, MotionOptions, Up};
use crate::datasets::instant_avatar::{Poses, read_poses};
use crate::geometry::{Vec3, add, log_map, matmul, matvec, rodrigues};
use crate::source::{Data, Part, Source};
use crate::track::{SmplPose, smpl_skeleton};
use yoto_client::ClientError;

/// Joints that SMPL and SMPL with hands share, times 3.
const SHARED: usize = 66;
/// Default frames per second.
const FPS: f64 = 30.0;

pub(super) fn read(
    source: &Source,
    name: &str,
    options: &MotionOptions,
) -> Result<Motion, ClientError> {
    let data = source.data(name, None)?;
    let (read, is_amass) = parameters(&data)?;
    let root = data.root();
    let mut notes = Vec::new();
    let rate = root
        .find("mocap_framerate")
        .or_else(|| root.find("mocap_frame_rate"));
    let fps = match rate {
        Some(rate) => rate.number()?,
        None => {
            notes.push(format!(
                "the file has no frame rate: {FPS} frames per second are assumed"
            ));
            FPS
        }
    };
    if !(fps > 0.0 && fps <= 1000.0) {
        let message = format!("{fps} frames per second");
        return Err(source.fault("OUT_OF_RANGE", name, None, "mocap_framerate", message));
    }
    // This field distinguishes AMASS's files from similar files with y up.
    let usual = if is_amass { Up::Z } else { Up::Y };
    let up = options.up.unwrap_or(usual);
    if options.up.is_none() {
        notes.push(format!("{up:?} is taken to be up (--up)"));
    }
    let rest = options.rest_joints(&read.betas)?;
    if rest.is_none() {
        notes.push("no body model (--smpl): strides are not scaled to the length of legs".into());
    }
    let pelvis = rest.as_ref().and_then(|rest| rest.first().copied());
    let pelvis = pelvis.unwrap_or_default();
    let upright = up.to_y();
    let frame = |(pose, translation): (&SmplPose, &Vec3)| {
        let mut rotations = pose.as_chunks::<3>().0.to_vec();
        if let Some(root) = rotations.first_mut() {
            // The rest pose is y up in every file; only the world is z up.
            *root = log_map(&matmul(&upright, &rodrigues(*root)));
        }
        MotionFrame {
            rotations,
            root: matvec(&upright, add(pelvis, *translation)),
        }
    };
    let skeleton = smpl_skeleton(rest.unwrap_or_default());
    let names = skeleton.names.iter();
    Ok(Motion {
        frames: read
            .poses
            .iter()
            .zip(&read.translations)
            .map(frame)
            .collect(),
        fps,
        matched: names.map(|name| (name.clone(), name.clone())).collect(),
        unmatched: Vec::new(),
        notes,
        skeleton,
    })
}

/// The parameters, and whether the file is from AMASS.
fn parameters(data: &Data<'_>) -> Result<(Poses, bool), ClientError> {
    let root = data.root();
    let Some(part) = root.find("poses") else {
        return Ok((read_poses(data)?, false));
    };
    let (poses, with_hands) = poses(&part)?;
    let trans = root.get("trans")?;
    let translations = trans.rows::<3>()?;
    if translations.len() != poses.len() {
        let message = format!("{} rows for {} poses", translations.len(), poses.len());
        return Err(trans.fault("SIZE_MISMATCH", message));
    }
    let betas = root.find("betas").map(|betas| betas.vector());
    let rated = root.find("mocap_framerate").is_some();
    Ok((
        Poses {
            betas: betas.transpose()?.unwrap_or_default(),
            poses,
            translations,
        },
        with_hands || rated,
    ))
}

fn poses(part: &Part<'_>) -> Result<(Vec<SmplPose>, bool), ClientError> {
    let array = part.array()?;
    if let Some(rows) = array.rows::<72>() {
        return Ok((rows, false));
    }
    let rows = array.rows::<156>().ok_or_else(|| {
        let message = format!(
            "the shape is {:?}, [F, 72] or [F, 156] is needed",
            array.shape
        );
        part.fault("SIZE_MISMATCH", message)
    })?;
    let body = |row: &[f64; 156]| {
        let mut pose = [0.0; 72];
        pose[..SHARED].copy_from_slice(&row[..SHARED]);
        pose
    };
    Ok((rows.iter().map(body).collect(), true))
}
