//! GVHMR: `hmr4d_results.pt`, written by torch.
//!
//! `smpl_params_incam` and `smpl_params_global`: `body_pose` `[L, 63]`, `global_orient`, `transl` `[L, 3]`,
//! `betas` `[L, 10]` of SMPL-X; `K_fullimg` `[L, 3, 3]`. `global` has y up and no camera, so only `incam`
//! is read. Some programs write the same values with flat names: `global_orient_incam`, or
//! `smpl_params_incam_global_orient`, with `body_pose` and `betas` of both. A converter to `.pkl` is in use that writes the numbers of `global` in the place of `incam`:
//! such a file is refused. Frames are those of the copy `0_input_video.mp4`, which has all frames of the
//! clip, at 30 frames per second.

use super::parts::pose_of_smplx;
use super::tool::Tool;
use crate::ImportError;
use crate::geometry::Vec3;
use crate::proof::{
    Documented, Focal, Intrinsics, PoseEstimate, SmplVariant, ToolOutput, TrackedPerson,
    Translation,
};
use crate::source::Part;

pub(crate) static TOOL: Tool = Tool {
    from: "gvhmr",
    help: "GVHMR: --poses hmr4d_results.pt, with its video",
    files: "hmr4d_results.pt with smpl_params_incam",
    locations: &[("", "hmr4d_results", ".pt")],
    search_rank: 1,
    has_views: false,
    fits,
    read: |file| read(file.root),
    documented: Documented {
        tool: "GVHMR",
        body: SmplVariant::SmplX,
        focal: Focal::Own,
        focal_without_own: Some(Focal::Diagonal),
        translation: Translation::AboutPelvis,
    },
};

fn fits(root: &Part<'_>) -> bool {
    root.find("smpl_params_incam").is_some()
        || root.find("smpl_params_global").is_some()
        || value(root, Space::Incam, "global_orient").is_some()
}

/// The axes of values.
#[derive(Clone, Copy)]
enum Space {
    Incam,
    Global,
}

impl Space {
    fn word(self) -> &'static str {
        match self {
            Self::Incam => "incam",
            Self::Global => "global",
        }
    }
}

/// The value `name` of one of the spaces, in any of the forms.
fn value<'a>(root: &Part<'a>, space: Space, name: &str) -> Option<Part<'a>> {
    let space = space.word();
    let group = format!("smpl_params_{space}");
    let nested = root.find(&group).and_then(|group| group.find(name));
    nested
        .or_else(|| root.find(&format!("{group}_{name}")))
        .or_else(|| root.find(&format!("{name}_{space}")))
}

fn read(root: &Part<'_>) -> Result<ToolOutput, ImportError> {
    let is_flat = root.find("smpl_params_incam").is_none()
        && value(root, Space::Incam, "global_orient").is_some();
    let incam = match is_flat {
        true => root.clone(),
        false => root.get("smpl_params_incam")?,
    };
    // What does not depend on the axes has one name where names are flat.
    let own = |name: &str| match value(root, Space::Incam, name) {
        Some(value) => Ok(value),
        None => incam.get(name),
    };
    let of_axes = |name: &str| match (is_flat, value(root, Space::Incam, name)) {
        (true, None) => {
            let message = format!("there is no '{name}' in the camera's axes ({name}_incam)");
            Err(root.fault("MISSING", message))
        }
        _ => own(name),
    };
    let orient = of_axes("global_orient")?.unchecked_rows::<3>(None)?;
    let transl = of_axes("transl")?.unchecked_rows::<3>(Some(orient.len()))?;
    let body = own("body_pose")?.unchecked_rows::<63>(Some(orient.len()))?;
    let betas = own("betas")?.same_betas(orient.len())?;
    let world = ["global_orient", "transl"].map(|name| value(root, Space::Global, name));
    if let [Some(world), Some(positions)] = world {
        let world = world.unchecked_rows::<3>(None)?;
        let positions = positions.unchecked_rows::<3>(None)?;
        if is_same(&world, &orient) && is_same(&positions, &transl) && orient.len() > 1 {
            let message = "the same numbers as smpl_params_global: a converter put the poses of the \
                           world (y up) in the place of the camera's. Give the tool's own \
                           hmr4d_results.pt";
            return Err(incam.fault("INVALID", message));
        }
    }
    let cameras = match root.find("K_fullimg") {
        Some(part) => part.unchecked_rows::<9>(None)?,
        None => Vec::new(),
    };
    let one = |number: usize| {
        let pose = pose_of_smplx(*orient.get(number)?, body.get(number)?);
        let betas = betas.get(number)?.clone();
        let mut seen = PoseEstimate::new(number, pose, *transl.get(number)?, betas);
        let camera = cameras.get(number).or_else(|| cameras.first());
        seen.intrinsics = camera.map(Intrinsics::of_middle);
        Some(seen)
    };
    let mut found = ToolOutput::of(vec![TrackedPerson {
        name: "0".to_owned(),
        seen: (0..orient.len()).filter_map(one).collect(),
    }]);
    found.frames = Some(orient.len());
    Ok(found)
}

/// Whether all finite numbers are equal.
fn is_same(one: &[Vec3], other: &[Vec3]) -> bool {
    let mut pairs = one.as_flattened().iter().zip(other.as_flattened());
    one.len() == other.len() && pairs.all(|(a, b)| a == b || a.is_nan() || b.is_nan())
}
