//! Hands of 21 points beside a body's points, of which three knuckles turn the wrist.

use super::detections::Detections;
use yoto_pose::KeyPointSet;

/// Points of a hand: the wrist, then four of each finger, from its root to its tip, the thumb first.
pub(super) const POINTS: usize = 21;
/// The first knuckles of the little finger and the index finger, and the thumb's second joint.
const KNUCKLES: [usize; 3] = [17, 5, 2];

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
