//! InstantAvatar's captures, made from PeopleSnapshot or from a user's own video.
//!
//! - `cameras.npz`: `intrinsic` `[3, 3]`, `extrinsic` `[4, 4]` (world to camera, metres), `height`,
//!   `width`; images and masks are undistorted already. Pixel coordinates count from the first
//!   pixel's centre.
//! - `poses.npz` (one pose per image), or `poses/<split>.npz` (one for each image of the split):
//!   `betas` `[1, 10]` or `[10]`, `global_orient` `[F, 3]`, `body_pose` `[F, 69]`, `transl` `[F, 3]`;
//!   older files have `thetas` `[F, 72]`.
//! - `images/*.png`, and `masks/*.npy` (0 to 1) or `masks/*.png` (coverage), in the same order.

use crate::geometry::Vec3;
use crate::pictures::{Mask, MaskKind, PictureFiles, Pictures};
use crate::rest_joints::RestJoints;
use crate::source::{Faulty, FileData, Source, not_finite};
use crate::track::{Camera, SmplPose, WorldPose, empty_track, smpl_skeleton};
use crate::{Findings, ImportError, Imported, Options};

const CAMERAS: &str = "cameras.npz";

/// A file of poses.
pub(crate) struct Poses {
    pub betas: Vec<f64>,
    pub poses: Vec<SmplPose>,
    pub translations: Vec<Vec3>,
}

pub(crate) fn read(source: &Source, options: &Options) -> Result<Imported, ImportError> {
    let file = poses_file(source, options)?;
    let rest = RestJoints::needed(options, source, &file)?;
    let Poses {
        betas,
        poses,
        translations,
    } = read_poses(&source.data(&file, None)?)?;
    let (camera, size) = camera(source)?;
    let images = source.list("images", &[".png", ".jpg"])?;
    let masks = source.list("masks", &[".npy", ".png"])?;
    if images.len() != masks.len() {
        let message = format!("{} masks for {} images", masks.len(), images.len());
        return Err(source.fault("SIZE_MISMATCH", "masks", None, "", message));
    }
    let wanted = options.positions(source, "images", images.len())?;
    // Poses of a split are those of the selected images; otherwise there is one per image.
    let of_wanted = poses.len() == wanted.len();
    if !of_wanted && poses.len() != images.len() {
        let message = format!(
            "{} poses for {} images: say which images they are of (--range A..B:STEP)",
            poses.len(),
            wanted.len()
        );
        return Err(source.fault("SIZE_MISMATCH", &file, None, "body_pose", message));
    }
    let rest_joints = rest.joints(&betas);
    let pelvis = rest_joints.first().copied().unwrap_or_default();
    let mut notes = Vec::new();
    let fps = options.fps_or(None, &mut notes);
    let mut track = empty_track(smpl_skeleton(rest_joints), size, fps);
    let (mut pictures, mut faulty) = (Vec::new(), Faulty::default());
    for (order, &position) in wanted.iter().enumerate() {
        let at = if of_wanted { order } else { position };
        let (Some(image), Some(mask)) = (images.get(position), masks.get(position)) else {
            continue;
        };
        let moved: [(&str, &[f64]); 1] = [("the translation", &translations[at])];
        if let Some(message) = not_finite(&poses[at], &moved) {
            let fault = source.fault("NOT_FINITE", &file, Some(position as u32), "", message);
            faulty.keep::<()>(Err(fault))?;
            continue;
        }
        faulty.keep(Ok(()))?;
        let placed = WorldPose::about_pelvis(poses[at], translations[at], pelvis);
        track
            .frames
            .push(placed.frame(position as u32, pelvis, &camera));
        let path = source.path(mask);
        pictures.push(PictureFiles {
            image: source.path(image),
            masks: vec![if mask.to_ascii_lowercase().ends_with(".npy") {
                Mask::Array(path)
            } else {
                Mask::Image(path, MaskKind::Coverage)
            }],
            over_black: false,
        });
    }
    faulty.finish(&mut notes)?;
    Ok(Imported {
        track,
        pictures: Pictures::Files(pictures),
        available: images.len(),
        notes,
        found: Findings::default(),
    })
}

/// The file of poses.
fn poses_file(source: &Source, options: &Options) -> Result<String, ImportError> {
    if let Some(path) = &options.poses {
        return Ok(path.display().to_string());
    }
    let usual = ["poses.npz", "poses_optimized.npz"];
    if let Some(found) = usual.into_iter().find(|name| source.has(name)) {
        return Ok(found.to_owned());
    }
    let found = if source.has("poses") {
        source.list("poses", &[".npz"])?
    } else {
        Vec::new()
    };
    match &found[..] {
        [one] => Ok(one.clone()),
        [] => Err(source.fault("MISSING", "poses.npz", None, "", "there is no such file")),
        several => {
            let message = format!(
                "several files of poses, choose one (--poses FILE): {}",
                several.join(", ")
            );
            Err(source.fault("MISSING", "poses.npz", None, "", message))
        }
    }
}

/// Shape, poses and translations, finite or not, under any of their names.
pub(crate) fn read_poses(data: &FileData<'_>) -> Result<Poses, ImportError> {
    let root = data.root();
    let poses: Vec<SmplPose> = match root.find("thetas") {
        Some(thetas) => thetas.unchecked_rows(None)?,
        None => {
            let orient = root.get("global_orient")?.unchecked_rows::<3>(None)?;
            let body = root.get("body_pose")?;
            // SMPL-X has the 21 joints of SMPL before the hands.
            let is_smplx = body.unchecked()?.values.len() == 63 * orient.len();
            match is_smplx {
                true => joined(&orient, &body.unchecked_rows::<63>(Some(orient.len()))?),
                false => joined(&orient, &body.unchecked_rows::<69>(Some(orient.len()))?),
            }
        }
    };
    let transl = root.get("transl")?;
    let translations = transl.unchecked_rows::<3>(Some(poses.len()))?;
    Ok(Poses {
        betas: {
            let each = root.get("betas")?.same_betas(poses.len())?;
            each.into_iter().next().unwrap_or_default()
        },
        poses,
        translations,
    })
}

/// Poses of a root and the rotations of the other joints.
fn joined<const N: usize>(orient: &[Vec3], body: &[[f64; N]]) -> Vec<SmplPose> {
    let join = |(orient, body): (&Vec3, &[f64; N])| {
        let mut pose = [0.0; 72];
        pose[..3].copy_from_slice(orient);
        pose[3..3 + N].copy_from_slice(body);
        pose
    };
    orient.iter().zip(body).map(join).collect()
}

fn camera(source: &Source) -> Result<(Camera, [u32; 2]), ImportError> {
    let data = source.data(CAMERAS, None)?;
    let root = data.root();
    let camera = Camera::from_centres(
        root.get("intrinsic")?.matrix()?,
        root.get("extrinsic")?.matrix()?,
    );
    let side = |key: &str| Ok::<_, ImportError>(root.get(key)?.number()? as u32);
    Ok((camera, [side("width")?, side("height")?]))
}
