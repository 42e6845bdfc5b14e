//! Masks: the model's mask, cleaned, as coverage of the picture's pixels.

use crate::landmarks::{SIDE, logistic};
use crate::region::Region;
use std::ops::Range;

/// Least level of a pixel of the person.
pub const PERSON: f32 = 0.5;
/// Largest hole that is closed, pixels of the model's mask. Gaps between arm and body are larger.
const SMALL_HOLE: usize = 40;
/// Levels between which coverage rises from 0 to 1: the model's edges are wider than a lens's.
const EDGE: [f32; 2] = [0.25, 0.75];

/// The outline of a person in a picture, as the model gives it.
#[derive(Clone, Debug)]
pub struct Outline {
    /// `[256, 256]`, of the region; empty for nobody.
    logits: Vec<f32>,
    region: Region,
    /// Width and height of the picture, pixels.
    size: [usize; 2],
}

impl Outline {
    pub(crate) fn new(logits: &[f32], region: Region, size: [usize; 2]) -> Self {
        Self {
            logits: logits.to_owned(),
            region,
            size,
        }
    }

    /// The outline of a picture of `size` (width, height) without a person.
    pub fn nobody(size: [usize; 2]) -> Self {
        let [width, height] = size;
        Self::new(&[], Region::whole(width, height), size)
    }

    /// The person's coverage of each pixel of the picture, `[height, width]`, from 0 to 255. It is slow, and the search in
    /// the next picture does not need it.
    pub fn coverage(&self) -> Vec<u8> {
        let [width, height] = self.size;
        if self.logits.is_empty() {
            return vec![0; width * height];
        }
        mask(&self.logits, self.region, width, height)
    }
}

/// The person's coverage of each pixel of a picture, `[height, width]`, from the logits of the model's mask `[256, 256]`
/// of `region`.
fn mask(logits: &[f32], region: Region, width: usize, height: usize) -> Vec<u8> {
    let levels = soften(&largest(logits.iter().copied().map(logistic).collect()));
    let near = near(&levels);
    let to_square = region.squares();
    let mut mask = vec![0; width * height];
    for (y, line) in mask.chunks_exact_mut(width.max(1)).enumerate() {
        for (x, coverage) in line.iter_mut().enumerate() {
            let uv = to_square([x as f32 + 0.5, y as f32 + 0.5]);
            let is_near = uv.iter().zip(&near).all(|(at, near)| near.contains(at));
            if is_near && uv.iter().all(|at| (0.0..1.0).contains(at)) {
                let level = bilinear(&levels, uv);
                let share = (level - EDGE[0]) / (EDGE[1] - EDGE[0]);
                *coverage = (share.clamp(0.0, 1.0) * 255.0).round() as u8;
            }
        }
    }
    mask
}

/// The positions, from 0 to 1 along each side, around which a level is above 0.
fn near(levels: &[f32]) -> [Range<f32>; 2] {
    let (mut least, mut most) = ([SIDE; 2], [0; 2]);
    let above = levels.iter().enumerate().filter(|(_, level)| **level > 0.0);
    for (at, _) in above {
        for (axis, cell) in [at % SIDE, at / SIDE].into_iter().enumerate() {
            least[axis] = least[axis].min(cell);
            most[axis] = most[axis].max(cell);
        }
    }
    // A position takes its level from the two cells with the nearest middles; one cell more is for rounding.
    [0, 1].map(|axis| {
        let from = least[axis] as f32 - 2.0;
        let to = most[axis] as f32 + 3.0;
        from / SIDE as f32..to / SIDE as f32
    })
}

/// Only the largest connected part, with its small holes closed.
fn largest(mut levels: Vec<f32>) -> Vec<f32> {
    let is_person: Vec<bool> = levels.iter().map(|level| *level >= PERSON).collect();
    let parts = parts(&is_person, SIDE);
    let people = parts.iter().filter(|part| is_person[part[0]]);
    let largest = people.max_by_key(|part| part.len());
    let largest = largest.cloned().unwrap_or_default();
    clean(&mut levels, SIDE, &parts, &largest, SMALL_HOLE);
    levels
}

