//! Points as a table with a line per point, as notebooks write it: a first line of names, of which one is the frame's,
//! one the point's (its number or name), and two are x and y; or with a line per frame and columns `NAME_x`, `NAME_y` of
//! named points.

use super::detections::Detections;
use super::form::{DetectorForm, RecognisedBy};
use super::mediapipe::{LandmarkFrame, detections};
use super::point_set::{NAME, PointSet, plain};
use crate::ImportError;
use crate::source::{Faulty, Source};
use std::collections::BTreeMap;

const FRAME: [&str; 7] = [
    "frame",
    "frame_id",
    "frameid",
    "frame_index",
    "frame_number",
    "frame_no",
    "image_id",
];
const POINT: [&str; 11] = [
    "landmark_id",
    "landmarkid",
    "landmark",
    "landmark_index",
    "landmark_name",
    "keypoint",
    "keypoint_id",
    "point",
    "joint",
    "name",
    "id",
];
const SCORE: [&str; 5] = ["visibility", "score", "confidence", "conf", "v"];

/// The columns of a table.
struct Columns {
    frame: Option<usize>,
    layout: Layout,
}

enum Layout {
    /// A line per point.
    Long {
        point: usize,
        /// x, y, score.
        at: [Option<usize>; 3],
    },
    /// A line per frame, with x, y and score of points by name.
    Wide(Vec<(String, [Option<usize>; 3])>),
}

pub(super) static FORM: DetectorForm = DetectorForm {
    detector: None,
    fits: RecognisedBy::Table(fits),
    read: |file| read(file.source, file.name, file.points, file.size),
};

/// Whether the first line of `file` names such columns.
fn fits(source: &Source, file: &str) -> Result<bool, ImportError> {
    let bytes = source.bytes(file, None)?;
    let text = String::from_utf8_lossy(&bytes);
    Ok(text.lines().next().and_then(columns).is_some())
}

fn columns(line: &str) -> Option<Columns> {
    let names: Vec<String> = line
        .trim_start_matches('\u{feff}')
        .split(',')
        .map(|name| plain(name.trim().trim_matches('"')))
        .collect();
    let find = |wanted: &[&str]| names.iter().position(|name| wanted.contains(&&**name));
    let frame = find(&FRAME);
    if let (Some(_), Some(point), Some(x), Some(y)) =
        (frame, find(&POINT), find(&["x"]), find(&["y"]))
    {
        let at = [Some(x), Some(y), find(&SCORE)];
        return Some(Columns {
            frame,
            layout: Layout::Long { point, at },
        });
    }
    let of = |point: &str, ends: &[&str]| {
        let is_it = |name: &String| {
            let rest = name
                .strip_prefix(point)
                .and_then(|rest| rest.strip_prefix('_'));
            rest.is_some_and(|rest| ends.contains(&rest))
        };
        names.iter().position(is_it)
    };
    let points = names.iter().filter_map(|name| name.strip_suffix("_x"));
    let points: Vec<(String, [Option<usize>; 3])> = points
        .map(|name| {
            (
                name.to_owned(),
                [of(name, &["x"]), of(name, &["y"]), of(name, &SCORE)],
            )
        })
        .collect();
    let known: Vec<String> = points.iter().map(|(name, _)| name.clone()).collect();
    PointSet::of_names(&known)?;
    Some(Columns {
        frame,
        layout: Layout::Wide(points),
    })
}

