//! TRAM: a folder `results/<clip>/` of pickled arrays.
//!
//! - `hps/hps_track_<person>.npy`: `pred_rotmat` `[N, 24, 3, 3]`, `pred_shape` `[N, 10]`, `pred_trans`
//!   `[N, 1, 3]` (SMPL's translation), `frame` `[N]`. A person seen with gaps has several chunks.
//! - `camera.npy`: `img_focal`, `img_center` `[2]`; `pred_cam_R` `[F, 3, 3]` and `pred_cam_T` `[F, 3]`,
//!   camera to world, metres, in the axes of the first frame's camera; older versions also write
//!   `world_cam_R` and `world_cam_T`, the same in a world whose y points up, against gravity.
//! - `masks.npy`: run lengths of all people together, one entry per frame.

use super::camera_motion::{FIRST_CAMERA, Y_UP, follow, of_cameras};
use super::parts::{pose_of_matrices, runs};
use super::tool::Tool;
use crate::ImportError;
use crate::proof::{
    Documented, Focal, Intrinsics, PoseEstimate, SmplVariant, ToolOutput, TrackedPerson,
    Translation,
};
use crate::source::{Part, Source};

const CAMERA: &str = "camera.npy";
const MASKS: &str = "masks.npy";

pub(crate) static TOOL: Tool = Tool {
    from: "tram",
    help: "TRAM: --poses results/CLIP, with its video",
    files: "hps/hps_track_*.npy with pred_rotmat, and camera.npy",
    locations: &[("hps", "hps_track", ".npy"), ("", "hps_track", ".npy")],
    search_rank: 3,
    has_views: false,
    fits,
    read: |file| read(file.source, file.name),
    documented: Documented {
        tool: "TRAM",
        body: SmplVariant::Smpl,
        focal: Focal::Own,
        focal_without_own: None,
        translation: Translation::AboutPelvis,
    },
};

fn fits(root: &Part<'_>) -> bool {
    root.find("pred_rotmat").is_some()
}

/// `file` is any track, relative to the folder of `source`.
fn read(source: &Source, file: &str) -> Result<ToolOutput, ImportError> {
    let inside = file.rsplit_once('/').map_or("", |(folder, _)| folder);
    let above = match inside.rsplit_once('/') {
        Some((above, _)) => format!("{above}/"),
        None if inside.is_empty() && !source.has(CAMERA) => "../".to_owned(),
        None => String::new(),
    };
    let camera = format!("{above}{CAMERA}");
    let camera = if source.has(&camera) {
        Some(source.data(&camera, None)?)
    } else {
        None
    };
    let intrinsics = if let Some(data) = &camera {
        let focal = data.root().get("img_focal")?.number()?;
        let centre: [f64; 2] = data.root().get("img_center")?.fixed()?;
        Some(Intrinsics {
            focal: [focal; 2],
            centre: Some(centre),
            size: Some(centre.map(|side| 2.0 * side)),
            margin: 0.0,
        })
    } else {
        None
    };
    let mut found = ToolOutput::of(Vec::new());
    for name in source.list(inside, &[".npy"])? {
        let name = name.trim_start_matches('/');
        let data = source.data(name, None)?;
        if fits(&data.root()) {
            let track = name.rsplit_once("track_").map_or(name, |(_, track)| track);
            let seen = track_of(&data.root(), intrinsics)?;
            found.people.push(TrackedPerson {
                name: track.trim_end_matches(".npy").to_owned(),
                seen,
            });
        }
    }
    if let Some(data) = &camera {
        follow_camera(&mut found, &data.root())?;
    }
    let masks = format!("{above}{MASKS}");
    if source.has(&masks) {
        let data = source.data(&masks, None)?;
        let root = data.root();
        for frame in 0..root.len()? {
            if let Some(mask) = runs(&root.at(frame)?.of_frame(frame as u32))? {
                found.masks.push((frame, mask));
            }
        }
        found.frames = Some(root.len()?);
    }
    Ok(found)
}

/// Moves the people of `found` to the world, if the camera of `root` moves.
fn follow_camera(found: &mut ToolOutput, root: &Part<'_>) -> Result<(), ImportError> {
    let cameras = [
        ("world_cam_R", "world_cam_T", Y_UP),
        ("pred_cam_R", "pred_cam_T", FIRST_CAMERA),
    ];
    let written = cameras.iter().find_map(|(rotations, positions, note)| {
        Some((root.find(rotations)?, root.get(positions), note))
    });
    let Some((rotations, positions, note)) = written else {
        return Ok(());
    };
    let cameras = of_cameras(&rotations, &positions?)?;
    if follow(&mut found.people, &cameras, &rotations, &mut found.notes)? {
        found.notes.push((*note).to_owned());
    }
    Ok(())
}

fn track_of(
    root: &Part<'_>,
    intrinsics: Option<Intrinsics>,
) -> Result<Vec<PoseEstimate>, ImportError> {
    let matrices = root.get("pred_rotmat")?.unchecked_rows::<216>(None)?;
    let count = matrices.len();
    let shapes = root.get("pred_shape")?.same_betas(count)?;
    let translations = root.get("pred_trans")?.unchecked_rows::<3>(Some(count))?;
    let numbers = root.get("frame")?.numbers(count)?;
    let all = matrices.iter().zip(shapes).zip(translations).zip(numbers);
    let seen = all.map(|(((matrices, betas), t), number)| {
        let mut seen = PoseEstimate::new(number, pose_of_matrices(matrices), t, betas);
        seen.intrinsics = intrinsics;
        seen
    });
    Ok(seen.collect())
}
