//! Points of any detector, read by their shape and their names: what browsers, scripts and notebooks write.
//!
//! A file is a list of frames, an array of them, or a dictionary of them by number. A frame is a body, or a list of
//! bodies. A body is
//!
//! - `[N, 2]`, `[N, 3]` or `[N, 4]`: x, y, then depth or score, then score; or as many numbers in a row;
//! - a list of `{x, y, z, score, name}`, or a dictionary of `{x, y}` by the points' names or numbers;
//! - a dictionary with one of these as `keypoints`, `landmarks`, `points`, or as OpenPose calls it.
//!
//! The set follows from the names, else from `--points`, else from the number of points.

use super::detections::{Detections, SURE};
use super::form::{DetectorForm, RecognisedBy};
use super::mediapipe::{LandmarkFrame, any, detections, number};
use super::point_set::{NAME, PointSet, plain};
use crate::ImportError;
use crate::source::{Faulty, Part};
use yoto_formats::Value;

/// Names of the list of frames in a dictionary.
const FRAMES: [&str; 7] = [
    "frames",
    "keypoints",
    "landmarks",
    "poses",
    "points",
    "results",
    "data",
];
/// Names of the people of a frame.
const PEOPLE: [&str; 3] = ["people", "persons", "poses"];
/// Names of the points of a body.
const POINTS: [&str; 8] = [
    "keypoints",
    "landmarks",
    "points",
    "pose_keypoints_2d",
    "keypoints2D",
    "pose_landmarks",
    "pose",
    "keypoints_2d",
];
/// Names of a point's score.
const SCORES: [&str; 5] = ["score", "visibility", "confidence", "conf", "c"];
/// Fewest and most points of a body.
const COUNTS: std::ops::RangeInclusive<usize> = 12..=200;
/// Number of frames that are read to recognise a file.
const LOOKED_AT: usize = 5;
/// Arrays of body models, whose poses may have the shape of points.
const BODY_MODELS: [&str; 5] = ["trans", "transl", "betas", "global_orient", "thetas"];
/// The middle of the hips is this close to the origin, half of the time, where points are in space around it: metres, in which a body
/// reaches no farther than [`REACH`].
const AT_HIPS: f64 = 0.05;
const REACH: f64 = 3.0;
/// Scores of heat maps pass 1, and 0, by as much.
const SCORES_PASS: f64 = 0.5;

/// A point: x, y, a third number, and a score. A missing number is NaN.
type Point = [f64; 4];

/// The points of a body, with their names if the file has names.
struct NamedPoints {
    names: Vec<String>,
    points: Vec<Point>,
}

/// A frame: its number, if the file has it, and its people; `None` if the value does not have the shape of people.
type NumberedPeople = (Option<usize>, Option<Vec<NamedPoints>>);

pub(super) static FORM: DetectorForm = DetectorForm {
    detector: None,
    fits: RecognisedBy::Contents(fits),
    read: |file| read(&file.data()?.root(), file.points, file.size),
};

/// Whether this has the shape of frames of points.
fn fits(root: &Part<'_>) -> bool {
    if BODY_MODELS.iter().any(|name| root.find(name).is_some()) {
        return false;
    }
    let frames = frames(root, LOOKED_AT).unwrap_or_default();
    let people = || frames.iter().flat_map(|(_, people)| people).flatten();
    let are_known = people().all(|body| COUNTS.contains(&body.points.len()));
    frames.iter().all(|(_, people)| people.is_some()) && are_known && people().next().is_some()
}

