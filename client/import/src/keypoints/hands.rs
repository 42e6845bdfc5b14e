//! Hands of 21 points beside a body's points. Three knuckles turn the wrist; if all points have depths, fingers bend too.

use super::detections::Detections;
use crate::geometry::Vec3;
use crate::source::is_number;
use yoto_capture::skeleton::fingers::AVERAGE;
use yoto_capture::skeleton::transform::{length, scale, sub};
use yoto_pose::{HandPoints, KeyPointSet};

/// Points of a hand: the wrist, then four of each finger, from its root to its tip, the thumb first.
pub(super) const POINTS: usize = 21;
/// The first knuckles of the little finger and the index finger, and the thumb's second joint.
const KNUCKLES: [usize; 3] = [17, 5, 2];

/// The middle finger's first knuckle among a hand's points, and among the joints of an average hand.
const MIDDLE: usize = 9;
const MIDDLE_JOINT: usize = 3;

/// The landmarks of one hand, as MediaPipe has them.
#[derive(Clone, Debug)]
pub(super) struct LandmarkHand {
    /// x, y and z, shares of the picture or pixels; z from the wrist, by the scale of x.
    pub picture: Vec<Vec3>,
    /// Metres in the camera's axes, if the file has them.
    pub space: Option<Vec<Vec3>>,
}

impl LandmarkHand {
    /// The hand in pixels, which are `by` units of the file; `None` with a number that is not finite. Without points in space, those in
    /// the picture are scaled so that the palm has an average adult's size.
    pub(super) fn points(&self, by: [f64; 2]) -> Option<HandPoints> {
        let [wide, high] = by;
        let in_pixels = |[x, y, z]: &Vec3| [wide * x, high * y, wide * z];
        let picture: Vec<Vec3> = self.picture.iter().map(in_pixels).collect();
        let space = self.space.clone().or_else(|| {
            let palm = length(sub(*picture.get(MIDDLE)?, *picture.first()?));
            let size = length(AVERAGE[MIDDLE_JOINT]) / palm;
            Some(picture.iter().map(|point| scale(*point, size)).collect())
        })?;
        let are_numbers = |points: &[Vec3]| points.as_flattened().iter().all(|it| is_number(*it));
        let is_whole = are_numbers(&picture) && are_numbers(&space);
        let flat: Vec<[f64; 2]> = picture.iter().map(|[x, y, _]| [*x, *y]).collect();
        is_whole.then_some(HandPoints {
            picture: flat.try_into().ok()?,
            space: space.try_into().ok()?,
            confidence: 1.0,
        })
    }
}

/// The first points of the left and the right hand in sets of `points` points: COCO-WholeBody and Halpe's full body.
fn starts(points: usize) -> Option<[usize; 2]> {
    match points {
        133 => Some([91, 112]),
        136 => Some([94, 115]),
        _ => None,
    }
}

/// COCO's 17 points of a set that begins with them, then the knuckles of its hands.
pub(super) fn body_and_knuckles(points: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let hands = starts(points.len()).unwrap_or([points.len(); 2]);
    let [left, right] = hands.map(|start| points.get(start..).unwrap_or_default());
    let body = points.iter().take(KeyPointSet::Coco17.points());
    body.copied().chain(knuckles(left, right)).collect()
}

/// The knuckles of both hands, left before right; those of a hand that the detector does not have are unseen.
pub(super) fn knuckles(left: &[[f64; 3]], right: &[[f64; 3]]) -> impl Iterator<Item = [f64; 3]> {
    KNUCKLES
        .into_iter()
        .flat_map(move |at| [left, right].map(|hand| hand.get(at).copied().unwrap_or_default()))
}

/// Takes the points behind the body's as hands if any was seen, else drops them.
pub(super) fn settle(found: &mut Detections) {
    let with_hands = match found.set {
        KeyPointSet::Coco17 => KeyPointSet::Coco17Hands,
        KeyPointSet::OpenPose25 => KeyPointSet::OpenPose25Hands,
        _ => return,
    };
    let body = found.set.points();
    let people = || found.frames.iter().flat_map(|frame| &frame.people);
    let is_seen = people().any(|person| person.picture.iter().skip(body).any(|it| it[2] > 0.0));
    if is_seen {
        found.set = with_hands;
    }
    let points = found.set.points();
    let people = found.frames.iter_mut().flat_map(|frame| &mut frame.people);
    for person in people {
        person.picture.resize(points, [0.0; 3]);
    }
}
