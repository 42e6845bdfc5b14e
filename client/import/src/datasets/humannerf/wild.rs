//! HumanNeRF's wild videos: `metadata.json`.
//!
//! `{frame name: {poses [72], betas [10], cam_intrinsics [3, 3], cam_extrinsics [4, 4]}}`, world to
//! camera, metres, pixel coordinates from the first pixel's centre. The body is at SMPL's
//! own position, without a translation: the camera has all of it. Images are
//! `images/<name>.png`, masks `masks/<name>.png` (coverage).

use super::frame_files::files;
use crate::pictures::image_size;
use crate::rest_joints::RestJoints;
use crate::source::Source;
use crate::track::{Camera, Placed, empty_track, mean, smpl_skeleton};
use crate::{Found, Imported, Options, Pictures};
use yoto_client::ClientError;

pub(super) const METADATA: &str = "metadata.json";

pub(super) fn read(source: &Source, options: &Options) -> Result<Imported, ClientError> {
    let rest = RestJoints::needed(options, source, METADATA)?;
    let metadata = source.data(METADATA, None)?;
    let entries = metadata.root().entries()?;
    let (mut pictures, mut betas, mut read) = (Vec::new(), Vec::new(), Vec::new());
    for position in options.positions(source, METADATA, entries.len())? {
        let Some((name, part)) = entries.get(position) else {
            continue;
        };
        let index = position as u32;
        let part = part.clone().of_frame(index);
        pictures.push(files(source, name, index)?);
        let shape = part.get("betas")?.vector()?;
        let pose: [f64; 72] = part.get("poses")?.fixed()?;
        let camera = Camera::from_centres(
            part.get("cam_intrinsics")?.matrix()?,
            part.get("cam_extrinsics")?.matrix()?,
        );
        read.push((index, shape.clone(), pose, camera));
        betas.push(shape);
    }
    let rest_joints = rest.joints(&mean(&betas));
    let rest_root = rest_joints.first().copied().unwrap_or_default();
    let mut notes = Vec::new();
    let fps = options.fps_or(None, &mut notes);
    let size = pictures.first().zip(read.first());
    let size = size.map(|(files, (index, ..))| image_size(&files.image, *index));
    let mut track = empty_track(
        smpl_skeleton(rest_joints),
        size.transpose()?.unwrap_or_default(),
        fps,
    );
    track.frames = read
        .into_iter()
        .map(|(index, shape, pose, camera)| {
            let pelvis = rest.joints(&shape).first().copied().unwrap_or_default();
            Placed::about_pelvis(pose, [0.0; 3], pelvis).frame(index, rest_root, &camera)
        })
        .collect();
    Ok(Imported {
        track,
        pictures: Pictures::Files(pictures),
        available: entries.len(),
        notes,
        found: Found::default(),
    })
}
