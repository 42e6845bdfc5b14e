//! The picture sheet of refined poses: frames with the skeleton as given, above the same frames with
//! the skeleton as a training has refined it.

use super::canvas::Colour;
use super::text;
use super::tiles::{self, CAPTION, SIDE};
use crate::capture_dir::DecodedCapture;
use anyhow::{Context, ensure};
use image::{GenericImage, Rgb, RgbImage};
use std::collections::HashMap;
use yoto_capture::check::Drawing;
use yoto_proto::pose_track::PoseTrack;

/// Frames on the sheet, at most.
const COLUMNS: usize = 6;
const GAP: u32 = 10;
/// Letters are drawn at twice their size.
const SCALE: u32 = 2;
const LINE: u32 = SCALE * text::LETTER + 6;
const PAPER: Colour = Rgb([24, 24, 28]);
const INK: Colour = Rgb([225, 225, 230]);

/// The sheet of `capture` and its poses as `refined`.
///
/// # Errors
/// Tracks of different frames; a frame that can't be read.
pub fn refined_sheet(capture: &DecodedCapture, refined: &PoseTrack) -> anyhow::Result<RgbImage> {
    let given = capture.capture.track();
    let indices =
        |track: &PoseTrack| -> Vec<u32> { track.frames.iter().map(|frame| frame.index).collect() };
    ensure!(
        indices(given) == indices(refined) && given.image_size == refined.image_size,
        "the refined poses are not of the frames of {}",
        capture.name
    );
    let count = given.frames.len();
    let columns = COLUMNS.min(count);
    let positions: Vec<usize> = (0..columns)
        .map(|i| (2 * i + 1) * count / (2 * columns))
        .collect();
    let mut pictures = HashMap::new();
    capture.capture.frames(&positions, |position, frame| {
        pictures.insert(position, frame);
    })?;
    let row = LINE + SIDE + CAPTION + GAP;
    let width = GAP + columns as u32 * (SIDE + GAP);
    let mut page = RgbImage::from_pixel(width, GAP + 2 * row, PAPER);
    for (at, (title, track)) in (0..).zip([("poses as given", given), ("refined", refined)]) {
        let y = GAP + at * row;
        text::write(&mut page, GAP, y, SCALE, INK, title);
        for (column, position) in (0..).zip(&positions) {
            let index = track.frames[*position].index;
            let picture = pictures.get(position);
            let picture = picture.with_context(|| format!("frame {index} has no picture"))?;
            let drawing = Drawing::of(track, *position)?;
            let tile = tiles::tile(picture, &drawing, index);
            // The page has room for all columns of both rows.
            page.copy_from(&tile, GAP + column * (SIDE + GAP), y + LINE)?;
        }
    }
    Ok(page)
}
