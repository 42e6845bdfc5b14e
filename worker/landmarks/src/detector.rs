//! The region of the person, from the detector's boxes.
//!
//! The detector takes the whole picture in a square of 224 × 224 pixels. For each of 2,254 fixed points (anchors) it
//! gives a score and 12 numbers, in pixels of that square relative to the anchor: centre and size of a box, then x and y
//! of four points. The first point is the middle of the hips, and the second is on the circle around the whole body.

use crate::region::Region;

/// Pixels of the detector's picture along a side.
pub(crate) const SIDE: usize = 224;
/// Numbers per box.
pub(crate) const NUMBERS: usize = 12;
/// Boxes per picture.
pub(crate) const BOXES: usize = 2254;
/// The detector's layers: distance between anchors in pixels, and number of anchors at each point.
const LAYERS: [(usize, usize); 3] = [(8, 2), (16, 2), (32, 6)];
/// Least score of a person.
const LOWEST_SCORE: f32 = 0.5;
/// Boxes that overlap more than this (intersection over union) show the same person.
const SAME: f32 = 0.3;

/// The anchors' positions, from 0 to 1.
pub(crate) fn anchors() -> Vec<[f32; 2]> {
    let mut anchors = Vec::with_capacity(BOXES);
    for (stride, each) in LAYERS {
        let cells = SIDE / stride;
        for (row, column) in (0..cells).flat_map(|row| (0..cells).map(move |column| (row, column)))
        {
            let centre = [column, row].map(|at| (at as f32 + 0.5) / cells as f32);
            anchors.extend(std::iter::repeat_n(centre, each));
        }
    }
    anchors
}

/// A box of the detector, with coordinates from 0 to 1.
#[derive(Clone, Copy, Debug)]
struct DetectedBox {
    score: f32,
    /// Left, top, right, bottom.
    sides: [f32; 4],
    hips: [f32; 2],
    circle: [f32; 2],
}

/// The squares around the people of a picture, the most certain first, from the detector's `boxes` `[2254, 12]` and `scores`
/// `[2254]` for the square `whole`.
pub(crate) fn people(
    anchors: &[[f32; 2]],
    boxes: &[f32],
    scores: &[f32],
    whole: Region,
) -> Vec<Region> {
    let boxes = boxes.as_chunks::<NUMBERS>().0.iter();
    let mut found: Vec<DetectedBox> = anchors
        .iter()
        .zip(boxes)
        .zip(scores)
        .filter_map(|((anchor, numbers), score)| found(*anchor, numbers, *score))
        .collect();
    let mut people = Vec::new();
    while let Some(best) = found
        .iter()
        .max_by(|a, b| a.score.total_cmp(&b.score))
        .copied()
    {
        people.extend(region(&best, &found, whole));
        found.retain(|other| shared(&best, other) <= SAME);
        // A box without an area shares nothing with itself.
        found.retain(|other| other.sides != best.sides);
    }
    people
}

/// The square around the person of the box `best`.
fn region(best: &DetectedBox, found: &[DetectedBox], whole: Region) -> Option<Region> {
    let (mut hips, mut circle, mut weight) = ([0.0; 2], [0.0; 2], 0.0);
    for same in found.iter().filter(|other| shared(best, other) > SAME) {
        weight += same.score;
        for at in 0..2 {
            hips[at] += same.score * same.hips[at];
            circle[at] += same.score * same.circle[at];
        }
    }
    // The mean of all overlapping boxes, weighted by their scores, is steadier than the best box alone.
    let mean = |sum: [f32; 2]| whole.to_picture(sum.map(|sum| sum / weight));
    Region::around(mean(hips), mean(circle))
}

