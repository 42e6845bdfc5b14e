//! What detectors say that look at a hand or a face alone. They are more exact than the body's detector, whose points they replace.
//!
//! Such a detector sees a small square as if the camera looked straight at it, so its directions are turned by the angle between the
//! camera's axis and the line of sight.

use crate::markers::Markers;
use crate::problem::{Detection, Direction, Observed};
use crate::rotation::matvec;
use crate::{FacePoints, FrameKeyPoints, HandPoints};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{Mat3, cross, length, normalised, rodrigues, scale, sub};

/// Error of a hand's points in space, metres.
const HAND_ERROR: f64 = 0.02;
/// First knuckles of thumb, index and little finger among a hand's points.
const KNUCKLES: [usize; 3] = [2, 5, 17];

/// Error of a face's points in space, metres (docs/research/poses.md, "Faces": 3 and 30 mm make no difference).
const FACE_ERROR: f64 = 0.01;
/// How much more exact in the picture a face's points are than the body's (docs/research/poses.md, "Faces").
const FACE_PRECISION: f64 = 2.0;
/// Distance of the eyes' outer corners, metres: the size of a face in pixels is not known.
pub(crate) const EYES: f64 = 0.09;
/// Outer corners of the left and right eye among a face's points.
pub(crate) const OUTER: [usize; 2] = [3, 6];
/// Pairs of a face's points with a direction: across the eyes, from the mouth to the eyes, from the eyes to the nose.
const FACE_BONES: [[usize; 2]; 5] = [[6, 3], [7, 3], [8, 6], [3, 0], [6, 0]];

/// Puts the hands and the face of `frame` into `observed`. `camera` is the picture's middle and the focal length, pixels.
pub(crate) fn see(
    observed: &mut Observed,
    markers: &Markers,
    frame: &FrameKeyPoints,
    camera: [f64; 3],
) {
    for (points, hand) in markers.hands.iter().zip(&frame.hands) {
        if let (Some(points), Some(hand)) = (points, hand) {
            see_hand(observed, *points, hand, camera);
        }
    }
    if let (Some(points), Some(face)) = (markers.face, &frame.face) {
        see_face(observed, points, face, camera);
    }
}

/// Takes wrist, thumb, index and little finger, at `points`. The wrist stays where the body's detector has it.
fn see_hand(observed: &mut Observed, points: [usize; 4], hand: &HandPoints, camera: [f64; 3]) {
    let [wrist, knuckles @ ..] = points;
    let places = KNUCKLES.map(|knuckle| hand.picture[knuckle]);
    replace(observed, &knuckles, &places, [hand.confidence, 1.0], camera);
    let is_of_hand = |ends: [usize; 2]| ends.iter().all(|end| points.contains(end));
    observed.directions.retain(|it| !is_of_hand(it.markers));
    let [_, index, little] = knuckles;
    let [_, at_index, at_little] = KNUCKLES;
    let sight = sight(hand.picture[0], camera);
    for (markers, [from, to]) in [
        ([wrist, index], [0, at_index]),
        ([wrist, little], [0, at_little]),
        ([little, index], [at_little, at_index]),
    ] {
        let way = sub(hand.space[to], hand.space[from]);
        let told = direction(markers, way, HAND_ERROR, &sight);
        observed.directions.extend(told);
    }
}

/// Takes nose, eyes and mouth, at `points`. The ears stay where the body's detector has them.
fn see_face(observed: &mut Observed, points: [usize; 9], face: &FacePoints, camera: [f64; 3]) {
    let [left, right] = OUTER.map(|corner| face.picture[corner]);
    let pixels = length(sub(left, right));
    if pixels < 1.0 {
        return;
    }
    let places = face.picture.map(|[x, y, _]| [x, y]);
    replace(
        observed,
        &points,
        &places,
        [face.confidence, FACE_PRECISION],
        camera,
    );
    let is_of_face = |ends: [usize; 2]| ends.iter().all(|end| points.contains(end));
    observed.directions.retain(|it| !is_of_face(it.markers));
    let sight = sight(places[0], camera);
    for ends in FACE_BONES {
        let [from, to] = ends.map(|end| face.picture[end]);
        let way = scale(sub(to, from), EYES / pixels);
        let told = direction(ends.map(|end| points[end]), way, FACE_ERROR, &sight);
        observed.directions.extend(told);
    }
}

/// Puts the `places`, pixels, of `points` in place of those of the body's detector.
fn replace(
    observed: &mut Observed,
    points: &[usize],
    places: &[[f64; 2]],
    [confidence, precision]: [f64; 2],
    [middle_x, middle_y, _]: [f64; 3],
) {
    observed
        .detections
        .retain(|it| !points.contains(&it.marker));
    let detections = points
        .iter()
        .zip(places)
        .map(|(&marker, [x, y])| Detection {
            marker,
            pixel: [x - middle_x, y - middle_y],
            confidence,
            precision,
        });
    observed.detections.extend(detections);
}

