//! Height by the eyes: their outer corners are as far apart in a tall adult as in a short one, so their distance tells how large a body is.
//!
//! docs/research/poses.md, "Height".

use crate::forward::Posed;
use crate::parameters::{Shared, Stance};
use crate::parts::{EYES, OUTER};
use crate::problem::{Problem, quantile};
use crate::{FacePoints, KeyPoints, skeleton};
use yoto_capture::skeleton::smpl::ASSUMED_HEIGHT;
use yoto_capture::skeleton::transform::{length, sub};

/// Frames that must show the eyes.
const FEWEST: usize = 10;
/// Smallest distance of the eyes' outer corners that is measured, pixels, and its largest share that is depth.
const SMALLEST: f64 = 12.0;
const PROFILE: f64 = 0.5;
/// Standard deviation of the estimate, as a share: 4 % is how people's eyes differ, the rest is what the fit makes of body and eyes.
const ERROR: f64 = 0.06;
/// Standard deviation of adults' heights, metres, men and women together.
const ADULTS: f64 = 0.1;
/// Difference from an adult's usual height, in standard deviations of both, beyond which the person counts as a child.
const CHILD: f64 = 2.5;

/// A person's height and its standard deviation, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Height {
    pub metres: f64,
    pub error: f64,
}

impl Height {
    /// The height of the body with `shared` bones in `stances`, whose faces the film shows; `None` if it hardly does.
    pub(crate) fn estimate(
        points: &KeyPoints,
        problem: &Problem,
        stances: &[Stance],
        shared: &Shared,
    ) -> Option<Self> {
        let markers = problem.markers.face?;
        let corners = OUTER.map(|corner| problem.markers.markers.get(markers[corner]));
        let [Some(left), Some(right)] = corners else {
            return None;
        };
        let frames = points.frames.iter().zip(stances);
        let mut shares: Vec<f64> = frames
            .filter_map(|(frame, stance)| {
                let pixels = across(frame.face.as_ref()?)?;
                let posed = Posed::new(stance, shared);
                let depth = [left, right].map(|marker| posed.marker(marker, shared)[2]);
                Some(pixels * 0.5 * (depth[0] + depth[1]) / shared.focal())
            })
            .filter(|share| *share > 0.0)
            .collect();
        let body = skeleton::height(&skeleton::offsets(&shared.factors()));
        (shares.len() >= FEWEST).then(|| Self::of_share(quantile(&mut shares, 0.5) / body))
    }

    /// The height of a person whose eyes' outer corners are this share of it apart: the mean of what the eyes tell and of what adults are, by
    /// their variances. A child's is what the eyes tell.
    fn of_share(share: f64) -> Self {
        let eyes = EYES / share;
        let own = ERROR * eyes;
        if (eyes - ASSUMED_HEIGHT).abs() > CHILD * own.hypot(ADULTS) {
            return Self {
                metres: eyes,
                error: own,
            };
        }
        let [a, b] = [own, ADULTS].map(|error| error.powi(-2));
        Self {
            metres: (a * eyes + b * ASSUMED_HEIGHT) / (a + b),
            error: (a + b).powf(-0.5),
        }
    }
}

/// The distance of the eyes' outer corners, pixels; `None` for a face that is too small or in profile.
fn across(face: &FacePoints) -> Option<f64> {
    let [left, right] = OUTER.map(|corner| face.picture[corner]);
    let across = length(sub(left, right));
    let is_seen = across >= SMALLEST && (left[2] - right[2]).abs() < PROFILE * across;
    is_seen.then_some(across)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::FitOptions;
    use crate::rotation::IDENTITY_ROTATION;
    use crate::skeleton::COUNT;
    use crate::{FrameKeyPoints, KeyPointSet};
    use yoto_capture::skeleton::transform::rodrigues;

    /// The estimate for somebody who faces the camera in this number of `frames`. The distance of their eyes is this `share` of their height.
    fn found(frames: usize, share: f64) -> Option<Height> {
        let mut points = KeyPoints {
            set: KeyPointSet::BlazePose33,
            image_size: [400, 800],
            fps: 30.0,
            frames: vec![FrameKeyPoints {
                picture: vec![[200.0, 400.0, 0.9]; 33],
                ..FrameKeyPoints::default()
            }],
        };
        let problem = Problem::new(&points, &FitOptions::default());
        let shared = Shared::average(&problem.markers, 700.0);
        let mut stance = Stance {
            rotations: [IDENTITY_ROTATION; COUNT],
            root: [0.0, 0.0, 3.0],
        };
        // Upright before the camera, whose y points down.
        stance.rotations[0] = rodrigues([std::f64::consts::PI, 0.0, 0.0]);
        let eye = problem.markers.face.expect("a face")[OUTER[0]];
        let depth = Posed::new(&stance, &shared).marker(&problem.markers.markers[eye], &shared)[2];
        let body = skeleton::height(&skeleton::offsets(&shared.factors()));
        let half = 0.5 * share * body * 700.0 / depth;
        let mut picture = [[0.0; 3]; 9];
        (picture[OUTER[0]], picture[OUTER[1]]) =
            ([200.0 + half, 0.0, 0.0], [200.0 - half, 0.0, 0.0]);
        points.frames[0].face = Some(FacePoints {
            picture,
            lips: [[0.0; 3]; 2],
            eyelids: [[[0.0; 3]; 2]; 2],
            confidence: 0.9,
        });
        points.frames = vec![points.frames[0].clone(); frames];
        Height::estimate(&points, &problem, &vec![stance; frames], &shared)
    }

    #[test]
    fn eyes_tell_a_child_from_an_adult_and_little_about_adults() {
        let usual = found(FEWEST, EYES / ASSUMED_HEIGHT).expect("eyes");
        assert!((usual.metres - ASSUMED_HEIGHT).abs() < 1e-9, "{usual:?}");
        assert!((0.06..0.08).contains(&usual.error), "{usual:?}");
        // An adult of 1.52 m and one of 1.92 m, whose eyes tell half of the difference.
        for (truth, between) in [(1.52, 1.56..1.66), (1.92, 1.78..1.86)] {
            let found = found(FEWEST, EYES / truth).expect("eyes");
            assert!(between.contains(&found.metres), "{truth}: {found:?}");
        }
        let child = found(FEWEST, EYES / 1.2).expect("eyes");
        assert!((child.metres - 1.2).abs() < 1e-9, "{child:?}");
    }

    #[test]
    fn a_face_that_is_hardly_seen_tells_nothing() {
        assert_eq!(found(FEWEST - 1, 0.05), None);
        // Seven pixels.
        assert_eq!(found(FEWEST, 0.02), None);
    }
}