/// The people of all frames, of pictures of `size`, in the set `given` or the one that the file shows.
fn read(
    root: &Part<'_>,
    given: Option<PointSet>,
    size: [u32; 2],
) -> Result<Detections, ImportError> {
    let mut faulty = Faulty::default();
    let mut all = Vec::new();
    let frames = frames(root, usize::MAX);
    let frames = frames.ok_or_else(|| root.fault("UNKNOWN", "no frames of points"))?;
    for (at, (number, people)) in frames.into_iter().enumerate() {
        let frame = number.unwrap_or(at);
        let people = people.ok_or_else(|| {
            let frame = root
                .clone()
                .of_frame(u32::try_from(frame).unwrap_or(u32::MAX));
            frame.fault("SIZE_MISMATCH", "no points of a person")
        });
        all.push((number, faulty.keep(people)?.unwrap_or_default()));
    }
    let bodies = || all.iter().flat_map(|(_, people)| people);
    let set = match given {
        Some(set) => set,
        None => told(bodies()).map_err(|message| root.fault("UNKNOWN", message))?,
    };
    let third = third(bodies().flat_map(|body| &body.points));
    let (fitted, order) = set.fitted();
    let names = set.names();
    let mut rows = Vec::new();
    for (at, (number, people)) in all.iter().enumerate() {
        let mut row = LandmarkFrame {
            number: number.unwrap_or(at),
            is_numbered: number.is_some(),
            ..LandmarkFrame::default()
        };
        for body in people {
            let points: Vec<Point> = if body.names.is_empty() {
                body.points.clone()
            } else {
                let named = |name: &&str| {
                    let at = body.names.iter().position(|other| other == name);
                    at.and_then(|at| body.points.get(at))
                        .copied()
                        .unwrap_or([f64::NAN; 4])
                };
                names.iter().map(named).collect()
            };
            let frame = root
                .clone()
                .of_frame(u32::try_from(row.number).unwrap_or(u32::MAX));
            let counted = match points.len() == set.count() {
                true => Ok(()),
                false => {
                    let message = format!(
                        "{} points: {} has {}",
                        points.len(),
                        set.word(),
                        set.count()
                    );
                    Err(frame.fault("SIZE_MISMATCH", message))
                }
            };
            if faulty.keep(counted)?.is_none() {
                continue;
            }
            let seen = |at: &usize| points.get(*at).map(|point| seen(point, third));
            row.people
                .push((order.iter().filter_map(seen).collect(), Vec::new()));
        }
        rows.push(row);
    }
    let hips = ["left_hip", "right_hip"].map(|hip| names.iter().position(|name| *name == hip));
    let middles = bodies()
        .filter(|body| body.names.is_empty())
        .filter_map(|body| {
            let is_seen = |it: &&Point| it[0].is_finite() && (it[0], it[1]) != (0.0, 0.0);
            let hip = |at: usize| body.points.get(hips[at]?).filter(is_seen);
            let (left, right) = (hip(0)?, hip(1)?);
            Some(((left[0] + right[0]) / 2.0).hypot((left[1] + right[1]) / 2.0))
        });
    let mut away: Vec<f64> = middles.collect();
    away.sort_by(f64::total_cmp);
    let reach = bodies()
        .flat_map(|body| &body.points)
        .map(|[x, y, ..]| x.abs().max(y.abs()));
    let in_metres = reach.filter(|it| it.is_finite()).all(|it| it < REACH);
    if in_metres && away.get(away.len() / 2).is_some_and(|away| *away < AT_HIPS) {
        let message = "these are points in space, around the hips: those of the picture are needed (pixels, or \
                       shares of its width and height)";
        return Err(root.fault("UNSUITABLE", message));
    }
    let of = match third {
        Third::Score => "x, y and score",
        Third::Depth => "x, y and depth, which is not read",
        Third::Nothing => "x and y",
    };
    let note = format!(
        "read by their shape: {} frames of {} points of {of}, taken as {} (--points for another set)",
        all.len(),
        set.count(),
        set.word()
    );
    let found = detections(rows, NAME, fitted, None, size);
    let mut found = found.map_err(|message| root.fault("SIZE_MISMATCH", message))?;
    found.notes.push(note);
    faulty.finish(&mut found.notes)?;
    Ok(found)
}

/// The meaning of the third of three numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Third {
    Nothing,
    Score,
    Depth,
}

