//! easy_ViTPose's `--save-json`: `keypoints`, a dictionary per frame of people by number, each `[N, 3]`
//! of **y, x** and score, and `skeleton`, the points' names by index. Read by these names: COCO's 17,
//! its own 25 with a neck and feet, and COCO-WholeBody.

use super::detections::{Detection, Detections, FrameDetections, from_centre};
use crate::source::Part;
use yoto_client::ClientError;
use yoto_pose::KeyPointSet;

const COCO: [&str; 17] = [
    "nose",
    "left_eye",
    "right_eye",
    "left_ear",
    "right_ear",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
];
/// The names of `BODY_25`'s points in its order.
const BODY_25: [&str; 25] = [
    "nose",
    "neck",
    "right_shoulder",
    "right_elbow",
    "right_wrist",
    "left_shoulder",
    "left_elbow",
    "left_wrist",
    "hip",
    "right_hip",
    "right_knee",
    "right_ankle",
    "left_hip",
    "left_knee",
    "left_ankle",
    "right_eye",
    "left_eye",
    "right_ear",
    "left_ear",
    "left_big_toe",
    "left_small_toe",
    "left_heel",
    "right_big_toe",
    "right_small_toe",
    "right_heel",
];

/// Whether this is such a dictionary.
pub(super) fn fits(root: &Part<'_>) -> bool {
    root.find("keypoints").is_some() && root.find("skeleton").is_some()
}

/// The people of all frames.
pub(super) fn read(root: &Part<'_>) -> Result<Detections, ClientError> {
    let names = root.get("skeleton")?;
    let (set, order) = order(&names)?;
    let keypoints = root.get("keypoints")?;
    let mut frames = Vec::new();
    for number in 0..keypoints.len()? {
        let frame = keypoints
            .at(number)?
            .of_frame(u32::try_from(number).unwrap_or(u32::MAX));
        let mut people = Vec::new();
        for (person, part) in frame.members()? {
            let rows = part.rows::<3>()?;
            let point = |&at: &usize| {
                rows.get(at)
                    .map(|&[y, x, score]| from_centre([x, y, score]))
            };
            let picture: Option<Vec<[f64; 3]>> = order.iter().map(point).collect();
            let picture = picture.ok_or_else(|| {
                let message = format!("{} points, fewer than 'skeleton' names", rows.len());
                part.fault("SIZE_MISMATCH", message)
            })?;
            people.push(Detection {
                mask: None,
                own: None,
                person: Some(person),
                picture,
                space: Vec::new(),
            });
        }
        frames.push(FrameDetections {
            number,
            image: None,
            people,
        });
    }
    Ok(Detections::new("easy_ViTPose", set, frames))
}

/// The set, and where each of its points is in the file.
fn order(names: &Part<'_>) -> Result<(KeyPointSet, Vec<usize>), ClientError> {
    let mut indices: Vec<(String, usize)> = Vec::new();
    for (at, name) in names.members()? {
        let at = at
            .parse()
            .map_err(|_| names.fault("OUT_OF_RANGE", format!("'{at}' is no number of a point")))?;
        // Once written 'left_big toe'.
        indices.push((name.text()?.replace(' ', "_"), at));
    }
    let find = |wanted: &&str| {
        let found = indices.iter().find(|(name, _)| name == wanted);
        found.map(|(_, at)| *at)
    };
    let all = |wanted: &[&str]| wanted.iter().map(find).collect::<Option<Vec<usize>>>();
    if let Some(order) = all(&BODY_25) {
        return Ok((KeyPointSet::OpenPose25, order));
    }
    let order = all(&COCO).ok_or_else(|| {
        let message = "these are not a person's points as COCO names them";
        names.fault("MISSING", message)
    })?;
    Ok((KeyPointSet::Coco17, order))
}