fn found(anchor: [f32; 2], numbers: &[f32; NUMBERS], score: f32) -> Option<DetectedBox> {
    let score = 1.0 / (1.0 + (-score.clamp(-100.0, 100.0)).exp());
    if score < LOWEST_SCORE || !numbers.iter().all(|number| number.is_finite()) {
        return None;
    }
    let [x, y, width, height, hips_x, hips_y, circle_x, circle_y, ..] =
        numbers.map(|number| number / SIDE as f32);
    let [x, y] = [anchor[0] + x, anchor[1] + y];
    Some(DetectedBox {
        score,
        sides: [
            x - width / 2.0,
            y - height / 2.0,
            x + width / 2.0,
            y + height / 2.0,
        ],
        hips: [anchor[0] + hips_x, anchor[1] + hips_y],
        circle: [anchor[0] + circle_x, anchor[1] + circle_y],
    })
}

/// The intersection over union of two boxes.
fn shared(a: &DetectedBox, b: &DetectedBox) -> f32 {
    let area =
        |[left, top, right, bottom]: [f32; 4]| (right - left).max(0.0) * (bottom - top).max(0.0);
    let both = area([
        a.sides[0].max(b.sides[0]),
        a.sides[1].max(b.sides[1]),
        a.sides[2].min(b.sides[2]),
        a.sides[3].min(b.sides[3]),
    ]);
    let either = area(a.sides) + area(b.sides) - both;
    if either > 0.0 { both / either } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anchors_are_as_many_as_boxes() {
        let anchors = anchors();
        assert_eq!(anchors.len(), BOXES);
        assert_eq!(anchors[0], [0.5 / 28.0, 0.5 / 28.0]);
        assert_eq!(anchors[2], [1.5 / 28.0, 0.5 / 28.0]);
        assert_eq!(anchors[BOXES - 1], [6.5 / 7.0, 6.5 / 7.0]);
    }

    /// Boxes of which `certain` have the scores given and all show a person at the anchor itself,
    /// 40 pixels high.
    fn boxes(certain: &[(usize, f32)]) -> (Vec<f32>, Vec<f32>) {
        let one = [
            0.0, 0.0, 30.0, 40.0, 0.0, 0.0, 0.0, -20.0, 0.0, 0.0, 0.0, 0.0,
        ];
        let mut scores = vec![-9.0; BOXES];
        for &(at, score) in certain {
            scores[at] = score;
        }
        (one.repeat(BOXES), scores)
    }

    #[test]
    fn the_most_certain_person_is_taken() {
        let anchors = anchors();
        let whole = Region::whole(448, 448);
        let (boxes, mut scores) = boxes(&[(0, 1.0), (1000, 3.0)]);
        let region = people(&anchors, &boxes, &scores, whole)[0];
        let [x, y] = anchors[1000].map(|at| at * 448.0);
        assert!((region.centre[0] - x).abs() < 1e-3 && (region.centre[1] - y).abs() < 1e-3);
        // 20 pixels of 224 are 40 of 448; twice that, with the margin.
        assert!((region.side - 100.0).abs() < 1e-3, "{region:?}");
        scores.fill(-0.1);
        assert_eq!(people(&anchors, &boxes, &scores, whole), []);
    }

    #[test]
    fn all_people_are_found_once() {
        let anchors = anchors();
        let (boxes, scores) = boxes(&[(0, 2.0), (2, 1.5), (1000, 3.0), (1001, 1.0)]);
        let people = people(&anchors, &boxes, &scores, Region::whole(224, 224));
        let centres: Vec<[f32; 2]> = people.iter().map(|region| region.centre).collect();
        assert_eq!(centres.len(), 2, "{centres:?}");
        assert!((centres[1][0] - 8.0).abs() < 3.0, "{centres:?}");
    }

    #[test]
    fn boxes_of_one_person_are_averaged() {
        let anchors = anchors();
        let (boxes, scores) = boxes(&[(0, 2.0), (2, 2.0), (1000, 1.0)]);
        let whole = Region::whole(224, 224);
        let region = people(&anchors, &boxes, &scores, whole)[0];
        assert!((region.centre[0] - 8.0).abs() < 1e-3, "{region:?}");
    }
}