/// Numbers from 0 to 1 are scores, and so are those that pass these rarely, as scores of heat maps do, if most points were seen well.
/// Zeros alone say nothing.
fn third<'a>(points: impl Iterator<Item = &'a Point>) -> Third {
    let shown = points.filter(|it| it[2].is_finite() && (it[0], it[1]) != (0.0, 0.0));
    let mut all: Vec<f64> = shown.map(|point| point[2]).collect();
    if all.iter().all(|third| *third == 0.0) {
        return Third::Nothing;
    }
    all.sort_by(f64::total_cmp);
    let share = |count: usize| count as f64 / all.len() as f64;
    let scores = all
        .iter()
        .filter(|it| (-SCORES_PASS..=1.0 + SCORES_PASS).contains(*it));
    let below = all.iter().filter(|it| **it < -0.01).count();
    let median = all.get(all.len() / 2).copied().unwrap_or_default();
    let exact = all.iter().all(|it| (0.0..=1.0).contains(it));
    match exact || share(scores.count()) >= 0.99 && share(below) < 0.05 && median > SURE {
        true => Third::Score,
        false => Third::Depth,
    }
}

/// x, y and score; 1 if the file has no scores, 0 for a point that the file lacks or that is at 0, 0, where detectors put what they
/// don't see.
fn seen(&[x, y, number, score]: &Point, third: Third) -> [f64; 3] {
    if x.is_nan() && y.is_nan() || (x, y) == (0.0, 0.0) {
        return [0.0; 3];
    }
    let sure = match third {
        _ if score.is_finite() => score,
        Third::Score if number.is_finite() => number,
        _ => 1.0,
    };
    [x, y, sure.clamp(0.0, 1.0)]
}

/// The set of the bodies, by names, else by count.
fn told<'a>(bodies: impl Iterator<Item = &'a NamedPoints>) -> Result<PointSet, String> {
    let Some(body) = bodies.max_by_key(|body| body.points.len()) else {
        return Err("no frame shows anybody".to_owned());
    };
    let by_names = PointSet::of_names(&body.names);
    by_names.or_else(|| match body.names.is_empty() {
        true => PointSet::of_count(body.points.len()),
        false => None,
    }).ok_or_else(|| {
        format!(
            "frames of {} points{}: which are they? Give the set (--points coco17, body25, blazepose33 or halpe26)",
            body.points.len(),
            body.names.first().map_or(String::new(), |name| format!(", such as '{name}'"))
        )
    })
}

