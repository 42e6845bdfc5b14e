//! Frames with back and front mistaken, found by the colours of head and trunk.
//!
//! Motion can't show a mistake in a stretch of frames that begins or ends in profile: it looks like a body
//! that rotates the other way. But colours change with the heading. With h the angle from facing the camera,
//! each colour is about `a + b cos h + d sin h` (front and back; light from a side). If back and front are
//! mistaken, cos h has the wrong sign, and the colours don't fit those of the other frames.

use crate::flips::{cheapest_run, jump};
use crate::markers::{FirstGuessPoints, Markers};
use crate::{FrameKeyPoints, KeyPointSet};
use faer::prelude::Solve;
use faer::{Mat, Side};

/// Number of patches on the body with colours: head, chest and belly.
pub(crate) const PATCHES: usize = 3;
/// Radii of the patches, as shares of the person's extent in the picture.
const RADII: [f64; PATCHES] = [0.035, 0.045, 0.045];
/// Positions of the trunk's patches between shoulders (0) and hips (1).
const ALONG: [f64; 2] = [0.3, 0.75];
/// Fewest frames with colours for a decision.
const FEWEST: usize = 12;
/// Least error of a colour, 0 to 1.
const ERROR: f64 = 0.02;
/// Bound of an error, in standard deviations, so that a hand in front of the body is not taken for its back.
const MOST: f64 = 3.0;
/// Cost of one change between right and wrong frames.
const CHANGE: f64 = 8.0;
/// Largest plausible share of wrong frames.
const LARGEST: f64 = 1.0 / 3.0;
/// Most rounds of fitting colours and choosing wrong frames.
const ROUNDS: usize = 6;

/// Mean colours of the body's patches in a picture `rgb` of `size` (width, height), 0 to 1; empty if a patch
/// is not visible.
pub fn patches(
    set: KeyPointSet,
    frame: &FrameKeyPoints,
    rgb: &[u8],
    size: [usize; 2],
) -> Vec<[f64; 3]> {
    let figure = Markers::of(set).figure;
    let found = centres(&figure, frame).and_then(|centres| {
        let extent = crate::check::extent(frame);
        let patch = |(centre, share): ([f64; 2], f64)| mean(rgb, size, centre, share * extent);
        centres.into_iter().zip(RADII).map(patch).collect()
    });
    found.unwrap_or_default()
}

fn centres(figure: &FirstGuessPoints, frame: &FrameKeyPoints) -> Option<[[f64; 2]; PATCHES]> {
    let at = |point: usize| frame.picture.get(point).filter(|it| it[2] > 0.0);
    let middle = |[left, right]: [usize; 2]| {
        let (a, b) = (at(left)?, at(right)?);
        Some([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])])
    };
    let (top, bottom) = (middle(figure.shoulders)?, middle(figure.hips)?);
    let head = figure.ears.and_then(middle)?;
    let along = |share: f64| [0, 1].map(|i: usize| top[i] + share * (bottom[i] - top[i]));
    Some([head, along(ALONG[0]), along(ALONG[1])])
}

fn mean(
    rgb: &[u8],
    [width, height]: [usize; 2],
    [x, y]: [f64; 2],
    radius: f64,
) -> Option<[f64; 3]> {
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    let radius = radius.max(1.0);
    let rows = (y - radius).max(0.0) as usize..=((y + radius).max(0.0) as usize).min(height - 1);
    for row in rows {
        let columns =
            (x - radius).max(0.0) as usize..=((x + radius).max(0.0) as usize).min(width - 1);
        for column in columns {
            let (dx, dy) = (column as f64 + 0.5 - x, row as f64 + 0.5 - y);
            if dx.hypot(dy) > radius {
                continue;
            }
            let at = 3 * (row * width + column);
            if let Some(pixel) = rgb.get(at..at + 3) {
                for (sum, level) in sum.iter_mut().zip(pixel) {
                    *sum += f64::from(*level) / 255.0;
                }
                count += 1.0;
            }
        }
    }
    (count > 0.0).then(|| sum.map(|it| it / count))
}

/// For each frame, whether back and front are mistaken. `headings` are cosine and sine of the angle from
/// facing the camera, `colours` are those of [`patches`] (empty for frames without), and `times` are seconds.
pub(crate) fn wrong(headings: &[[f64; 2]], colours: &[Vec<[f64; 3]>], times: &[f64]) -> Vec<bool> {
    let mut wrong = vec![false; headings.len()];
    let known: Vec<usize> = (0..headings.len())
        .filter(|at| colours.get(*at).is_some_and(|it| it.len() == PATCHES))
        .collect();
    if known.len() < FEWEST {
        return wrong;
    }
    for _ in 0..ROUNDS {
        let costs = costs(headings, colours, &known, &wrong);
        let change = |step: usize, from: usize, to: usize| {
            let facing = |at: usize, state: usize| {
                let [cos, sin] = headings[at];
                if state == 1 { [-cos, sin] } else { [cos, sin] }
            };
            let (a, b) = (facing(step, from), facing(step + 1, to));
            let angle = (a[0] * b[0] + a[1] * b[1]).clamp(-1.0, 1.0).acos();
            let own = {
                let (a, b) = (facing(step, 0), facing(step + 1, 0));
                (a[0] * b[0] + a[1] * b[1]).clamp(-1.0, 1.0).acos()
            };
            let span = times[step + 1] - times[step];
            let switch = if from == to { 0.0 } else { CHANGE };
            switch + jump(angle, span) - jump(own, span).min(jump(angle, span))
        };
        let run = cheapest_run(&costs, change);
        let next: Vec<bool> = run.iter().map(|state| *state == 1).collect();
        if next == wrong {
            break;
        }
        wrong = next;
    }
    // Colours can't tell which side is the front, so the majority of frames decides.
    let count = wrong.iter().filter(|it| **it).count();
    if count as f64 > LARGEST * wrong.len() as f64 {
        return vec![false; wrong.len()];
    }
    wrong
}

