//! HumanNeRF's wild videos: `metadata.json`.
//!
//! `{frame name: {poses [72], betas [10], cam_intrinsics [3, 3], cam_extrinsics [4, 4]}}`, world to
//! camera, metres, pixel coordinates from the first pixel's centre. The body is at SMPL's
//! own position, without a translation: the camera has all of it. Images are
//! `images/<name>.png`, masks `masks/<name>.png` (coverage).

use super::frame_files::files;
use crate::pictures::{PictureFiles, image_size};
use crate::rest_joints::RestJoints;
use crate::source::{Faulty, Part, Source};
use crate::track::{Camera, SmplPose, WorldPose, empty_track, mean, smpl_skeleton};
use crate::{Findings, ImportError, Imported, Options, Pictures};

pub(super) const METADATA: &str = "metadata.json";

/// A frame's body, camera and files.
struct WildFrame {
    index: u32,
    betas: Vec<f64>,
    pose: SmplPose,
    camera: Camera,
    files: PictureFiles,
}

pub(super) fn read(source: &Source, options: &Options) -> Result<Imported, ImportError> {
    let rest = RestJoints::needed(options, source, METADATA)?;
    let metadata = source.data(METADATA, None)?;
    let entries = metadata.root().entries()?;
    let (mut seen, mut faulty) = (Vec::new(), Faulty::default());
    for position in options.positions(source, METADATA, entries.len())? {
        let Some((name, part)) = entries.get(position) else {
            continue;
        };
        seen.extend(faulty.keep(frame(source, name, part, position as u32))?);
    }
    let mut notes = Vec::new();
    faulty.finish(&mut notes)?;
    let betas: Vec<Vec<f64>> = seen.iter().map(|it| it.betas.clone()).collect();
    let rest_joints = rest.joints(&mean(&betas));
    let rest_root = rest_joints.first().copied().unwrap_or_default();
    let fps = options.fps_or(None, &mut notes);
    let size = seen.first().map(|it| image_size(&it.files.image, it.index));
    let mut track = empty_track(
        smpl_skeleton(rest_joints),
        size.transpose()?.unwrap_or_default(),
        fps,
    );
    track.frames = seen
        .iter()
        .map(|it| {
            let pelvis = rest.joints(&it.betas).first().copied().unwrap_or_default();
            WorldPose::about_pelvis(it.pose, [0.0; 3], pelvis)
                .frame(it.index, rest_root, &it.camera)
        })
        .collect();
    Ok(Imported {
        track,
        pictures: Pictures::Files(seen.into_iter().map(|it| it.files).collect()),
        available: entries.len(),
        notes,
        found: Findings::default(),
    })
}

fn frame(
    source: &Source,
    name: &str,
    part: &Part<'_>,
    index: u32,
) -> Result<WildFrame, ImportError> {
    let part = part.clone().of_frame(index);
    Ok(WildFrame {
        index,
        files: files(source, name, index)?,
        betas: part.get("betas")?.vector()?,
        pose: part.get("poses")?.smpl_pose()?,
        camera: Camera::from_centres(
            part.get("cam_intrinsics")?.matrix()?,
            part.get("cam_extrinsics")?.matrix()?,
        ),
    })
}
