//! LHM's motions: `smplx_params/%05d.json`, one per frame, from 1.
//!
//! `root_pose` `[3]`, `body_pose` `[21, 3]`, `betas` `[10]` of SMPL-X, `trans` `[3]`: where the pelvis is,
//! in the camera's axes; `focal`, `princpt` and `img_size_wh` `[2]`, of enlarged images with margins
//! around the clip's: they are 1 + `pad_ratio` times as wide and high, and the middle stays the middle.

use super::parts::pose_of_smplx;
use super::tool::Tool;
use crate::ImportError;
use crate::clip::number_in;
use crate::proof::{
    Documented, Focal, Intrinsics, PoseEstimate, SmplVariant, ToolOutput, TrackedPerson,
    Translation,
};
use crate::source::{Faulty, Part, Source};

pub(crate) static TOOL: Tool = Tool {
    from: "lhm",
    help: "LHM's motions: --poses smplx_params, with their video",
    files: "smplx_params/*.json with root_pose and trans",
    locations: &[("smplx_params", "", ".json")],
    search_rank: 7,
    has_views: false,
    fits,
    read: |file| read(file.source, file.name),
    documented: Documented {
        tool: "LHM",
        body: SmplVariant::SmplX,
        focal: Focal::Own,
        focal_without_own: Some(Focal::Sixty),
        translation: Translation::Pelvis,
    },
};

fn fits(root: &Part<'_>) -> bool {
    let named = ["root_pose", "trans", "betas"];
    named.iter().all(|name| root.find(name).is_some())
}

fn read(source: &Source, file: &str) -> Result<ToolOutput, ImportError> {
    let folder = file.rsplit_once('/').map_or("", |(folder, _)| folder);
    let (mut seen, mut faulty) = (Vec::new(), Faulty::default());
    for name in source.list(folder, &[".json"])? {
        let name = name.trim_start_matches('/');
        let number = number_in(name);
        let number = number
            .and_then(|number| number.checked_sub(1))
            .ok_or_else(|| {
                let message = "the name has no frame number, counted from 1";
                source.fault("BAD_NAME", name, None, "", message)
            })?;
        let read = source.data(name, Some(number as u32));
        seen.extend(faulty.keep(read.and_then(|data| frame(&data.root(), number)))?);
    }
    let mut found = ToolOutput::of(vec![TrackedPerson {
        name: "0".to_owned(),
        seen,
    }]);
    faulty.finish(&mut found.notes)?;
    Ok(found)
}

fn frame(root: &Part<'_>, number: usize) -> Result<PoseEstimate, ImportError> {
    let body = root.get("body_pose")?.flat::<63>()?;
    let pose = pose_of_smplx(root.get("root_pose")?.fixed()?, &body);
    let t = root.get("trans")?.fixed()?;
    let mut seen = PoseEstimate::new(number, pose, t, root.get("betas")?.vector()?);
    if let Some(focal) = root.find("focal") {
        let margin = root.find("pad_ratio");
        seen.intrinsics = Some(Intrinsics {
            focal: focal.fixed()?,
            centre: Some(root.get("princpt")?.fixed()?),
            size: Some(root.get("img_size_wh")?.fixed()?),
            margin: margin.map_or(Ok(0.0), |margin| margin.number())?,
        });
    }
    Ok(seen)
}