/// The first `most` frames; `None` if the value has none.
fn frames(root: &Part<'_>, most: usize) -> Option<Vec<NumberedPeople>> {
    if let Some(inside) = any(root, &FRAMES) {
        return frames(&inside, most);
    }
    if let Value::Array(array) = root.value() {
        let (_, shape) = array.shape.split_first()?;
        let size = shape.iter().product::<usize>().max(1);
        let of_frame = |values: &[f64]| match *shape {
            [_, count, width] => {
                let people = values.chunks_exact(count * width);
                people
                    .map(|values| of_numbers(&[count, width], values))
                    .collect()
            }
            _ => of_numbers(shape, values).map(|body| vec![body]),
        };
        let values = array.values.chunks_exact(size).take(most);
        return Some(values.map(|values| (None, of_frame(values))).collect());
    }
    if let Ok(count) = root.len() {
        let frame = |at: usize| {
            let frame = root.at(at).ok()?;
            Some((number(&frame).ok().flatten(), people(&frame)))
        };
        return (0..count.min(most)).map(frame).collect();
    }
    let members = root.members().ok()?;
    let frame =
        |(name, frame): &(String, Part<'_>)| Some((Some(name.parse().ok()?), people(frame)));
    let frames: Option<Vec<NumberedPeople>> = members.iter().take(most).map(frame).collect();
    frames.map(|mut frames| {
        frames.sort_by_key(|(number, _)| *number);
        frames
    })
}

/// The people of a frame; `None` if the value does not have the shape of people.
fn people(frame: &Part<'_>) -> Option<Vec<NamedPoints>> {
    if frame.is_nothing() {
        return Some(Vec::new());
    }
    if let Some(people) = any(frame, &PEOPLE) {
        return self::people(&people);
    }
    if let Some(body) = body(frame) {
        return Some(vec![body]);
    }
    let count = frame.len().ok()?;
    (0..count).map(|at| body(&frame.at(at).ok()?)).collect()
}

/// The points of a body; `None` if `part` is not a body.
fn body(part: &Part<'_>) -> Option<NamedPoints> {
    if let Some(points) = any(part, &POINTS) {
        return body(&points);
    }
    if let Some(array) = part.value().numbers() {
        return of_numbers(&array.shape, &array.values);
    }
    let members = match part.value().entries() {
        Some(_) => part.members().ok()?,
        None => {
            let count = part.len().ok()?;
            let named = |at: usize| {
                let point = part.at(at).ok()?;
                let name = any(&point, &["name", "part"]).and_then(|name| name.text().ok());
                Some((name.unwrap_or_default().to_owned(), point))
            };
            (0..count).map(named).collect::<Option<Vec<_>>>()?
        }
    };
    let points: Option<Vec<Point>> = members.iter().map(|(_, part)| point(part)).collect();
    let points = points?;
    let numbers: Option<Vec<usize>> = members.iter().map(|(name, _)| name.parse().ok()).collect();
    match numbers {
        // By number, in any order.
        Some(numbers) => {
            let mut sorted = vec![[f64::NAN; 4]; numbers.iter().max()? + 1];
            if sorted.len() > *COUNTS.end() {
                return None;
            }
            numbers
                .iter()
                .zip(points)
                .for_each(|(at, point)| sorted[*at] = point);
            Some(NamedPoints {
                names: Vec::new(),
                points: sorted,
            })
        }
        None if members.iter().all(|(name, _)| name.is_empty()) => Some(NamedPoints {
            names: Vec::new(),
            points,
        }),
        None => Some(NamedPoints {
            names: members.iter().map(|(name, _)| plain(name)).collect(),
            points,
        }),
    }
}

/// `[N, 2]` to `[N, 4]`, `[1, N, …]`, or these numbers in a row.
fn of_numbers(shape: &[usize], values: &[f64]) -> Option<NamedPoints> {
    let width = match *shape {
        [1, _, width @ 2..=4] | [_, width @ 2..=4] => width,
        [count] | [1, count] => (2..=4)
            .rev()
            .find(|width| count % width == 0 && PointSet::of_count(count / width).is_some())?,
        _ => return None,
    };
    let point =
        |values: &[f64]| std::array::from_fn(|at| values.get(at).copied().unwrap_or(f64::NAN));
    Some(NamedPoints {
        names: Vec::new(),
        points: values.chunks_exact(width).map(point).collect(),
    })
}

/// A point of a dictionary, or of two to four numbers.
fn point(part: &Part<'_>) -> Option<Point> {
    if let Some(array) = part.value().numbers() {
        return match array.values[..] {
            [x, y] => Some([x, y, f64::NAN, f64::NAN]),
            [x, y, third] => Some([x, y, third, f64::NAN]),
            [x, y, third, score] => Some([x, y, third, score]),
            _ => None,
        };
    }
    let part = part.find("position").unwrap_or_else(|| part.clone());
    let number = |part: Option<Part<'_>>| match part.map(|part| part.value().clone()) {
        None | Some(Value::Nothing) => Some(f64::NAN),
        Some(Value::Number(number)) => Some(number),
        Some(_) => None,
    };
    let (x, y) = (part.find("x")?, part.find("y")?);
    Some([
        number(Some(x))?,
        number(Some(y))?,
        f64::NAN,
        number(any(&part, &SCORES))?,
    ])
}