/// Keeps the pixels `chosen` of `levels` (rows of `columns`) and the soft edge around them, and closes holes of at most
/// `hole` pixels in them. `parts` are the connected parts of the levels from [`PERSON`] on and of the rest.
pub fn clean(
    levels: &mut [f32],
    columns: usize,
    parts: &[Vec<usize>],
    chosen: &[usize],
    hole: usize,
) {
    if chosen.is_empty() {
        levels.fill(0.0);
        return;
    }
    let rows = levels.len() / columns.max(1);
    // Only pixels more than two pixels away are cleared, so that the soft edge stays.
    let mut near = vec![false; levels.len()];
    for &at in chosen {
        let (row, column) = (at / columns, at % columns);
        for row in row.saturating_sub(2)..(row + 3).min(rows) {
            near[row * columns + column.saturating_sub(2)
                ..row * columns + (column + 3).min(columns)]
                .fill(true);
        }
    }
    let mut inside = vec![false; levels.len()];
    chosen.iter().for_each(|&at| inside[at] = true);
    let is_person: Vec<bool> = levels.iter().map(|level| *level >= PERSON).collect();
    for ((level, near), (inside, is_person)) in levels
        .iter_mut()
        .zip(near)
        .zip(inside.iter().zip(&is_person))
    {
        if !near || (*is_person && !*inside) {
            *level = 0.0;
        }
    }
    for part in parts.iter().filter(|part| !is_person[part[0]]) {
        let at_border = |at: &usize| {
            let (row, column) = (at / columns, at % columns);
            row == 0 || column == 0 || row + 1 == rows || column + 1 == columns
        };
        if part.len() > hole || part.iter().any(at_border) {
            continue;
        }
        // The pixel above a hole's first pixel belongs to the part around the hole, which may have been removed.
        let above = part.first().and_then(|first| first.checked_sub(columns));
        if above.is_some_and(|above| inside[above]) {
            part.iter().for_each(|&at| levels[at] = 1.0);
        }
    }
}

/// The connected parts of pixels of equal kind that touch at a side; rows have `columns`.
pub fn parts(kinds: &[bool], columns: usize) -> Vec<Vec<usize>> {
    let mut seen = vec![false; kinds.len()];
    let mut parts = Vec::new();
    for start in 0..kinds.len() {
        if std::mem::replace(&mut seen[start], true) {
            continue;
        }
        let mut part = vec![start];
        let mut next = 0;
        while let Some(&at) = part.get(next) {
            next += 1;
            let column = at % columns;
            let left = (column > 0).then(|| at - 1);
            let right = (column + 1 < columns).then_some(at + 1);
            let neighbours = [left, right, at.checked_sub(columns), Some(at + columns)];
            for to in neighbours.into_iter().flatten() {
                if kinds.get(to) == Some(&kinds[start]) && !std::mem::replace(&mut seen[to], true) {
                    part.push(to);
                }
            }
        }
        parts.push(part);
    }
    parts
}

/// The levels after a blur with the weights 1, 2, 1 along both sides.
fn soften(levels: &[f32]) -> Vec<f32> {
    let pass = |levels: &[f32], step: usize, position: fn(usize) -> usize| -> Vec<f32> {
        let blend = |at: usize| {
            let here = levels[at];
            let before = if position(at) > 0 {
                levels[at - step]
            } else {
                here
            };
            let after = if position(at) + 1 < SIDE {
                levels[at + step]
            } else {
                here
            };
            (before + 2.0 * here + after) / 4.0
        };
        (0..levels.len()).map(blend).collect()
    };
    let along_rows = pass(levels, 1, |at| at % SIDE);
    pass(&along_rows, SIDE, |at| at / SIDE)
}

