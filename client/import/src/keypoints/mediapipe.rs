//! MediaPipe's 33 landmarks (BlazePose). MediaPipe writes no files: these are what its users write.
//!
//! - `.npz` (here): `landmarks` (or `L`) `[F, 33, 3 or 4]`, and, for depths, `world_landmarks` (or `W`);
//!   optionally `idx`, the frames' numbers, and `size`, width and height.
//! - `.json` ([`super::mediapipe_json`]) and `.csv` ([`super::mediapipe_table`]).
//!
//! Landmarks are shares of the picture, as MediaPipe gives them, or pixels; the fourth number is the
//! visibility. World landmarks are metres around the hips in the camera's axes.

use super::detections::{Detection, Detections, FrameDetections, whole};
use super::form::{DetectorForm, RecognisedBy};
use super::hands::LandmarkHand;
use crate::ImportError;
use crate::geometry::Vec3;
use crate::source::{Part, is_number};
use yoto_pose::{FacePoints, KeyPointSet};

/// The detector's name in notes.
pub(super) const NAME: &str = "MediaPipe";
/// Landmarks of a person.
pub(super) const POINTS: usize = 33;
/// Shares of a picture stay within this, even of points far outside; pixels don't.
const MOST_SHARE: f64 = 5.0;

/// One frame's landmarks, as they are written.
#[derive(Clone, Debug, Default)]
pub(super) struct LandmarkFrame {
    pub number: usize,
    /// Whether the file has the number, and not only the order.
    pub is_numbered: bool,
    pub people: Vec<Points>,
    /// The left and the right hand of a single person, if the file has them.
    pub hands: [Option<LandmarkHand>; 2],
    /// The landmarks of a single person's face, if the file has them: as those of a hand.
    pub face: Option<Vec<Vec3>>,
}

/// A person's points: x, y, visibility; and x, y, z in space, if the file has them.
pub(super) type Points = (Vec<[f64; 3]>, Vec<Vec3>);

/// Names of the arrays.
const PICTURE: [&str; 3] = ["landmarks", "L", "pose_landmarks"];
const SPACE: [&str; 3] = ["world_landmarks", "W", "pose_world_landmarks"];

pub(super) static FORM: DetectorForm = DetectorForm {
    detector: Some("MediaPipe"),
    fits: RecognisedBy::Contents(fits),
    read: |file| read(&file.data()?.root(), file.size),
};

/// Whether these arrays are there.
fn fits(root: &Part<'_>) -> bool {
    any(root, &PICTURE).is_some_and(|part| part.value().items().is_none())
}

/// The first of `names` that is there.
pub(super) fn any<'a>(root: &Part<'a>, names: &[&str]) -> Option<Part<'a>> {
    names.iter().find_map(|name| root.find(name))
}

/// The frames of an archive, of pictures of `size`.
fn read(root: &Part<'_>, size: [u32; 2]) -> Result<Detections, ImportError> {
    let Some(part) = any(root, &PICTURE) else {
        return Err(root.fault("MISSING", "there is no 'landmarks'"));
    };
    let picture = frames(&part)?;
    let space = match any(root, &SPACE) {
        Some(part) => {
            let space = frames(&part)?;
            if space.len() != picture.len() {
                let message = format!("{} frames for {}", space.len(), picture.len());
                return Err(part.fault("SIZE_MISMATCH", message));
            }
            space
        }
        None => vec![Vec::new(); picture.len()],
    };
    let numbered = root.find("idx");
    let is_numbered = numbered.is_some();
    let numbers = match numbered {
        Some(part) => part.numbers(picture.len())?,
        None => (0..picture.len()).collect(),
    };
    let given = match root.find("size") {
        Some(part) => Some(part.fixed::<2>()?),
        None => None,
    };
    let rows = numbers.into_iter().zip(picture.into_iter().zip(space));
    let rows = rows.map(|(number, (picture, space))| LandmarkFrame {
        number,
        is_numbered,
        people: vec![(
            picture
                .iter()
                .map(|&[x, y, _, sure]| [x, y, sure])
                .collect(),
            space.iter().map(|&[x, y, z, _]| [x, y, z]).collect(),
        )],
        ..LandmarkFrame::default()
    });
    let found = detections(rows.collect(), NAME, KeyPointSet::BlazePose33, given, size);
    found.map_err(|message| part.fault("SIZE_MISMATCH", message))
}

