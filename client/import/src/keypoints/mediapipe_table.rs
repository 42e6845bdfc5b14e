//! MediaPipe's landmarks as CSV: a line per frame, its number, then x, y, z and visibility (or only x, y
//! and z) of the 33 landmarks. A first line of names is passed over. There are no depths that a fit
//! could use: z of these is a share of the picture's width.

use super::detections::Detections;
use super::form::{DetectorForm, RecognisedBy};
use super::mediapipe::{LandmarkFrame, NAME, POINTS, detections};
use crate::ImportError;
use crate::source::{Faulty, Source};
use yoto_pose::KeyPointSet;

pub(super) static FORM: DetectorForm = DetectorForm {
    detector: None,
    fits: RecognisedBy::Table(fits),
    read: |file| read(file.source, file.name, file.size),
};

/// Whether `file` has as many columns as there are landmarks.
fn fits(source: &Source, file: &str) -> Result<bool, ImportError> {
    let bytes = source.bytes(file, None)?;
    let line = bytes
        .split(|byte| *byte == b'\n')
        .next()
        .unwrap_or_default();
    let columns = line.iter().filter(|byte| **byte == b',').count();
    Ok(columns == 3 * POINTS || columns == 4 * POINTS)
}

/// The lines of `file`, of pictures of `size`.
fn read(source: &Source, file: &str, size: [u32; 2]) -> Result<Detections, ImportError> {
    let bytes = source.bytes(file, None)?;
    let text = std::str::from_utf8(&bytes)
        .map_err(|error| source.fault("UNREADABLE", file, None, "", error.to_string()))?;
    let (mut rows, mut faulty) = (Vec::new(), Faulty::default());
    for (at, line) in text.lines().enumerate() {
        let line = line.trim();
        let is_head =
            at == 0 && line.contains(|c: char| c.is_ascii_alphabetic() && !"naninfe".contains(c));
        if line.is_empty() || is_head {
            continue;
        }
        let row = row(line).map_err(|message| {
            source.fault(
                "SIZE_MISMATCH",
                file,
                None,
                format!("line {}", at + 1),
                message,
            )
        });
        rows.extend(faulty.keep(row)?);
    }
    let found = detections(rows, NAME, KeyPointSet::BlazePose33, None, size);
    let mut found =
        found.map_err(|message| source.fault("SIZE_MISMATCH", file, None, "", message))?;
    faulty.finish(&mut found.notes)?;
    Ok(found)
}

fn row(line: &str) -> Result<LandmarkFrame, String> {
    // An empty cell is of a landmark that was not seen.
    let number = |cell: &str| {
        if cell.is_empty() {
            Ok(f64::NAN)
        } else {
            cell.parse::<f64>()
        }
    };
    let cells = line.split(',').map(|cell| number(cell.trim()));
    let numbers: Result<Vec<f64>, _> = cells.collect();
    let numbers = numbers.map_err(|_| "not all of it are numbers".to_owned())?;
    let Some((&number, values)) = numbers.split_first() else {
        return Err("there is nothing in it".to_owned());
    };
    if !(number >= 0.0 && number.fract() == 0.0) {
        return Err(format!("{number} is not a frame number"));
    }
    let width = values.len() / POINTS;
    if values.len() != width * POINTS || !(3..=4).contains(&width) {
        return Err(format!(
            "{} numbers after the frame's: 33 landmarks have 99, or 132 with visibility",
            values.len()
        ));
    }
    let point = |values: &[f64]| match *values {
        [x, y, _, sure] => [x, y, sure],
        [x, y, _] => [x, y, 1.0],
        _ => [0.0; 3],
    };
    Ok(LandmarkFrame {
        number: number as usize,
        is_numbered: true,
        people: vec![(values.chunks_exact(width).map(point).collect(), Vec::new())],
        ..LandmarkFrame::default()
    })
}