/// The cost of each frame as it is, and reversed.
fn costs(
    headings: &[[f64; 2]],
    colours: &[Vec<[f64; 3]>],
    known: &[usize],
    wrong: &[bool],
) -> Vec<Vec<f64>> {
    let row = |at: usize, turned: bool| {
        let [cos, sin] = headings[at];
        [1.0, if turned { -cos } else { cos }, sin]
    };
    let mut costs = vec![vec![0.0; 2]; headings.len()];
    for channel in 0..3 * PATCHES {
        let value = |at: usize| colours[at][channel / 3][channel % 3];
        let squares = Mat::from_fn(3, 3, |i, j| {
            let sum: f64 = known
                .iter()
                .map(|at| row(*at, wrong[*at])[i] * row(*at, wrong[*at])[j])
                .sum();
            sum + if i == j { 1e-6 } else { 0.0 }
        });
        let right = Mat::from_fn(3, 1, |i, _| {
            known
                .iter()
                .map(|at| row(*at, wrong[*at])[i] * value(*at))
                .sum::<f64>()
        });
        let Ok(factored) = squares.llt(Side::Lower) else {
            continue;
        };
        let found = factored.solve(&right);
        let error = |at: usize, turned: bool| {
            let row = row(at, turned);
            value(at) - (0..3).map(|i| row[i] * found[(i, 0)]).sum::<f64>()
        };
        let mut all: Vec<f64> = known
            .iter()
            .map(|at| error(*at, wrong[*at]).abs())
            .collect();
        let spread = (1.48 * crate::problem::quantile(&mut all, 0.5)).max(ERROR);
        for &at in known {
            for (state, cost) in costs[at].iter_mut().enumerate() {
                let off = (error(at, state == 1) / spread).abs().min(MOST);
                // Divided, since a patch's channels are not independent, and neither are consecutive frames.
                *cost += off * off / 3.0;
            }
        }
    }
    costs
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    type Colours = Vec<Vec<[f64; 3]>>;

    /// Headings of a person who turns once in 40 frames, and colours of a red front and a blue back.
    fn turning() -> (Vec<[f64; 2]>, Colours, Vec<f64>) {
        let angle = |at: usize| TAU * at as f64 / 40.0;
        let headings: Vec<[f64; 2]> = (0..40)
            .map(|at| [angle(at).cos(), angle(at).sin()])
            .collect();
        let colour = |[cos, _]: &[f64; 2]| vec![[0.5 + 0.3 * cos, 0.4, 0.5 - 0.3 * cos]; PATCHES];
        let colours = headings.iter().map(colour).collect();
        (
            headings,
            colours,
            (0..40).map(|at| at as f64 / 10.0).collect(),
        )
    }

    #[test]
    fn frames_whose_colours_are_the_other_side_s_are_wrong() {
        let (mut headings, colours, times) = turning();
        assert!(!wrong(&headings, &colours, &times).contains(&true));
        for heading in &mut headings[30..] {
            heading[0] = -heading[0];
        }
        let found = wrong(&headings, &colours, &times);
        // The frame in profile itself is undecided.
        assert!(
            found[31..].iter().all(|it| *it) && !found[..30].contains(&true),
            "{found:?}"
        );
    }

    #[test]
    fn colours_that_are_alike_or_missing_turn_nobody() {
        let (mut headings, mut colours, times) = turning();
        for heading in &mut headings[30..] {
            heading[0] = -heading[0];
        }
        for colour in &mut colours {
            colour.fill([0.3; 3]);
        }
        assert!(!wrong(&headings, &colours, &times).contains(&true));
        colours.iter_mut().for_each(Vec::clear);
        assert!(!wrong(&headings, &colours, &times).contains(&true));
    }

    #[test]
    fn a_patch_is_the_mean_of_its_pixels() {
        let mut rgb = vec![0; 3 * 16];
        rgb[3 * 5] = 255;
        let colour = mean(&rgb, [4, 4], [1.5, 1.5], 0.5);
        // The pixel and its four neighbours: a radius is at least a pixel.
        assert_eq!(colour, Some([0.2, 0.0, 0.0]));
        assert_eq!(mean(&rgb, [4, 4], [9.0, 9.0], 0.5), None);
    }
}