/// `[F, 33, 4]`; visibility is 1 if the file has none.
fn frames(part: &Part<'_>) -> Result<Vec<Vec<[f64; 4]>>, ImportError> {
    let array = part.unchecked()?;
    let (rows, width) = match array.shape[..] {
        [rows, POINTS, width @ (3 | 4)] => (rows, width),
        _ => {
            let message = format!("{:?} instead of [frames, 33, 3 or 4]", array.shape);
            return Err(part.fault("SIZE_MISMATCH", message));
        }
    };
    let point = |values: &[f64]| match *values {
        [x, y, z, sure] => [x, y, z, sure],
        [x, y, z] => [x, y, z, 1.0],
        _ => [0.0; 4],
    };
    let points: Vec<[f64; 4]> = array.values.chunks_exact(width).map(point).collect();
    Ok(points
        .chunks(POINTS)
        .take(rows)
        .map(<[_]>::to_vec)
        .collect())
}

/// Frames of the points of `set`, in pixels of a picture of `size`; `given` is the size that the file says.
pub(super) fn detections(
    rows: Vec<LandmarkFrame>,
    name: &'static str,
    set: KeyPointSet,
    given: Option<[f64; 2]>,
    size: [u32; 2],
) -> Result<Detections, String> {
    let size = size.map(f64::from);
    let points = || {
        rows.iter()
            .flat_map(|row| &row.people)
            .flat_map(|(points, _)| points)
    };
    let are_shares = points()
        .filter(|point| point.iter().all(|value| value.is_finite()))
        .all(|[x, y, _]| x.abs() < MOST_SHARE && y.abs() < MOST_SHARE);
    let by = match given {
        _ if are_shares => size,
        Some(given) => {
            let by = [size[0] / given[0], size[1] / given[1]];
            // Also refuses a size of 0.
            if !by.iter().all(|by| by.is_finite()) || (by[0] / by[1] - 1.0).abs() > 0.02 {
                return Err(format!(
                    "landmarks of a picture of {}x{}, the clip has {}x{}",
                    given[0], given[1], size[0], size[1]
                ));
            }
            by
        }
        None => [1.0; 2],
    };
    let person = |(points, space): (Vec<[f64; 3]>, Vec<Vec3>)| Detection {
        mask: None,
        own: None,
        hands: [None, None],
        face: None,
        person: None,
        picture: points
            .iter()
            .map(|&[x, y, sure]| [x * by[0], y * by[1], sure.clamp(0.0, 1.0)])
            .collect(),
        space,
    };
    let are_numbered = rows.iter().any(|row| row.is_numbered);
    let frames = rows.into_iter().map(|row| {
        let mut people: Vec<Detection> = row.people.into_iter().map(person).collect();
        if let [only] = &mut people[..] {
            only.hands = row.hands.map(|hand| hand?.points(by));
            only.face = row.face.and_then(|face| face_points(&face, by));
        }
        FrameDetections {
            number: row.number,
            image: None,
            people,
        }
    });
    let mut found = Detections::new(name, set, frames.collect());
    if are_numbered {
        // Users number frames as they like.
        (found.first, found.usual) = (None, 1);
    }
    Ok(found)
}

/// The points of a face in pixels, which are `by` units of the file; `None` with a number that is not finite.
fn face_points(landmarks: &[Vec3], [wide, high]: [f64; 2]) -> Option<FacePoints> {
    let in_pixels = |[x, y, z]: &Vec3| [wide * x, high * y, wide * z];
    let points: Vec<Vec3> = landmarks.iter().map(in_pixels).collect();
    let are_numbers = points.as_flattened().iter().all(|it| is_number(*it));
    FacePoints::of_mesh(&points, 1.0).filter(|_| are_numbers)
}

/// The number of a frame under one of the usual names.
pub(super) fn number(part: &Part<'_>) -> Result<Option<usize>, ImportError> {
    let number = any(part, &["frame", "frame_id", "frame_index", "index", "idx"]);
    number.map(|number| whole(&number)).transpose()
}