fn direction(markers: [usize; 2], way: Vec3, error: f64, sight: &Mat3) -> Option<Direction> {
    let length = length(way);
    (length > 0.01).then(|| Direction {
        markers,
        towards: matvec(sight, scale(way, 1.0 / length)),
        length,
        error,
        is_close: true,
    })
}

/// The rotation from the camera's axis to the line of sight through a pixel.
pub(crate) fn sight([x, y]: [f64; 2], [middle_x, middle_y, focal]: [f64; 3]) -> Mat3 {
    let axis = [0.0, 0.0, 1.0];
    let line = normalised([x - middle_x, y - middle_y, focal]);
    let normal = cross(axis, line);
    let sine = length(normal);
    if sine < 1e-9 {
        return rodrigues([0.0; 3]);
    }
    rodrigues(scale(normal, sine.clamp(-1.0, 1.0).asin() / sine))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::Problem;
    use crate::{FitOptions, KeyPointSet, KeyPoints};

    /// A film of one frame: all points of the body are seen, and the face is seen if there is one.
    fn film(face: Option<FacePoints>) -> KeyPoints {
        let set = KeyPointSet::BlazePose33;
        let frame = FrameKeyPoints {
            picture: (0..set.points())
                .map(|at| [100.0 + 7.0 * at as f64, 80.0 + 11.0 * at as f64, 0.9])
                .collect(),
            space: (0..set.points())
                .map(|at| [0.01 * at as f64, 0.02 * at as f64, 0.5])
                .collect(),
            face,
            ..FrameKeyPoints::default()
        };
        KeyPoints {
            set,
            image_size: [640, 480],
            fps: 15.0,
            frames: vec![frame],
        }
    }

    /// The face's detector replaces the body's in what it sees, and tells the head's bones in place of the network. Its likelihood stays
    /// a confidence, since the network learned from confidences up to 1.
    #[test]
    fn a_face_replaces_the_points_of_the_body() {
        let mut picture = [[300.0, 200.0, 0.0]; 9];
        for (point, x) in [(3, 345.0), (6, 255.0), (7, 330.0), (8, 270.0)] {
            picture[point][0] = x;
        }
        for mouth in [7, 8] {
            picture[mouth][1] = 270.0;
        }
        picture[0] = [300.0, 240.0, -40.0];
        let face = FacePoints {
            picture,
            lips: [[0.0; 3]; 2],
            eyelids: [[[0.0; 3]; 2]; 2],
            confidence: 0.95,
        };
        let lift = FitOptions {
            lift: true,
            ..FitOptions::default()
        };
        let seen = |face| {
            let mut problem = Problem::new(&film(face), &lift);
            crate::lift::deepen(&mut problem, crate::lift::own());
            problem.frames.remove(0)
        };
        let (with, without) = (seen(Some(face)), seen(None));
        let nose = with.detections.iter().find(|it| it.marker == 0);
        let nose = nose.expect("a nose");
        assert_eq!(nose.pixel, [300.0 - 320.0, 240.0 - 240.0]);
        assert_eq!((nose.confidence, nose.precision), (0.95, FACE_PRECISION));
        assert_eq!(with.detections.len(), without.detections.len());
        let close: Vec<&Direction> = with.directions.iter().filter(|it| it.is_close).collect();
        assert_eq!(close.len(), FACE_BONES.len());
        // From the right eye to the left one: across the picture, as long as a face is wide.
        assert_eq!(close[0].markers, [6, 3]);
        assert!((close[0].length - EYES).abs() < 1e-9);
        assert!(close[0].towards[0] > 0.99, "{:?}", close[0]);
        let of_head = |of: &Observed| {
            of.depths
                .iter()
                .filter(|it| it.markers.contains(&0))
                .count()
        };
        assert_eq!((of_head(&with), of_head(&without)), (0, 2));
    }

    #[test]
    fn a_part_beside_the_middle_is_turned_towards_its_line_of_sight() {
        let turned = matvec(&sight([400.0, 50.0], [100.0, 50.0, 400.0]), [0.0, 0.0, 1.0]);
        let wanted = normalised([300.0, 0.0, 400.0]);
        assert!(length(sub(turned, wanted)) < 1e-9, "{turned:?}");
        let ahead = sight([100.0, 50.0], [100.0, 50.0, 400.0]);
        assert_eq!(matvec(&ahead, [0.1, 0.2, 0.3]), [0.1, 0.2, 0.3]);
    }
}
