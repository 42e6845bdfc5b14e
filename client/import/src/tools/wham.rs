//! WHAM: `wham_output.pkl`, written by joblib with `--save_pkl`.
//!
//! `{person: {pose [F, 72], trans [F, 3], betas [F, 10], frame_ids [F], …}}`: axis-angle in the camera's
//! axes, SMPL's translation, for the focal length √(W² + H²). `pose_world` and `trans_world` have an
//! origin of their own for each person and another joint at it, so they are not read.

use super::tool::Tool;
use crate::ImportError;
use crate::proof::{
    Documented, Focal, PoseEstimate, SmplVariant, ToolOutput, TrackedPerson, Translation,
};
use crate::source::Part;

pub(crate) static TOOL: Tool = Tool {
    from: "wham",
    help: "WHAM: --poses wham_output.pkl, with its video",
    files: "wham_output.pkl with pose, trans and frame_ids of each person",
    locations: &[("", "wham_output", ".pkl")],
    search_rank: 0,
    has_views: false,
    fits,
    read: |file| read(file.root),
    documented: Documented {
        tool: "WHAM",
        body: SmplVariant::Smpl,
        focal: Focal::Diagonal,
        focal_without_own: None,
        translation: Translation::AboutPelvis,
    },
};

fn fits(root: &Part<'_>) -> bool {
    let Ok(people) = root.members() else {
        return false;
    };
    let is_person = |part: &Part<'_>| {
        part.find("trans_world").is_some()
            || (part.find("pose").is_some() && part.find("frame_ids").is_some())
    };
    !people.is_empty() && people.iter().all(|(_, part)| is_person(part))
}

fn read(root: &Part<'_>) -> Result<ToolOutput, ImportError> {
    let mut people = Vec::new();
    for (name, part) in root.members()? {
        let poses = part.get("pose")?.unchecked_rows::<72>(None)?;
        let trans = part.get("trans")?;
        let translations = trans.unchecked_rows::<3>(Some(poses.len()))?;
        let betas = part.get("betas")?.same_betas(poses.len())?;
        let numbers = part.get("frame_ids")?.numbers(poses.len())?;
        let seen = numbers.into_iter().zip(poses).zip(translations).zip(betas);
        let seen =
            seen.map(|(((number, pose), t), betas)| PoseEstimate::new(number, pose, t, betas));
        people.push(TrackedPerson {
            name,
            seen: seen.collect(),
        });
    }
    Ok(ToolOutput::of(people))
}
