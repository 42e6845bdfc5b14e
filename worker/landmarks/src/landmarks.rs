//! Landmarks from the outputs of the landmark model.

use crate::region::Region;

/// Pixels of the model's picture along a side.
pub(crate) const SIDE: usize = 256;
/// Points of the model: 33 of the body, the middle of the hips, a point of the circle around the body, and four that are
/// not used.
pub(crate) const POINTS: usize = 39;
/// Numbers per point: x, y, z, visibility, presence.
pub(crate) const NUMBERS: usize = 5;
/// Cells of the heat maps along a side.
pub(crate) const CELLS: usize = 64;
/// Landmarks of the body.
pub(crate) const BODY: usize = 33;
const HIPS: usize = 33;
const CIRCLE: usize = 34;
/// Cells on either side of a point that refine its position.
const REACH: usize = 3;
/// A point is refined only if its most likely cell has at least this likelihood.
const LOWEST_LIKELIHOOD: f32 = 0.5;

/// The outputs of the landmark model for one region.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outputs<'a> {
    /// `[39, 5]`: x, y, z in pixels of the model's picture; visibility and presence as logits.
    pub(crate) points: &'a [f32],
    /// `[64, 64, 39]` logits of the heat maps.
    pub(crate) likelihoods: &'a [f32],
    /// `[39, 3]`: metres from the middle of the hips, in the region's axes.
    pub(crate) space: &'a [f32],
}

/// Landmarks in a picture.
#[derive(Clone, Debug)]
pub(crate) struct Landmarks {
    /// x, y, z in pixels, visibility from 0 to 1.
    pub(crate) picture: [[f32; 4]; BODY],
    /// Metres from the middle of the hips, in the picture's axes; visibility.
    pub(crate) space: [[f32; 4]; BODY],
    /// The region to look at in the next picture.
    pub(crate) next: Option<Region>,
}

pub(crate) fn logistic(value: f32) -> f32 {
    1.0 / (1.0 + (-value).exp())
}

impl Outputs<'_> {
    /// The landmarks of the person in `region`; `None` if a number is not finite.
    pub(crate) fn landmarks(&self, region: Region) -> Option<Landmarks> {
        let numbers = self.points.as_chunks::<NUMBERS>().0;
        let spaces = self.space.as_chunks::<3>().0;
        let (mut picture, mut space) = ([[0.0; 4]; BODY], [[0.0; 4]; BODY]);
        let (mut hips, mut circle) = ([0.0; 2], [0.0; 2]);
        for (at, (point, metres)) in numbers.iter().zip(spaces).enumerate() {
            let [x, y, z, visibility, _] = *point;
            let [u, v] = self.refined(at, [x, y].map(|pixel| pixel / SIDE as f32));
            let [x, y] = region.to_picture([u, v]);
            let z = z / SIDE as f32 * region.side;
            let visibility = logistic(visibility);
            if let (Some(picture), Some(space)) = (picture.get_mut(at), space.get_mut(at)) {
                *picture = [x, y, z, visibility];
                let [right, down] = region.rotate([metres[0], metres[1]]);
                *space = [right, down, metres[2], visibility];
            }
            match at {
                HIPS => hips = [x, y],
                CIRCLE => circle = [x, y],
                _ => (),
            }
        }
        let mut all = picture.iter().chain(&space).flatten();
        all.all(|number| number.is_finite()).then(|| Landmarks {
            picture,
            space,
            next: Region::around(hips, circle),
        })
    }

    /// The position of point `at`, from 0 to 1, moved to the mean of the cells around it, weighted by their likelihoods.
    fn refined(&self, at: usize, [u, v]: [f32; 2]) -> [f32; 2] {
        if !(0.0..1.0).contains(&u) || !(0.0..1.0).contains(&v) {
            return [u, v];
        }
        let around = |position: f32| {
            let cell = (position * CELLS as f32) as usize;
            cell.saturating_sub(REACH)..(cell + REACH + 1).min(CELLS)
        };
        let (mut sum, mut highest, mut mean) = (0.0, 0.0f32, [0.0; 2]);
        for row in around(v) {
            for column in around(u) {
                let cell = (row * CELLS + column) * POINTS + at;
                let likelihood = logistic(self.likelihoods.get(cell).copied().unwrap_or(-9.0));
                sum += likelihood;
                highest = highest.max(likelihood);
                mean[0] += likelihood * column as f32;
                mean[1] += likelihood * row as f32;
            }
        }
        if highest < LOWEST_LIKELIHOOD {
            return [u, v];
        }
        mean.map(|mean| mean / sum / CELLS as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> (Vec<f32>, Vec<f32>, Vec<f32>) {
        let mut points = [128.0, 64.0, 25.6, 0.0, 0.0].repeat(POINTS);
        points[HIPS * NUMBERS..][..2].copy_from_slice(&[128.0, 128.0]);
        points[CIRCLE * NUMBERS..][..2].copy_from_slice(&[128.0, 48.0]);
        let cells = vec![-20.0; CELLS * CELLS * POINTS];
        (points, cells, [0.1, 0.2, 0.3].repeat(POINTS))
    }

    fn region() -> Region {
        Region {
            centre: [500.0, 600.0],
            side: 512.0,
            angle: 0.0,
        }
    }

    #[test]
    fn places_are_those_of_the_picture() {
        let (points, likelihoods, space) = points();
        let outputs = Outputs {
            points: &points,
            likelihoods: &likelihoods,
            space: &space,
        };
        let found = outputs.landmarks(region()).expect("landmarks");
        assert_eq!(found.picture[0], [500.0, 472.0, 51.2, 0.5]);
        assert_eq!(found.space[0], [0.1, 0.2, 0.3, 0.5]);
        let next = found.next.expect("a region");
        assert!((next.side - 400.0).abs() < 1e-3, "{next:?}");
        assert_eq!(next.centre, [500.0, 600.0]);
    }

    #[test]
    fn likely_cells_draw_points_to_them() {
        let (points, mut likelihoods, space) = points();
        // Point 7 is in row 16 and column 32; it moves to the only likely cell.
        likelihoods[(17 * CELLS + 34) * POINTS + 7] = 20.0;
        let outputs = Outputs {
            points: &points,
            likelihoods: &likelihoods,
            space: &space,
        };
        let found = outputs.landmarks(region()).expect("landmarks");
        let [x, y, ..] = found.picture[7];
        let wanted = region().to_picture([34.0 / 64.0, 17.0 / 64.0]);
        assert!((x - wanted[0]).abs() < 0.1 && (y - wanted[1]).abs() < 0.1);
        assert_eq!(found.picture[8][..2], [500.0, 472.0], "other points stay");
    }

    #[test]
    fn numbers_that_are_none_give_no_landmarks() {
        let (mut points, likelihoods, space) = points();
        points[3 * NUMBERS] = f32::NAN;
        let outputs = Outputs {
            points: &points,
            likelihoods: &likelihoods,
            space: &space,
        };
        assert!(outputs.landmarks(region()).is_none());
    }
}
