//! The square around a hand.

use super::HandLandmarks;
use crate::region::Region;
use std::f32::consts::FRAC_PI_2;

/// Side of the square by the pose model's points, in distances from the wrist to the knuckles, and its shift towards the fingers, as a
/// share of the side before it grows (MediaPipe's `hand_landmarks_from_pose_to_recrop_roi`: a box of twice the distance, 2.7 times as
/// large, shifted by 0.1).
const POSE_SIDE: f32 = 2.0 * 2.7;
const POSE_SHIFT: f32 = 2.0 * 0.1;
/// Side of the square by the hand's own points, in extents of the palm, and its shift (MediaPipe's `hand_landmark_landmarks_to_roi`).
const HAND_SIDE: f32 = 2.0;
const HAND_SHIFT: f32 = 0.1;
/// The points of palm and first joints of fingers, which bend little.
const PALM: [usize; 12] = [0, 1, 2, 3, 5, 6, 9, 10, 13, 14, 17, 18];
/// First knuckles of index, middle and ring finger.
const KNUCKLES: [usize; 3] = [5, 9, 13];

/// The square by the pose model's `[wrist, little finger, index finger]`; `None` for a hand whose knuckles are less than `smallest`
/// pixels from its wrist.
pub(super) fn of_pose([wrist, little, index]: [[f32; 2]; 3], smallest: f32) -> Option<Region> {
    let middle = [0, 1].map(|i| (2.0 * index[i] + little[i]) / 3.0);
    let way = [middle[0] - wrist[0], middle[1] - wrist[1]];
    let distance = way[0].hypot(way[1]);
    (distance >= smallest && distance < 1e6).then(|| {
        let shift = POSE_SHIFT;
        Region {
            centre: [0, 1].map(|i| middle[i] + shift * way[i]),
            side: POSE_SIDE * distance,
            angle: upright(way),
        }
    })
}

/// The square by the hand's own points, with the fingers up.
pub(super) fn of_hand(hand: &HandLandmarks) -> Option<Region> {
    let at = |point: usize| [hand.picture[point][0], hand.picture[point][1]];
    // The middle finger's knuckle, and the mean of its neighbours', point the way.
    let [index, middle, ring] = KNUCKLES.map(at);
    let wrist = at(0);
    let way = [0, 1].map(|i| 0.25 * (index[i] + ring[i]) + 0.5 * middle[i] - wrist[i]);
    let angle = upright(way);
    let (middle, [wide, high]) = Region::box_around(PALM.into_iter().map(at), angle);
    let (sin, cos) = angle.sin_cos();
    let shift = HAND_SHIFT * high;
    let square = Region {
        centre: [middle[0] + sin * shift, middle[1] - cos * shift],
        side: HAND_SIDE * wide.max(high),
        angle,
    };
    square.possible()
}

/// The angle of a square in which `way` points up.
fn upright([x, y]: [f32; 2]) -> f32 {
    FRAC_PI_2 - (-y).atan2(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand::HAND_POINTS;

    fn hand(turned: bool) -> HandLandmarks {
        let picture = std::array::from_fn(|point| {
            let (finger, joint) = (point.saturating_sub(1) / 4, point.saturating_sub(1) % 4);
            let up = if point == 0 {
                0.0
            } else {
                40.0 + 10.0 * joint as f32
            };
            let across = if point == 0 {
                0.0
            } else {
                10.0 * (finger as f32 - 2.0)
            };
            let [x, y] = if turned { [up, across] } else { [across, -up] };
            [100.0 + x, 200.0 + y, 0.0]
        });
        HandLandmarks {
            picture,
            space: [[0.0; 3]; HAND_POINTS],
            score: 1.0,
            right: 0.0,
        }
    }

    #[test]
    fn a_square_has_the_fingers_up() {
        for turned in [false, true] {
            let hand = hand(turned);
            let region = of_hand(&hand).expect("a square");
            let tip = region.to_square([hand.picture[12][0], hand.picture[12][1]]);
            let wrist = region.to_square([100.0, 200.0]);
            assert!((tip[0] - wrist[0]).abs() < 1e-4, "{tip:?} {wrist:?}");
            assert!(tip[1] < wrist[1] && tip[1] > 0.0 && wrist[1] < 1.0);
        }
    }

    #[test]
    fn the_pose_models_points_give_a_square_around_the_hand() {
        let region = of_pose([[100.0, 200.0], [110.0, 170.0], [95.0, 170.0]], 8.0);
        let region = region.expect("a square");
        let [u, v] = region.to_square([100.0, 200.0]);
        assert!((u - 0.5).abs() < 0.01 && v > 0.6 && v < 0.9, "{u} {v}");
        let small = of_pose([[100.0, 200.0], [102.0, 197.0], [99.0, 197.0]], 8.0);
        assert_eq!(small, None);
        let none = of_pose([[f32::NAN, 200.0], [102.0, 197.0], [99.0, 197.0]], 8.0);
        assert_eq!(none, None);
    }
}
