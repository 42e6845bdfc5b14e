//! OpenPose's `--write_json`: a file per frame, `NAME_000000000012_keypoints.json`, with `people`.
//! Each has `pose_keypoints_2d`: x, y and confidence of the 25 points of `BODY_25`, zeros where a point
//! was not seen; with `--hand` also `hand_left_keypoints_2d` and `hand_right_keypoints_2d`, of 21 points
//! each. People are in no order; `person_id` is -1 unless OpenPose follows them.

use super::detections::{Detection, Detections, FrameDetections, flat, numbers_in};
use super::form::{DetectorForm, RecognisedBy};
use super::hands;
use super::series::FrameNumber;
use crate::ImportError;
use crate::source::{Faulty, Part, Source};
use yoto_pose::KeyPointSet;

/// The end of its files' names.
pub(super) const ENDING: &str = "_keypoints.json";
/// Points of `BODY_25`.
const POINTS: usize = 25;

pub(super) static FORM: DetectorForm = DetectorForm {
    detector: Some("OpenPose"),
    fits: RecognisedBy::Ending(ENDING),
    read: |file| read(file.source, file.given),
};

/// The files of the folder, or those of one take: of the file `given`.
fn read(source: &Source, given: Option<&str>) -> Result<Detections, ImportError> {
    let (mut frames, mut faulty) = (Vec::new(), Faulty::default());
    let mut files = source.list("", &[ENDING])?;
    let name = |file: &String| file.trim_start_matches('/').to_owned();
    files.retain(|file| {
        given.is_none_or(|given| FrameNumber::Last.is_same_take(&name(file), given))
    });
    for (order, file) in files.iter().enumerate() {
        let file = file.trim_start_matches('/');
        let number = numbers_in(file).last().copied().unwrap_or(order);
        let read = source.data(file, u32::try_from(number).ok());
        let read = read.and_then(|data| {
            let people = data.root().get("people")?;
            let each = (0..people.len()?).map(|at| person(&people.at(at)?));
            each.collect::<Result<Vec<_>, _>>()
        });
        frames.extend(faulty.keep(read)?.map(|people| FrameDetections {
            number,
            image: file.strip_suffix(ENDING).map(|name| format!("{name}.png")),
            people,
        }));
    }
    let mut found = Detections::new("OpenPose", KeyPointSet::OpenPose25, frames);
    found.first = None;
    let names: Vec<String> = files.iter().map(name).collect();
    let clash = FrameNumber::Last.clash(names.iter().map(String::as_str));
    found.clash = clash.map(|clash| clash.map(|at| names.get(at).cloned().unwrap_or_default()));
    hands::settle(&mut found);
    faulty.finish(&mut found.notes)?;
    Ok(found)
}

fn person(part: &Part<'_>) -> Result<Detection, ImportError> {
    let points = part.get("pose_keypoints_2d")?;
    let values = points.unchecked()?.values;
    if values.len() != 3 * POINTS {
        let message = format!(
            "{} numbers: 75 are needed, three per point of BODY_25 (--model_pose BODY_25)",
            values.len()
        );
        return Err(points.fault("SIZE_MISMATCH", message));
    }
    let number = match part.find("person_id") {
        Some(id) => id.vector()?.first().copied().filter(|id| *id >= 0.0),
        None => None,
    };
    let hand = |name: &str| match part.find(name) {
        Some(hand) if hand.len()? > 0 => flat(&hand, hands::POINTS),
        _ => Ok(Vec::new()),
    };
    let [left, right] = [
        hand("hand_left_keypoints_2d")?,
        hand("hand_right_keypoints_2d")?,
    ];
    let mut picture = flat(&points, POINTS)?;
    picture.extend(hands::knuckles(&left, &right));
    Ok(Detection {
        hands: [None, None],
        face: None,
        mask: None,
        own: None,
        person: number.map(|number| number.to_string()),
        picture,
        space: Vec::new(),
    })
}
