//! ROMP and BEV: a `.npz` of `results` per frame, or `video_results.npz` of all frames by name.
//!
//! Arrays of `P` people: `smpl_thetas` `[P, 72]`, `smpl_betas` `[P, 10]` (BEV: 11), `cam_trans` `[P, 3]` (for a
//! view of 60°), `joints` `[P, 71, 3]` (SMPL's 24 first), `track_ids` `[P]` with `-t`. The pelvis is at
//! `joints[0] + cam_trans`, whether the tool aligned the joints to the hips or not. Without SMPL
//! (`--calc_smpl` switches it off) there are no joints and the translation is for another focal length:
//! such files are refused.

use super::parts::push;
use super::tool::Tool;
use crate::ImportError;
use crate::clip::number_in;
use crate::geometry::{Vec3, dot, sub};
use crate::proof::{
    Documented, Focal, PoseEstimate, SmplVariant, ToolOutput, TrackedPerson, Translation,
};
use crate::source::{Faulty, Part, Source};
use yoto_proto::smpl::JOINTS;

/// Largest motion of a person from frame to frame, metres, if no file has numbers of people.
const STRIDE: f64 = 1.0;

pub(crate) static TOOL: Tool = Tool {
    from: "romp",
    help: "ROMP or BEV: --poses a folder of *.npz or video_results.npz, with its video",
    files: "*.npz with results",
    locations: &[("", "video_results", ".npz")],
    search_rank: 5,
    has_views: false,
    fits,
    read: |file| read(file.root, file.source, file.name),
    documented: Documented {
        tool: "ROMP or BEV",
        body: SmplVariant::Smpl,
        focal: Focal::Sixty,
        focal_without_own: None,
        translation: Translation::AboutPelvis,
    },
};

fn fits(root: &Part<'_>) -> bool {
    root.find("results").is_some()
}

fn read(root: &Part<'_>, source: &Source, file: &str) -> Result<ToolOutput, ImportError> {
    let results = root.get("results")?;
    let (mut found, mut faulty) = (ToolOutput::of(Vec::new()), Faulty::default());
    if is_frame(&results) {
        let folder = file.rsplit_once('/').map_or("", |(folder, _)| folder);
        for (order, name) in source.list(folder, &[".npz"])?.iter().enumerate() {
            let name = name.trim_start_matches('/');
            let number = number_in(name).unwrap_or(order);
            let data = match source.data(name, Some(number as u32)) {
                Ok(data) => data,
                Err(fault) => {
                    faulty.keep::<()>(Err(fault))?;
                    continue;
                }
            };
            if let Some(results) = data.root().find("results").filter(is_frame) {
                faulty.keep(add(&mut found.people, &results, number, name))?;
            }
        }
    } else {
        let frames = results.members()?;
        for (order, (name, part)) in frames.iter().enumerate() {
            let number = number_in(name).unwrap_or(order);
            let part = part.clone().of_frame(number as u32);
            faulty.keep(add(&mut found.people, &part, number, name))?;
        }
    }
    faulty.finish(&mut found.notes)?;
    Ok(found)
}

/// Whether this is the output for one image.
fn is_frame(part: &Part<'_>) -> bool {
    part.find("cam").is_some()
        || part.find("cam_trans").is_some()
        || part.find("smpl_thetas").is_some()
}

fn add(
    people: &mut Vec<TrackedPerson>,
    part: &Part<'_>,
    number: usize,
    name: &str,
) -> Result<(), ImportError> {
    let Some(thetas) = part.find("smpl_thetas") else {
        let message = "there are no smpl_thetas: the tool ran without SMPL, and its translations then \
                       belong to no body. Given alone, --calc_smpl switches SMPL off: run it again \
                       without that";
        return Err(part.fault("MISSING", message));
    };
    let Some(joints) = part.find("joints") else {
        let message = "there are smpl_thetas and no joints, by which the pelvis is placed: save all of \
                       the tool's results. Where the tool ran without SMPL (--calc_smpl, given alone), run \
                       it again without that";
        return Err(part.fault("MISSING", message));
    };
    let poses = thetas.unchecked_rows::<72>(None)?;
    let count = poses.len();
    let betas = part.get("smpl_betas")?.same_betas(count)?;
    let translations = part.get("cam_trans")?.unchecked_rows::<3>(Some(count))?;
    let joints = joints.unchecked_rows::<213>(Some(count))?;
    let ids = part
        .find("track_ids")
        .map(|ids| ids.numbers(count))
        .transpose()?;
    for (at, pose) in poses.into_iter().enumerate() {
        let (Some(t), Some(betas), Some(joints)) =
            (translations.get(at), betas.get(at), joints.get(at))
        else {
            continue;
        };
        let mut seen = PoseEstimate::new(number, pose, *t, betas.clone());
        seen.image = Some(name.to_owned());
        let (joints, _) = joints.as_chunks::<3>();
        seen.joints = joints
            .iter()
            .copied()
            .take(JOINTS.len())
            .enumerate()
            .collect();
        let person = match ids.as_ref().and_then(|ids| ids.get(at)) {
            Some(id) => id.to_string(),
            None => nearest(people, *t, number).unwrap_or_else(|| people.len().to_string()),
        };
        push(people, person, seen);
    }
    Ok(())
}

/// The person last seen nearest to `t`, among those not yet found in this frame.
fn nearest(people: &[TrackedPerson], t: Vec3, number: usize) -> Option<String> {
    let away = |person: &TrackedPerson| {
        let last = person.seen.last()?;
        let by = sub(last.t, t);
        let far = dot(by, by).sqrt();
        (last.number != number && far < STRIDE).then(|| (far, person.name.clone()))
    };
    let candidates = people.iter().filter_map(away);
    candidates
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
}
