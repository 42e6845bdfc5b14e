//! 4D-Humans, whose tracker PHALP writes `outputs/results/demo_<video>.pkl` with joblib.
//!
//! `{frame's path: {…}}`, with lists over the people of a frame: `tid` (number of the track),
//! `tracked_time` (0 where the person was seen: others are guesses of where a person may be, which
//! are left out), `smpl` (`global_orient` `[1, 3, 3]`, `body_pose` `[23, 3, 3]`, `betas` `[10]`),
//! `camera` `[3]` (SMPL's translation for a focal length of 5000/256 · max(H, W)), `size` (height,
//! width), `mask` (run lengths), `3d_joints` `[45, 3]` (OpenPose's 25 joints first). `time` counts
//! the frames of the clip.

use super::parts::{pose_of_matrices, push, runs};
use super::tool::Tool;
use crate::ImportError;
use crate::proof::{Documented, Focal, PoseEstimate, SmplVariant, ToolOutput, Translation};
use crate::source::{Faulty, Part};

/// SMPL's joints among OpenPose's: index there, index in SMPL.
const OPENPOSE: [(usize, usize); 14] = [
    (8, 0),
    (1, 12),
    (2, 17),
    (3, 19),
    (4, 21),
    (5, 16),
    (6, 18),
    (7, 20),
    (9, 2),
    (10, 5),
    (11, 8),
    (12, 1),
    (13, 4),
    (14, 7),
];

pub(crate) static TOOL: Tool = Tool {
    from: "phalp",
    help: "4D-Humans' tracker PHALP: --poses outputs/results/demo_*.pkl, with its video",
    files: "results/demo_*.pkl with tid, smpl and camera of each frame",
    locations: &[("results", "demo_", ".pkl"), ("", "demo_", ".pkl")],
    search_rank: 4,
    has_views: false,
    fits,
    read: |file| read(file.root),
    documented: Documented {
        tool: "4D-Humans (PHALP)",
        body: SmplVariant::Smpl,
        focal: Focal::Phalp,
        focal_without_own: None,
        translation: Translation::AboutPelvis,
    },
};

fn fits(root: &Part<'_>) -> bool {
    let Ok(frames) = root.members() else {
        return false;
    };
    let is_frame = |part: &Part<'_>| {
        part.find("tid").is_some() && part.find("smpl").is_some() && part.find("camera").is_some()
    };
    !frames.is_empty() && frames.iter().all(|(_, part)| is_frame(part))
}

fn read(root: &Part<'_>) -> Result<ToolOutput, ImportError> {
    let frames = root.members()?;
    let mut found = ToolOutput::of(Vec::new());
    found.frames = Some(frames.len());
    let (mut ghosts, mut faulty) = (0, Faulty::default());
    for (order, (path, frame)) in frames.iter().enumerate() {
        let (number, tids, ages) = match tracks(frame, order) {
            Ok(tracks) => tracks,
            Err(fault) => {
                faulty.keep::<()>(Err(fault))?;
                continue;
            }
        };
        let frame = frame.clone().of_frame(number as u32);
        for (at, tid) in tids.iter().enumerate() {
            let age = ages.get(at);
            if age.is_some_and(|age| *age != 0.0) {
                ghosts += 1;
                continue;
            }
            let read = person(&frame, at, number).and_then(|seen| {
                let size = frame.find("size").map(|size| size.at(at)?.fixed());
                Ok((seen, size.transpose()?))
            });
            let Some((mut seen, size)) = faulty.keep(read)? else {
                continue;
            };
            seen.image = Some(path.clone());
            found.size = size.map(|[height, width]| [width, height]).or(found.size);
            push(&mut found.people, tid.to_string(), seen);
        }
    }
    faulty.finish(&mut found.notes)?;
    if ghosts > 0 {
        found.notes.push(format!(
            "{ghosts} guesses of the tracker for frames in which it did not see the person are left \
             out"
        ));
    }
    Ok(found)
}

/// The frame's number, its tracks, and for each track the frames since it was last seen.
fn tracks(frame: &Part<'_>, order: usize) -> Result<(usize, Vec<f64>, Vec<f64>), ImportError> {
    let number = match frame.find("time") {
        Some(time) => time.number()? as usize,
        None => order,
    };
    let ages = frame.find("tracked_time").map(|ages| ages.vector());
    let tids = frame.clone().of_frame(number as u32).get("tid")?.vector()?;
    Ok((number, tids, ages.transpose()?.unwrap_or_default()))
}

fn person(frame: &Part<'_>, at: usize, number: usize) -> Result<PoseEstimate, ImportError> {
    let smpl = frame.get("smpl")?.at(at)?;
    let mut matrices = smpl.get("global_orient")?.flat::<9>()?.to_vec();
    matrices.extend(smpl.get("body_pose")?.flat::<207>()?);
    let t = frame.get("camera")?.item::<3>(at)?;
    let betas = smpl.get("betas")?.vector()?;
    let mut seen = PoseEstimate::new(number, pose_of_matrices(&matrices), t, betas);
    if let Some(joints) = frame.find("3d_joints") {
        let joints = joints.item::<135>(at)?;
        let (joints, _) = joints.as_chunks::<3>();
        let known = |(from, to): &(usize, usize)| Some((*to, *joints.get(*from)?));
        seen.joints = OPENPOSE.iter().filter_map(known).collect();
    }
    let mask = frame
        .find("mask")
        .filter(|mask| mask.len().is_ok_and(|len| len > at));
    if let Some(mask) = mask {
        seen.mask = runs(&mask.at(at)?)?;
    }
    Ok(seen)
}
