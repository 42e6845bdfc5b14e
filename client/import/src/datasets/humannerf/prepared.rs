//! HumanNeRF's prepared captures, of wild videos and of ZJU-MoCap.
//!
//! - `cameras.pkl`: `{frame: {intrinsics [3, 3], extrinsics [4, 4], distortions [5] (ZJU only)}}`,
//!   world to camera, metres.
//! - `mesh_infos.pkl`: `{frame: {Rh [3], Th [3], poses [72], joints [24, 3], tpose_joints [24, 3]}}`:
//!   the body, posed without its root, is turned by Rh about the origin and moved by Th. In wild
//!   captures `tpose_joints` has the pelvis at the origin and Th is its position.
//! - `canonical_joints.pkl`: `{joints [24, 3]}`, the rest joints of the mean shape.
//!
//! Images are `images/<frame>.png`, masks `masks/<frame>.png` (coverage); pixel coordinates count
//! from the first pixel's centre.

use super::frame_files::files;
use crate::pictures::{PictureFiles, Pictures, image_size};
use crate::source::{Faulty, FileData, Part, Source};
use crate::track::{Camera, WorldPose, empty_track, smpl_skeleton};
use crate::{Findings, ImportError, Imported, Options};
use yoto_proto::pose_track::NO_DISTORTION;
use yoto_proto::smpl::JOINTS;

const CAMERAS: &str = "cameras.pkl";
pub(super) const BODIES: &str = "mesh_infos.pkl";
const CANONICAL: &str = "canonical_joints.pkl";

/// A frame's body, camera, lens and files.
struct PreparedFrame {
    placed: WorldPose,
    camera: Camera,
    distortion: [f64; 5],
    files: PictureFiles,
}

pub(super) fn read(source: &Source, options: &Options) -> Result<Imported, ImportError> {
    if options.rest_joints.is_some() {
        let message = "the capture has its own rest joints, and --rest-joints is not read";
        return Err(source.fault("UNREAD_OPTION", CANONICAL, None, "", message));
    }
    let bodies = source.data(BODIES, None)?;
    let cameras = source.data(CAMERAS, None)?;
    let canonical = source.data(CANONICAL, None)?;
    let joints = canonical.root().get("joints")?;
    let rest_joints = joints.rows::<3>()?;
    if rest_joints.len() != JOINTS.len() {
        let message = format!("{} joints, SMPL has {}", rest_joints.len(), JOINTS.len());
        return Err(joints.fault("SIZE_MISMATCH", message));
    }
    let rest_root = rest_joints.first().copied().unwrap_or_default();
    let mut notes = Vec::new();
    let fps = options.fps_or(None, &mut notes);
    let mut track = empty_track(smpl_skeleton(rest_joints), [0; 2], fps);
    let (mut pictures, mut faulty) = (Vec::new(), Faulty::default());
    let mut lens = None;
    let entries = bodies.root().entries()?;
    for position in options.positions(source, BODIES, entries.len())? {
        let Some((name, body)) = entries.get(position) else {
            continue;
        };
        let index = position as u32;
        let read = frame(source, &cameras, name, body, index);
        let Some(seen) = faulty.keep(read)? else {
            continue;
        };
        if *lens.get_or_insert(seen.distortion) != seen.distortion {
            let message = "differs from the first frame's: one capture has one lens";
            let camera = cameras.root().of_frame(index).get(name)?;
            return Err(camera.get("distortions")?.fault("INVALID", message));
        }
        let placed = seen.placed.frame(index, rest_root, &seen.camera);
        track.frames.push(placed);
        if pictures.is_empty() {
            track.image_size = image_size(&seen.files.image, index)?;
        }
        pictures.push(seen.files);
    }
    faulty.finish(&mut notes)?;
    track.distortion = lens.unwrap_or(NO_DISTORTION);
    Ok(Imported {
        track,
        pictures: Pictures::Files(pictures),
        available: entries.len(),
        notes,
        found: Findings::default(),
    })
}

fn frame(
    source: &Source,
    cameras: &FileData<'_>,
    name: &str,
    body: &Part<'_>,
    index: u32,
) -> Result<PreparedFrame, ImportError> {
    let body = body.clone().of_frame(index);
    let camera = cameras.root().of_frame(index).get(name)?;
    let rest = body.get("tpose_joints")?.rows::<3>()?;
    Ok(PreparedFrame {
        placed: WorldPose::about_origin(
            body.get("poses")?.smpl_pose()?,
            body.get("Rh")?.fixed()?,
            body.get("Th")?.fixed()?,
            rest.first().copied().unwrap_or_default(),
        ),
        camera: Camera::from_centres(
            camera.get("intrinsics")?.matrix()?,
            camera.get("extrinsics")?.matrix()?,
        ),
        distortion: match camera.find("distortions") {
            Some(part) => part.fixed()?,
            None => NO_DISTORTION,
        },
        files: files(source, name, index)?,
    })
}