/// The level at a position from 0 to 1, interpolated between the four nearest pixels.
fn bilinear(levels: &[f32], uv: [f32; 2]) -> f32 {
    let [x, y] = uv.map(|at| (at * SIDE as f32 - 0.5).clamp(0.0, (SIDE - 1) as f32));
    let (column, row) = (x as usize, y as usize);
    let (right, down) = (x - column as f32, y - row as f32);
    let line = |row: usize| {
        let line = &levels[row.min(SIDE - 1) * SIDE..][..SIDE];
        line[column] + (line[(column + 1).min(SIDE - 1)] - line[column]) * right
    };
    let (top, bottom) = (line(row), line(row + 1));
    top + (bottom - top) * down
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mask of the model with rectangles (rows, columns) of the given levels.
    fn drawn(rectangles: &[([usize; 4], f32)]) -> Vec<f32> {
        let mut logits = vec![-20.0; SIDE * SIDE];
        for &([top, bottom, left, right], level) in rectangles {
            for row in top..bottom {
                logits[row * SIDE + left..row * SIDE + right].fill(level);
            }
        }
        logits
    }

    fn at(mask: &[u8], row: usize, column: usize) -> u8 {
        mask[row * SIDE + column]
    }

    #[test]
    fn the_largest_part_stays_and_its_small_holes_close() {
        let logits = drawn(&[
            ([50, 200, 100, 160], 20.0),
            ([60, 64, 120, 124], -20.0),
            ([100, 120, 120, 140], -20.0),
            ([50, 60, 20, 40], 20.0),
        ]);
        let mask = mask(&logits, Region::whole(SIDE, SIDE), SIDE, SIDE);
        assert_eq!(at(&mask, 90, 110), 255);
        assert_eq!(at(&mask, 62, 122), 255, "a hole of 16 pixels");
        assert_eq!(at(&mask, 110, 130), 0, "a hole of 400 pixels");
        assert_eq!(at(&mask, 55, 30), 0, "another part");
        assert_eq!(at(&mask, 10, 10), 0);
    }

    #[test]
    fn single_pixels_that_stick_out_are_softened() {
        let logits = drawn(&[([50, 200, 100, 160], 20.0), ([120, 121, 160, 163], 20.0)]);
        let mask = mask(&logits, Region::whole(SIDE, SIDE), SIDE, SIDE);
        assert!(at(&mask, 120, 161) < 160, "{}", at(&mask, 120, 161));
        assert_eq!(at(&mask, 120, 150), 255);
    }

    #[test]
    fn masks_follow_their_region() {
        let region = Region {
            centre: [300.0, 200.0],
            side: 512.0,
            angle: 0.0,
        };
        let logits = drawn(&[([100, 150, 100, 150], 20.0)]);
        let mask = mask(&logits, region, 640, 480);
        // (100, 100) of the region is at 44 + 200 and -56 + 200.
        let at = |x: usize, y: usize| mask[y * 640 + x];
        assert_eq!(at(250, 150), 255);
        assert_eq!(at(335, 235), 255);
        assert_eq!([at(238, 150), at(250, 138), at(350, 150)], [0, 0, 0]);
    }

    #[test]
    fn pixels_far_from_the_person_are_left_out_without_a_difference() {
        let region = Region {
            centre: [90.0, 70.0],
            side: 150.0,
            angle: 0.4,
        };
        let logits = drawn(&[([0, 90, 30, 70], 20.0), ([90, 256, 40, 60], 0.3)]);
        let levels = soften(&largest(logits.iter().copied().map(logistic).collect()));
        let whole = (0..140 * 180).map(|at| {
            let uv = region.to_square([(at % 180) as f32 + 0.5, (at / 180) as f32 + 0.5]);
            if !uv.iter().all(|at| (0.0..1.0).contains(at)) {
                return 0;
            }
            let share = (bilinear(&levels, uv) - EDGE[0]) / (EDGE[1] - EDGE[0]);
            (share.clamp(0.0, 1.0) * 255.0).round() as u8
        });
        let whole: Vec<u8> = whole.collect();
        assert!(whole.contains(&255) && whole.contains(&0));
        assert!(mask(&logits, region, 180, 140) == whole);
    }

    #[test]
    fn no_person_is_no_coverage() {
        let mask = mask(&drawn(&[]), Region::whole(9, 9), 9, 9);
        assert!(mask.iter().all(|coverage| *coverage == 0));
    }
}
