//! The square around a face.

use super::FaceLandmarks;
use crate::PersonLandmarks;
use crate::region::Region;

/// Side of the square by the pose model's points, in extents of these points. They reach from ear to ear and from the
/// eyes to the mouth, so the square has room for forehead and chin, and the second look corrects it.
const POSE_SIDE: f32 = 2.0;
/// Side of the square by the face's own points, in extents of these points (MediaPipe's `face_landmark_landmarks_to_roi`).
const FACE_SIDE: f32 = 1.5;
/// BlazePose's nose, eyes, ears and mouth.
const POSE_POINTS: std::ops::RangeInclusive<usize> = 0..=10;
/// BlazePose's right and left eye: left and right are the person's own.
const POSE_EYES: [usize; 2] = [5, 2];
/// Outer corners of the right and left eye.
const FACE_EYES: [usize; 2] = [33, 263];

/// The square by the pose model's points; `None` for a face of less than `smallest` pixels.
pub(super) fn of_pose(person: &PersonLandmarks, smallest: f32) -> Option<Region> {
    let at = |point: usize| {
        let [x, y, ..] = person.picture[point];
        [x, y]
    };
    let points = POSE_POINTS.map(at);
    let (square, extent) = around(points, POSE_EYES.map(at), POSE_SIDE);
    square.possible().filter(|_| extent >= smallest)
}

/// The square by the face's own points.
pub(super) fn of_face(face: &FaceLandmarks) -> Option<Region> {
    let at = |[x, y, _]: &[f32; 3]| [*x, *y];
    let [right, left] = FACE_EYES.map(|point| face.picture.get(point).map(at));
    let points = face.picture.iter().map(at);
    around(points, [right?, left?], FACE_SIDE).0.possible()
}

/// The square of `side` extents around `points`, in which the person's right eye is left of the left one, and the extent, pixels.
fn around(
    points: impl Iterator<Item = [f32; 2]>,
    [right, left]: [[f32; 2]; 2],
    side: f32,
) -> (Region, f32) {
    let angle = (left[1] - right[1]).atan2(left[0] - right[0]);
    let (centre, [wide, high]) = Region::box_around(points, angle);
    let extent = wide.max(high);
    let square = Region {
        centre,
        side: side * extent,
        angle,
    };
    (square, extent)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Outline;

    /// A face upright, or on its side with the person's left up.
    fn face(lies: bool) -> FaceLandmarks {
        let place = |[x, y]: [f32; 2]| match lies {
            false => [300.0 + x, 200.0 + y, 0.0],
            true => [300.0 + y, 200.0 - x, 0.0],
        };
        let mut picture = vec![place([0.0, 0.0]); super::super::FACE_POINTS];
        picture[FACE_EYES[0]] = place([-40.0, -10.0]);
        picture[FACE_EYES[1]] = place([40.0, -10.0]);
        picture[152] = place([0.0, 70.0]);
        FaceLandmarks {
            picture,
            score: 1.0,
        }
    }

    #[test]
    fn a_square_has_the_eyes_level_and_above_the_chin() {
        for lies in [false, true] {
            let face = face(lies);
            let square = of_face(&face).expect("a square");
            let place = |at: usize| square.to_square([face.picture[at][0], face.picture[at][1]]);
            let [right, left, chin] = [FACE_EYES[0], FACE_EYES[1], 152].map(place);
            assert!((right[1] - left[1]).abs() < 1e-4, "{right:?} {left:?}");
            assert!(
                right[0] < left[0] && right[1] < chin[1],
                "{right:?} {chin:?}"
            );
            assert!((square.side - 1.5 * 80.0).abs() < 1e-3, "{square:?}");
        }
    }

    #[test]
    fn small_and_impossible_faces_have_no_square() {
        let person = |spread: f32| {
            let mut picture = [[0.0, 0.0, 0.0, 1.0]; 33];
            for (at, point) in picture.iter_mut().take(11).enumerate() {
                point[0] = spread * at as f32;
            }
            PersonLandmarks {
                picture,
                space: [[0.0; 4]; 33],
                outline: Outline::nobody([2, 1]),
                score: 1.0,
                figure: None,
            }
        };
        assert!(of_pose(&person(2.0), 12.0).is_some());
        assert_eq!(of_pose(&person(1.0), 12.0), None);
        assert_eq!(of_pose(&person(f32::NAN), 12.0), None);
    }
}
