//! easy_ViTPose's `--save-json`: `keypoints`, a dictionary per frame of people by number, each `[N, 3]`
//! of **y, x** and score, and `skeleton`, the points' names by index. Read by these names: COCO's 17,
//! its own 25 with a neck and feet, and COCO-WholeBody.

use super::detections::{Detection, Detections, FrameDetections, from_centre};
use super::form::{DetectorForm, RecognisedBy};
use super::point_set::PointSet;
use crate::ImportError;
use crate::source::{Faulty, Part};
use yoto_pose::KeyPointSet;

pub(super) static FORM: DetectorForm = DetectorForm {
    detector: Some("easy_ViTPose"),
    fits: RecognisedBy::Contents(fits),
    read: |file| read(&file.data()?.root()),
};

/// Whether this is such a dictionary.
fn fits(root: &Part<'_>) -> bool {
    root.find("keypoints").is_some() && root.find("skeleton").is_some()
}

/// The people of all frames.
fn read(root: &Part<'_>) -> Result<Detections, ImportError> {
    let names = root.get("skeleton")?;
    let (set, order) = order(&names)?;
    let keypoints = root.get("keypoints")?;
    let (mut frames, mut faulty) = (Vec::new(), Faulty::default());
    for number in 0..keypoints.len()? {
        let frame = keypoints
            .at(number)?
            .of_frame(u32::try_from(number).unwrap_or(u32::MAX));
        let mut people = Vec::new();
        for (person, part) in frame.members()? {
            let Some(rows) = faulty.keep(part.unchecked_rows::<3>(None))? else {
                continue;
            };
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
                hands: [None, None],
                face: None,
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
    let mut found = Detections::new("easy_ViTPose", set, frames);
    faulty.finish(&mut found.notes)?;
    Ok(found)
}

/// The set, and where each of its points is in the file.
fn order(names: &Part<'_>) -> Result<(KeyPointSet, Vec<usize>), ImportError> {
    let mut indices: Vec<(String, usize)> = Vec::new();
    for (at, name) in names.members()? {
        let at = at.parse().map_err(|_| {
            names.fault(
                "OUT_OF_RANGE",
                format!("'{at}' is not the number of a point"),
            )
        })?;
        // Once written 'left_big toe'.
        indices.push((name.text()?.replace(' ', "_"), at));
    }
    let find = |wanted: &&str| {
        let found = indices.iter().find(|(name, _)| name == wanted);
        found.map(|(_, at)| *at)
    };
    let all = |set: PointSet| {
        let order: Option<Vec<usize>> = set.names().iter().map(find).collect();
        Some((set.fitted().0, order?))
    };
    let known = all(PointSet::Body25).or_else(|| all(PointSet::Coco17));
    known.ok_or_else(|| {
        let message = "these are not a person's points as COCO names them";
        names.fault("MISSING", message)
    })
}
