//! PromptHMR: `results.pkl`, written by joblib.
//!
//! `people` by number: `frames` `[N]`, `smplx_cam` with `rotmat` `[N, 55, 3, 3]`, `shape` `[N, 10]` and
//! `trans` `[N, 3]` of SMPL-X, in the camera's axes. `camera`: `img_focal`, `img_center` `[2]` of
//! images that are at most 896 pixels high; `pred_cam_R` `[F, 3, 3]` and `pred_cam_T` `[F, 3]`, camera to
//! world, metres, in the axes of the first frame's camera. `camera_world` has the same two, from the
//! smoothed motion if the tool was told to smooth it, in a world whose y points up from the floor.

use super::camera_motion::{FIRST_CAMERA, Y_UP, follow, of_cameras};
use super::parts::pose_of_matrices;
use super::tool::Tool;
use crate::ImportError;
use crate::proof::{
    Documented, Focal, Intrinsics, PoseEstimate, SmplVariant, ToolOutput, TrackedPerson,
    Translation,
};
use crate::source::Part;

pub(crate) static TOOL: Tool = Tool {
    from: "prompthmr",
    help: "PromptHMR: --poses results.pkl, with its video",
    files: "results.pkl with people and camera",
    locations: &[("", "results", ".pkl")],
    search_rank: 2,
    has_views: false,
    fits,
    read: |file| read(file.root),
    documented: Documented {
        tool: "PromptHMR",
        body: SmplVariant::SmplX,
        focal: Focal::Own,
        focal_without_own: None,
        translation: Translation::AboutPelvis,
    },
};

fn fits(root: &Part<'_>) -> bool {
    root.find("people").is_some() && root.find("camera").is_some()
}

fn read(root: &Part<'_>) -> Result<ToolOutput, ImportError> {
    let camera = root.get("camera")?;
    let focal = camera.get("img_focal")?.number()?;
    let centre: [f64; 2] = camera.get("img_center")?.fixed()?;
    let intrinsics = Intrinsics {
        focal: [focal; 2],
        centre: Some(centre),
        size: Some(centre.map(|side| 2.0 * side)),
        margin: 0.0,
    };
    let mut people = Vec::new();
    for (name, part) in root.get("people")?.members()? {
        let body = part.get("smplx_cam")?;
        let matrices = body.get("rotmat")?.unchecked_rows::<495>(None)?;
        let count = matrices.len();
        let shapes = body.get("shape")?.same_betas(count)?;
        let translations = body.get("trans")?.unchecked_rows::<3>(Some(count))?;
        let numbers = part.get("frames")?.numbers(count)?;
        let all = matrices.iter().zip(shapes).zip(translations).zip(numbers);
        let seen = all.map(|(((matrices, betas), t), number)| {
            // The root and 21 joints are SMPL's; then come jaw, eyes and fingers.
            let pose = pose_of_matrices(matrices.get(..198).unwrap_or_default());
            let mut seen = PoseEstimate::new(number, pose, t, betas);
            seen.intrinsics = Some(intrinsics);
            seen
        });
        people.push(TrackedPerson {
            name,
            seen: seen.collect(),
        });
    }
    let mut found = ToolOutput::of(people);
    if let Some(rotations) = camera.find("pred_cam_R") {
        let motion = of_cameras(&rotations, &camera.get("pred_cam_T")?)?;
        found.frames = Some(motion.len());
        // The rotation to gravity's axes is of all frames alike, so that a camera which stands still
        // does so in both.
        let world = root.find("camera_world");
        let (note, rotations, cameras) = match &world {
            Some(world) => {
                let rotations = world.get("pred_cam_R")?;
                let cameras = of_cameras(&rotations, &world.get("pred_cam_T")?)?;
                (Y_UP, rotations, cameras)
            }
            None => (FIRST_CAMERA, rotations, motion),
        };
        if follow(&mut found.people, &cameras, &rotations, &mut found.notes)? {
            found.notes.push(note.to_owned());
        }
    }
    Ok(found)
}
