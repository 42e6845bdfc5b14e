//! The one person of a matte.

use crate::output::Coverage;
use image::{ImageBuffer, Luma, imageops};
use yoto_landmarks::{PERSON, clean, parts};

/// Least share of a part inside the person's expected mask. Parts of other people are beside it.
const OF_THE_PERSON: f64 = 0.3;
/// Largest hole that is closed, as a share of the person. Gaps between arm and body are larger.
const HOLE: f64 = 0.001;

/// Keeps the parts of one person in the coverage, with small holes closed: the parts in `expected` (a mask
/// `[height, width]` with its width and height), or the largest part. Without a person the coverage is cleared.
pub(crate) fn one(coverage: &mut Coverage, expected: Option<(&[u8], [usize; 2])>) {
    let is_person: Vec<bool> = coverage.levels.iter().map(|it| *it >= PERSON).collect();
    let parts = parts(&is_person, coverage.columns);
    let people = parts.iter().filter(|part| is_person[part[0]]);
    let chosen: Vec<&Vec<usize>> = match expected {
        None => people.max_by_key(|part| part.len()).into_iter().collect(),
        Some((mask, size)) => {
            let is_expected = |at: usize| {
                let of = |cell: usize, cells: usize, pixels: usize| {
                    ((2 * cell + 1) * pixels / (2 * cells)).min(pixels.saturating_sub(1))
                };
                let column = of(at % coverage.columns, coverage.columns, size[0]);
                let row = of(at / coverage.columns, coverage.rows, size[1]);
                mask.get(row * size[0] + column).is_some_and(|it| *it > 127)
            };
            people
                .filter(|part| {
                    let inside = part.iter().filter(|at| is_expected(**at)).count();
                    inside as f64 >= OF_THE_PERSON * part.len() as f64
                })
                .collect()
        }
    };
    let pixels: usize = chosen.iter().map(|part| part.len()).sum();
    let hole = (HOLE * pixels as f64) as usize;
    let chosen = chosen.into_iter().flatten().copied();
    let chosen: Vec<usize> = chosen.collect();
    clean(
        &mut coverage.levels,
        coverage.columns,
        &parts,
        &chosen,
        hole,
    );
}

/// The coverage of each pixel of a picture of `size` (width, height), from 0 to 255.
pub(crate) fn stretched(coverage: Coverage, [width, height]: [usize; 2]) -> Option<Vec<u8>> {
    let Coverage {
        rows,
        columns,
        levels,
    } = coverage;
    let image: ImageBuffer<Luma<f32>, _> =
        ImageBuffer::from_raw(columns as u32, rows as u32, levels)?;
    let filter = imageops::FilterType::Triangle;
    let image = imageops::resize(&image, width as u32, height as u32, filter);
    let level = |level: &f32| (level.clamp(0.0, 1.0) * 255.0).round() as u8;
    Some(image.as_raw().iter().map(level).collect())
}
