//! The reader of PeopleSnapshot's files.

use super::{CAMERA, MASKS, POSES};
use crate::geometry::{extrinsics, rodrigues};
use crate::pictures::{Mask, PictureFiles, Pictures, image_size};
use crate::rest_joints::RestJoints;
use crate::source::hdf5::Hdf5;
use crate::source::{Faulty, Source, not_finite};
use crate::track::{Camera, WorldPose, empty_track, smpl_skeleton};
use crate::{Findings, ImportError, Imported, Options};

pub(super) fn read(source: &Source, options: &Options) -> Result<Imported, ImportError> {
    let rest = RestJoints::needed(options, source, POSES)?;
    let (camera, distortion, size) = camera(source)?;
    let poses = Hdf5::open(source, POSES)?;
    let pose = poses.unchecked_rows::<72>("pose")?;
    let trans = poses.unchecked_rows::<3>("trans")?;
    let (_, betas) = poses.numbers("betas")?;
    let stack = Hdf5::open(source, MASKS)?.stack("masks")?;
    if pose.len() != trans.len() || pose.len() > stack.frames() {
        let message = format!(
            "{} poses, {} translations, {} masks: a pose needs one of each",
            pose.len(),
            trans.len(),
            stack.frames()
        );
        return Err(source.fault("SIZE_MISMATCH", POSES, None, "pose", message));
    }
    let rest_joints = rest.joints(&betas);
    let pelvis = rest_joints.first().copied().unwrap_or_default();
    let mut notes = Vec::new();
    let fps = options.fps_or(None, &mut notes);
    let mut track = empty_track(smpl_skeleton(rest_joints), size, fps);
    track.distortion = distortion;
    let (mut masks, mut faulty) = (Vec::new(), Faulty::default());
    for position in options.positions(source, POSES, pose.len())? {
        let moved: [(&str, &[f64]); 1] = [("the translation", &trans[position])];
        let read = match not_finite(&pose[position], &moved) {
            None => Ok(()),
            Some(message) => {
                Err(source.fault("NOT_FINITE", POSES, Some(position as u32), "", message))
            }
        };
        if faulty.keep(read)?.is_none() {
            continue;
        }
        let placed = WorldPose::about_pelvis(pose[position], trans[position], pelvis);
        track
            .frames
            .push(placed.frame(position as u32, pelvis, &camera));
        masks.push(vec![Mask::Stack(stack.clone(), position)]);
    }
    faulty.finish(&mut notes)?;
    let pictures = if source.has("images") {
        images(source, masks, &track.frames, size)?
    } else {
        let videos = source.list("", &[".mp4", ".mov"])?;
        match &videos[..] {
            [video] => Pictures::Video {
                video: source.path(video.trim_start_matches('/')),
                masks,
            },
            _ => {
                let message = format!(
                    "{} videos and no folder images: one is needed",
                    videos.len()
                );
                return Err(source.fault("MISSING", "*.mp4", None, "", message));
            }
        }
    };
    Ok(Imported {
        track,
        pictures,
        available: pose.len(),
        notes,
        found: Findings::default(),
    })
}

fn images(
    source: &Source,
    masks: Vec<Vec<Mask>>,
    frames: &[yoto_proto::pose_track::Frame],
    size: [u32; 2],
) -> Result<Pictures, ImportError> {
    let names = source.list("images", &[".png", ".jpg"])?;
    let first = frames.first().map(|frame| frame.index);
    let file = |(frame, masks): (&yoto_proto::pose_track::Frame, Vec<Mask>)| {
        let name = names.get(frame.index as usize).ok_or_else(|| {
            let message = format!("there are {} images", names.len());
            source.fault("MISSING", "images", Some(frame.index), "", message)
        })?;
        let image = source.path(name);
        if Some(frame.index) == first && image_size(&image, frame.index)? != size {
            let message = "width and height differ from the images";
            return Err(source.fault("SIZE_MISMATCH", CAMERA, None, "width", message));
        }
        Ok(PictureFiles {
            image,
            masks,
            over_black: false,
        })
    };
    let files = frames.iter().zip(masks).map(file);
    Ok(Pictures::Files(files.collect::<Result<_, ImportError>>()?))
}

fn camera(source: &Source) -> Result<(Camera, [f64; 5], [u32; 2]), ImportError> {
    let data = source.data(CAMERA, None)?;
    let root = data.root();
    let [fx, fy] = root.get("camera_f")?.fixed()?;
    let [cx, cy] = root.get("camera_c")?.fixed()?;
    let k = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]];
    let turned = rodrigues(root.get("camera_rt")?.fixed()?);
    let e = extrinsics(&turned, root.get("camera_t")?.fixed()?);
    let side = |key: &str| Ok::<_, ImportError>(root.get(key)?.number()? as u32);
    Ok((
        Camera::from_centres(k, e),
        root.get("camera_k")?.fixed()?,
        [side("width")?, side("height")?],
    ))
}
