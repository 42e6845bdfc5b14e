//! AlphaPose's `alphapose-results.json`: a list of people over all frames, each with `image_id`, flat
//! `keypoints` (x, y and confidence; the first 17 are COCO's in all of its sets, and the full-body ones
//! have hands) and, where it follows people, `idx`.

use super::detections::{Detection, Detections, FrameDetections, flat, numbers_in};
use super::form::{DetectorForm, RecognisedBy};
use super::hands;
use crate::ImportError;
use crate::source::{Faulty, Part};
use std::collections::BTreeMap;
use yoto_pose::KeyPointSet;

pub(super) static FORM: DetectorForm = DetectorForm {
    detector: Some("AlphaPose"),
    fits: RecognisedBy::Contents(fits),
    read: |file| read(&file.data()?.root()),
};

/// Whether this is such a list.
fn fits(root: &Part<'_>) -> bool {
    let first = root.at(0).ok();
    first.is_some_and(|first| first.find("image_id").is_some() && first.find("keypoints").is_some())
}

/// The people of all frames.
fn read(root: &Part<'_>) -> Result<Detections, ImportError> {
    let mut frames: BTreeMap<(usize, String), Vec<Detection>> = BTreeMap::new();
    let mut faulty = Faulty::default();
    for at in 0..root.len()? {
        let entry = root.at(at)?;
        let image = entry.get("image_id")?;
        let name = match image.text() {
            Ok(name) => name.to_owned(),
            Err(_) => format!("{}.jpg", super::detections::whole(&image)?),
        };
        let Some(&number) = numbers_in(&name).last() else {
            return Err(image.fault("OUT_OF_RANGE", format!("there is no number in '{name}'")));
        };
        let part = entry.of_frame(u32::try_from(number).unwrap_or(u32::MAX));
        let person = match part.find("idx") {
            // Some versions write the number in a list of its own.
            Some(idx) => idx.vector()?.first().map(|idx| idx.to_string()),
            None => None,
        };
        let points = part.get("keypoints")?;
        let count = (points.unchecked()?.values.len() / 3).max(KeyPointSet::Coco17.points());
        let picture = faulty.keep(flat(&points, count))?;
        let seen = frames.entry((number, name)).or_default();
        seen.extend(picture.map(|picture| Detection {
            hands: [None, None],
            face: None,
            mask: None,
            own: None,
            person,
            picture: hands::body_and_knuckles(&picture),
            space: Vec::new(),
        }));
    }
    let seen = |((number, image), people): ((usize, String), Vec<Detection>)| FrameDetections {
        number,
        image: Some(image),
        people,
    };
    let frames = frames.into_iter().map(seen).collect();
    let mut found = Detections::new("AlphaPose", KeyPointSet::Coco17, frames);
    found.first = None;
    hands::settle(&mut found);
    faulty.finish(&mut found.notes)?;
    Ok(found)
}
