//! MediaPipe's landmarks as JSON: a list of frames (or `frames`) with `pose_landmarks` (or `landmarks`)
//! and `pose_world_landmarks` (or `world_landmarks`), of dictionaries with x, y, z and visibility, or of
//! rows of these; for several people, lists of such lists. A frame without a detection has no landmarks. The holistic model's
//! `left_hand_landmarks` and `right_hand_landmarks`, and `left_hand_world_landmarks` and so on if they are there, move fingers, and its
//! `face_landmarks` the head, the jaw and the eyelids.

use super::detections::Detections;
use super::form::{DetectorForm, RecognisedBy};
use super::hands::{self, LandmarkHand};
use super::mediapipe::{LandmarkFrame, NAME, POINTS, Points, any, detections, number};
use crate::ImportError;
use crate::geometry::Vec3;
use crate::source::{Faulty, Part};
use yoto_formats::Value;
use yoto_pose::{FacePoints, KeyPointSet};

const PICTURE: [&str; 2] = ["pose_landmarks", "landmarks"];
const SPACE: [&str; 2] = ["pose_world_landmarks", "world_landmarks"];
/// Points of the left and the right hand, in the picture and in space: those of MediaPipe's holistic model.
const HANDS: [[&str; 2]; 2] = [
    ["left_hand_landmarks", "left_hand_world_landmarks"],
    ["right_hand_landmarks", "right_hand_world_landmarks"],
];
/// Landmarks of the face, and their number with the irises.
const FACE: &str = "face_landmarks";
const WITH_IRISES: usize = 478;

pub(super) static FORM: DetectorForm = DetectorForm {
    detector: None,
    fits: RecognisedBy::Contents(fits),
    read: |file| read(&file.data()?.root(), file.size),
};

/// Whether these are such frames.
fn fits(root: &Part<'_>) -> bool {
    list(root)
        .at(0)
        .is_ok_and(|first| any(&first, &PICTURE).is_some())
}

fn list<'a>(root: &Part<'a>) -> Part<'a> {
    root.find("frames").unwrap_or_else(|| root.clone())
}

/// The frames, of pictures of `size`.
fn read(root: &Part<'_>, size: [u32; 2]) -> Result<Detections, ImportError> {
    let list = list(root);
    let (mut rows, mut faulty) = (Vec::new(), Faulty::default());
    for at in 0..list.len()? {
        let entry = list.at(at)?;
        let numbered = number(&entry)?;
        let number = numbered.unwrap_or(at);
        let entry = entry.of_frame(u32::try_from(number).unwrap_or(u32::MAX));
        rows.push(LandmarkFrame {
            number,
            is_numbered: numbered.is_some(),
            people: faulty.keep(of_frame(&entry))?.unwrap_or_default(),
            hands: faulty.keep(hands(&entry))?.unwrap_or_default(),
            face: faulty.keep(face(&entry))?.flatten(),
        });
    }
    let given = match root.find("size") {
        Some(part) => Some(part.fixed::<2>()?),
        None => None,
    };
    let found = detections(rows, NAME, KeyPointSet::BlazePose33, given, size);
    let mut found = found.map_err(|message| root.fault("SIZE_MISMATCH", message))?;
    faulty.finish(&mut found.notes)?;
    Ok(found)
}

/// The landmarks of the people of a frame, in the picture and in space.
fn of_frame(entry: &Part<'_>) -> Result<Vec<Points>, ImportError> {
    let picture = people(any(entry, &PICTURE), POINTS)?;
    let space = people(any(entry, &SPACE), POINTS)?;
    if !space.is_empty() && space.len() != picture.len() {
        let message = format!(
            "{} people in space, {} in the picture",
            space.len(),
            picture.len()
        );
        return Err(entry.fault("SIZE_MISMATCH", message));
    }
    let flat =
        |person: &Vec<[f64; 4]>| person.iter().map(|&[x, y, _, sure]| [x, y, sure]).collect();
    let deep = |person: &Vec<[f64; 4]>| -> Vec<Vec3> {
        person.iter().map(|&[x, y, z, _]| [x, y, z]).collect()
    };
    let deep = |at: usize| space.get(at).map(deep).unwrap_or_default();
    let people = picture.iter().enumerate();
    Ok(people
        .map(|(at, person)| (flat(person), deep(at)))
        .collect())
}

/// The hands of a frame's person.
fn hands(entry: &Part<'_>) -> Result<[Option<LandmarkHand>; 2], ImportError> {
    let [left, right] = HANDS.map(|[picture, space]| {
        let points = |name: &str| {
            let all = people(entry.find(name), hands::POINTS)?;
            let first = all.into_iter().next();
            Ok(first.map(|points| points.into_iter().map(|[x, y, z, _]| [x, y, z]).collect()))
        };
        let Some(picture) = points(picture)? else {
            return Ok(None);
        };
        let space = points(space)?;
        Ok(Some(LandmarkHand { picture, space }))
    });
    Ok([left?, right?])
}

/// The face of a frame's person, of the mesh alone or with the irises.
fn face(entry: &Part<'_>) -> Result<Option<Vec<Vec3>>, ImportError> {
    let found = entry.find(FACE);
    let Some(part) = found.filter(|part| !matches!(part.value(), Value::Nothing)) else {
        return Ok(None);
    };
    let count = part.find("landmark").as_ref().unwrap_or(&part).len()?;
    let expected = if count == WITH_IRISES {
        count
    } else {
        FacePoints::MESH
    };
    let all = people(Some(part), expected)?;
    let first = all.into_iter().next();
    Ok(first.map(|points| points.into_iter().map(|[x, y, z, _]| [x, y, z]).collect()))
}

/// The landmarks of each person, or hand, of `points` points: x, y, z, visibility.
fn people(part: Option<Part<'_>>, points: usize) -> Result<Vec<Vec<[f64; 4]>>, ImportError> {
    let Some(part) = part.filter(|part| !matches!(part.value(), Value::Nothing)) else {
        return Ok(Vec::new());
    };
    // The newer interface gives {"landmark": […]}.
    let part = part.find("landmark").unwrap_or(part);
    let count = part.len()?;
    if count == 0 {
        return Ok(Vec::new());
    }
    let first = part.at(0)?;
    let is_nested = first.is_list() && first.at(0).is_ok_and(|inner| inner.number().is_err());
    if !is_nested {
        return Ok(vec![person(&part, points)?]);
    }
    (0..count).map(|at| person(&part.at(at)?, points)).collect()
}

fn person(part: &Part<'_>, points: usize) -> Result<Vec<[f64; 4]>, ImportError> {
    let count = part.len()?;
    if count != points {
        let message = format!("{count} landmarks instead of {points}");
        return Err(part.fault("SIZE_MISMATCH", message));
    }
    (0..count).map(|at| landmark(&part.at(at)?)).collect()
}

fn landmark(part: &Part<'_>) -> Result<[f64; 4], ImportError> {
    if part.is_list() {
        return match part.unchecked()?.values[..] {
            [x, y, z] => Ok([x, y, z, 1.0]),
            [x, y, z, sure] => Ok([x, y, z, sure]),
            _ => Err(part.fault("SIZE_MISMATCH", "a landmark has x, y, z and a visibility")),
        };
    }
    // Null where the writer had a number that is not finite.
    let axis = |name: &str| {
        let axis = part.get(name)?;
        if axis.is_nothing() {
            Ok(f64::NAN)
        } else {
            axis.number()
        }
    };
    let sure = match part.find("visibility") {
        Some(sure) => sure.number()?,
        None => 1.0,
    };
    Ok([axis("x")?, axis("y")?, axis("z")?, sure])
}
