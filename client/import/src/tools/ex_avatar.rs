//! ExAvatar: `smplx_optimized/smplx_params/<frame>.json`, or `smplx_params_smoothed`, one per frame, named
//! as the pictures in `frames`.
//!
//! `root_pose` `[3]`, `body_pose` `[21, 3]`, `trans` `[3]` (SMPL's translation) of SMPL-X, in the camera's
//! axes; the shape of all frames is in `shape_param.json` beside the folder. `cam_params/<frame>.json` of
//! the subject's folder: `R` `[3, 3]`, `t` `[3]`, world to camera, `focal` and `princpt` `[2]` of the
//! pictures as they are. Clips of a camera that stands still have a made-up one of 2000 px.

use super::camera_motion::of_extrinsics;
use super::parts::pose_of_smplx;
use super::tool::Tool;
use crate::ImportError;
use crate::clip::number_in;
use crate::proof::{
    CameraPose, Documented, Focal, Intrinsics, PoseEstimate, SmplVariant, ToolOutput,
    TrackedPerson, Translation, moves,
};
use crate::source::{Faulty, Part, Source};

const SHAPE: &str = "shape_param.json";
const OFFSETS: &str = "joint_offset.json";
const CAMERAS: &str = "cam_params";
/// Focal length of the made-up camera, pixels.
const MADE_UP: f64 = 2000.0;
const NO_CAMERA: Intrinsics = Intrinsics {
    focal: [MADE_UP; 2],
    centre: None,
    size: None,
    margin: 0.0,
};
/// Least offset of a joint that is noted, metres.
const NOTED: f64 = 0.005;

pub(crate) static TOOL: Tool = Tool {
    from: "exavatar",
    help: "ExAvatar: --poses smplx_optimized/smplx_params, with the pictures or their video",
    files: "smplx_optimized/smplx_params/*.json with root_pose, trans and expr",
    locations: &[
        ("smplx_optimized/smplx_params_smoothed", "", ".json"),
        ("smplx_params_smoothed", "", ".json"),
        ("smplx_optimized/smplx_params", "", ".json"),
    ],
    search_rank: 6,
    has_views: false,
    fits,
    read: |file| read(file.source, file.name),
    documented: Documented {
        tool: "ExAvatar",
        body: SmplVariant::SmplX,
        focal: Focal::Own,
        focal_without_own: None,
        translation: Translation::AboutPelvis,
    },
};

fn fits(root: &Part<'_>) -> bool {
    // LHM's files have the same names and `betas`.
    let named = ["root_pose", "body_pose", "trans", "expr"];
    named.iter().all(|name| root.find(name).is_some()) && root.find("betas").is_none()
}

fn read(source: &Source, file: &str) -> Result<ToolOutput, ImportError> {
    let folder = file.rsplit_once('/').map_or("", |(folder, _)| folder);
    let betas = match beside(source, folder, SHAPE, 1) {
        Some(name) => source.data(&name, None)?.root().vector()?,
        None => vec![0.0; 10],
    };
    let cameras = beside(source, folder, CAMERAS, 2);
    let mut found = ToolOutput::of(Vec::new());
    let (mut seen, mut cameras_of_frames) = (Vec::new(), Vec::new());
    let mut faulty = Faulty::default();
    for name in source.list(folder, &[".json"])? {
        let name = name.trim_start_matches('/');
        let number = number_in(name).ok_or_else(|| {
            let message = "the name has no frame number";
            source.fault("BAD_NAME", name, None, "", message)
        })?;
        let read = source.data(name, Some(number as u32));
        let read = read.and_then(|data| {
            let mut one = frame(&data.root(), number, &betas)?;
            let camera = match &cameras {
                Some(cameras) => Some(camera(source, cameras, number)?),
                None => None,
            };
            one.intrinsics = Some(camera.map_or(NO_CAMERA, |(intrinsics, _)| intrinsics));
            Ok((one, camera.map(|(_, pose)| pose)))
        });
        if let Some((one, camera)) = faulty.keep(read)? {
            seen.push(one);
            cameras_of_frames.extend(camera);
        }
    }
    faulty.finish(&mut found.notes)?;
    if cameras.is_none() {
        found.notes.push(format!(
            "there is no {CAMERAS} beside the poses: the focal length {MADE_UP} px is the one that the tool \
             makes up"
        ));
    }
    if moves(&cameras_of_frames) {
        for (one, camera) in seen.iter_mut().zip(cameras_of_frames) {
            one.camera_pose = Some(camera);
        }
        found.notes.push(
            "the camera moves: bodies and cameras stand in the world of cam_params".to_owned(),
        );
    }
    found.notes.extend(offsets(source, folder)?);
    // Names without leading zeros are listed in another order.
    seen.sort_by_key(|one: &PoseEstimate| one.number);
    found.people.push(TrackedPerson {
        name: "0".to_owned(),
        seen,
    });
    Ok(found)
}

/// The path of `name` beside the folder or at most `above` folders higher.
fn beside(source: &Source, folder: &str, name: &str, above: usize) -> Option<String> {
    let start = if folder.is_empty() { "." } else { folder };
    let paths = (1..=above).map(|above| format!("{start}/{}{name}", "../".repeat(above)));
    paths.into_iter().find(|path| source.has(path))
}

fn frame(root: &Part<'_>, number: usize, betas: &[f64]) -> Result<PoseEstimate, ImportError> {
    let body = root.get("body_pose")?.flat::<63>()?;
    let pose = pose_of_smplx(root.get("root_pose")?.fixed()?, &body);
    let mut seen = PoseEstimate::new(number, pose, root.get("trans")?.fixed()?, betas.to_vec());
    seen.image = Some(number.to_string());
    Ok(seen)
}

/// The camera of frame `number`, in the folder `cameras`.
fn camera(
    source: &Source,
    cameras: &str,
    number: usize,
) -> Result<(Intrinsics, CameraPose), ImportError> {
    let data = source.data(&format!("{cameras}/{number}.json"), Some(number as u32))?;
    let root = data.root();
    let pose = of_extrinsics(&root.get("R")?, &root.get("t")?)?;
    Ok((intrinsics(&root)?, pose))
}

fn intrinsics(root: &Part<'_>) -> Result<Intrinsics, ImportError> {
    Ok(Intrinsics {
        focal: root.get("focal")?.fixed()?,
        centre: Some(root.get("princpt")?.fixed()?),
        size: None,
        margin: 0.0,
    })
}

/// A note about joints that the tool has moved from those of the shape, which are not moved here.
fn offsets(source: &Source, folder: &str) -> Result<Option<String>, ImportError> {
    let Some(name) = beside(source, folder, OFFSETS, 1) else {
        return Ok(None);
    };
    let offsets = source.data(&name, None)?.root().rows::<3>()?;
    let length = |offset: &[f64; 3]| offset.iter().map(|v| v * v).sum::<f64>().sqrt();
    let most = offsets.iter().take(22).map(length).fold(0.0, f64::max);
    Ok((most > NOTED).then(|| {
        format!(
            "{OFFSETS} moves joints by up to {:.0} mm, which is not read: bones are those of the shape",
            1000.0 * most
        )
    }))
}
