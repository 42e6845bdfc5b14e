//! Tells whether the hands are in sight. The pose model marks the knuckles of thumb, index and little finger: too few points
//! to tell a fist from an open hand.

use yoto_capture::check::Lack;
use yoto_pose::FrameKeyPoints;

/// BlazePose's knuckles of the little finger and the index finger, of each hand.
const HANDS: [(&str, [usize; 2]); 2] = [("left hand", [17, 19]), ("right hand", [18, 20])];
/// Confidence from which on a point is in sight.
const IN_SIGHT: f64 = 0.5;
/// Least share of frames in which a hand should be in sight.
const OFTEN: f64 = 0.5;

/// The hands that are in sight too seldom.
pub(super) fn lacks<'a>(frames: impl Iterator<Item = &'a FrameKeyPoints> + Clone) -> Vec<Lack> {
    let all = frames.clone().count();
    let in_sight = |knuckles: [usize; 2], frame: &FrameKeyPoints| {
        let sure = |at: usize| frame.picture.get(at).is_some_and(|it| it[2] >= IN_SIGHT);
        knuckles.into_iter().all(sure)
    };
    let lack = |(hand, knuckles): (&str, [usize; 2])| {
        let seen = frames
            .clone()
            .filter(|frame| in_sight(knuckles, frame))
            .count();
        ((seen as f64) < OFTEN * all as f64).then(|| Lack {
            what: format!("{hand} in sight in {seen} of {all} frames"),
            effect: "it will be rough".to_owned(),
            instead: "hands open, away from the body, facing the camera for a moment".to_owned(),
        })
    };
    HANDS.into_iter().filter_map(lack).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(left: f64, right: f64) -> FrameKeyPoints {
        let mut picture = vec![[0.0, 0.0, 0.9]; 33];
        picture[17][2] = left;
        picture[18][2] = right;
        FrameKeyPoints {
            picture,
            ..FrameKeyPoints::default()
        }
    }

    #[test]
    fn a_hand_that_is_hidden_most_of_the_time_is_told() {
        let shown = [frame(0.9, 0.9), frame(0.9, 0.8)];
        assert!(lacks(shown.iter()).is_empty());
        let hidden = [frame(0.9, 0.1), frame(0.9, 0.2), frame(0.9, 0.9)];
        let found = lacks(hidden.iter());
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].what, "right hand in sight in 1 of 3 frames");
        assert!(found[0].instead.contains("hands open"), "{found:?}");
    }
}