/// The lines of `file`, of pictures of `size`, in the set `given` or the one that the file shows.
fn read(
    source: &Source,
    file: &str,
    given: Option<PointSet>,
    size: [u32; 2],
) -> Result<Detections, ImportError> {
    let bytes = source.bytes(file, None)?;
    let text = String::from_utf8_lossy(&bytes);
    let fault =
        |field: String, message: String| source.fault("SIZE_MISMATCH", file, None, field, message);
    let Some(columns) = text.lines().next().and_then(columns) else {
        return Err(fault("line 1".into(), "no names of columns".into()));
    };
    let mut faulty = Faulty::default();
    // By frame, the points by number or name.
    let mut frames: BTreeMap<usize, BTreeMap<String, [f64; 3]>> = BTreeMap::new();
    for (at, line) in text
        .lines()
        .enumerate()
        .skip(1)
        .filter(|(_, line)| !line.trim().is_empty())
    {
        let cells: Vec<&str> = line
            .split(',')
            .map(|cell| cell.trim().trim_matches('"'))
            .collect();
        let read = points_of(&columns, &cells, at - 1);
        let read = read.map_err(|message| fault(format!("line {}", at + 1), message));
        if let Some((frame, points)) = faulty.keep(read)? {
            frames.entry(frame).or_default().extend(points);
        }
    }
    let names = || frames.values().flat_map(|points| points.keys());
    let are_numbers = names().all(|name| name.parse::<usize>().is_ok());
    let named: Vec<String> = names().cloned().collect();
    let told = match are_numbers {
        // The highest number is that of the last point.
        true => names()
            .filter_map(|name| name.parse::<usize>().ok())
            .max()
            .and_then(|last| PointSet::of_count(last + 1)),
        false => PointSet::of_names(&named),
    };
    let Some(set) = given.or(told) else {
        let some: Vec<&str> = named.iter().take(3).map(String::as_str).collect();
        return Err(fault(
            "line 1".into(),
            format!(
                "points such as {}: which are they? Give the set (--points coco17, body25, blazepose33 or halpe26)",
                some.join(", ")
            ),
        ));
    };
    let (fitted, order) = set.fitted();
    let keys: Vec<String> = match are_numbers {
        true => (0..set.count()).map(|at| at.to_string()).collect(),
        false => set.names().into_iter().map(str::to_owned).collect(),
    };
    let rows = frames.iter().map(|(number, points)| {
        let seen = |at: &usize| points.get(keys.get(*at)?).copied();
        let picture = order
            .iter()
            .map(|at| seen(at).unwrap_or([0.0; 3]))
            .collect();
        LandmarkFrame {
            number: *number,
            is_numbered: columns.frame.is_some(),
            people: vec![(picture, Vec::new())],
            ..LandmarkFrame::default()
        }
    });
    let found = detections(rows.collect(), NAME, fitted, None, size);
    let mut found = found.map_err(|message| fault(String::new(), message))?;
    found.notes.push(format!(
        "read as a table: {} frames of {} points, taken as {} (--points for another set)",
        frames.len(),
        set.count(),
        set.word()
    ));
    faulty.finish(&mut found.notes)?;
    Ok(found)
}

/// A frame's number, and points with their names or numbers.
type TableRow = (usize, Vec<(String, [f64; 3])>);

/// The frame of a line, and its points: x, y and score, all 0 of what is not seen.
fn points_of(columns: &Columns, cells: &[&str], order: usize) -> Result<TableRow, String> {
    let cell = |at: usize| cells.get(at).copied().unwrap_or_default();
    let number = |at: Option<usize>, absent: f64| -> Result<f64, String> {
        match at.map(cell) {
            None => Ok(absent),
            Some("") => Ok(f64::NAN),
            Some(text) => text
                .parse()
                .map_err(|_| format!("'{text}' is not a number")),
        }
    };
    let point = |at: &[Option<usize>; 3]| -> Result<[f64; 3], String> {
        let found = [
            number(at[0], f64::NAN)?,
            number(at[1], f64::NAN)?,
            number(at[2], 1.0)?,
        ];
        Ok(if found.iter().all(|it| it.is_finite()) {
            found
        } else {
            [0.0; 3]
        })
    };
    let frame = match columns.frame {
        None => order,
        Some(at) => {
            let frame = number(Some(at), 0.0)?;
            if !(frame >= 0.0 && frame.fract() == 0.0) {
                return Err(format!("{frame} is not a frame number"));
            }
            frame as usize
        }
    };
    let points = match &columns.layout {
        Layout::Long { point: name, at } => {
            let name = cell(*name);
            // Some write whole numbers as 3.0.
            let name = name.strip_suffix(".0").unwrap_or(name);
            vec![(plain(name), point(at)?)]
        }
        Layout::Wide(points) => points
            .iter()
            .map(|(name, at)| Ok((name.clone(), point(at)?)))
            .collect::<Result<_, String>>()?,
    };
    Ok((frame, points))
}
