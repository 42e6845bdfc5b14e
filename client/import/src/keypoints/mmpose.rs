//! MMPose's predictions: a list of frames with `frame_id`, counted from 1 by its demo and from 0 by its
//! inferencer, and `instances`, alone or as `instance_info` beside `meta_info`. An instance has
//! `keypoints` `[N, 2]` and `keypoint_scores`, the first 17 of them COCO's, and a `track_id`
//! where people are followed.

use super::detections::{Detection, Detections, FrameDetections, from_centre, whole};
use super::form::{DetectorForm, RecognisedBy};
use super::hands;
use crate::ImportError;
use crate::source::{Faulty, Part};
use yoto_pose::KeyPointSet;

/// Sets whose first points are COCO's 17: COCO, Halpe's 26, COCO-WholeBody.
const COUNTS: [usize; 4] = [17, 26, 133, 136];

pub(super) static FORM: DetectorForm = DetectorForm {
    detector: Some("MMPose"),
    fits: RecognisedBy::Contents(fits),
    read: |file| read(&file.data()?.root()),
};

/// Whether these are such predictions.
fn fits(root: &Part<'_>) -> bool {
    root.find("instance_info").is_some()
        || root
            .at(0)
            .is_ok_and(|first| first.find("instances").is_some())
}

/// The people of all frames.
fn read(root: &Part<'_>) -> Result<Detections, ImportError> {
    let list = match root.find("instance_info") {
        Some(list) => list,
        None => root.clone(),
    };
    let (mut frames, mut faulty) = (Vec::new(), Faulty::default());
    for at in 0..list.len()? {
        let entry = list.at(at)?;
        let number = match entry.find("frame_id") {
            Some(id) => whole(&id)?,
            None => at,
        };
        let instances = entry
            .get("instances")?
            .of_frame(u32::try_from(number).unwrap_or(u32::MAX));
        let mut people = Vec::new();
        for at in 0..instances.len()? {
            people.extend(faulty.keep(instance(&instances.at(at)?))?);
        }
        frames.push(FrameDetections {
            number,
            image: None,
            people,
        });
    }
    let mut found = Detections::new("MMPose", KeyPointSet::Coco17, frames);
    // All frames are in the list, some without people: the first one's number is the first.
    found.first = found.frames.first().map(|seen| seen.number.min(1));
    hands::settle(&mut found);
    faulty.finish(&mut found.notes)?;
    Ok(found)
}

fn instance(part: &Part<'_>) -> Result<Detection, ImportError> {
    let points = part.get("keypoints")?;
    let positions = points.unchecked_rows::<2>(None)?;
    let scores = part.get("keypoint_scores")?;
    let sure = scores.unchecked_rows::<1>(None)?.concat();
    if !COUNTS.contains(&positions.len()) {
        let message = format!(
            "{} points: a set that begins with COCO's 17 is needed",
            positions.len()
        );
        return Err(points.fault("SIZE_MISMATCH", message));
    }
    if sure.len() != positions.len() {
        let message = format!("{} scores for {} points", sure.len(), positions.len());
        return Err(scores.fault("SIZE_MISMATCH", message));
    }
    let person = match part.find("track_id") {
        Some(id) => Some(whole(&id)?.to_string()),
        None => None,
    };
    let point = |([x, y], score): (&[f64; 2], &f64)| from_centre([*x, *y, *score]);
    let all: Vec<[f64; 3]> = positions.iter().zip(&sure).map(point).collect();
    Ok(Detection {
        hands: [None, None],
        face: None,
        mask: None,
        own: None,
        person,
        picture: hands::body_and_knuckles(&all),
        space: Vec::new(),
    })
}
