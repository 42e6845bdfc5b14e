//! Tells whether the hands are in sight, large enough, and open to the camera. The pose model marks the knuckles of thumb, index and little
//! finger: too few points to tell a fist from an open hand, but enough to tell the flat of a hand from its edge.

use yoto_capture::camera::{Camera, Pose};
use yoto_capture::check::Lack;
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::transform::{add, dot, normalised, position, rotate, scale, sub};
use yoto_pose::FrameKeyPoints;
use yoto_proto::pose_track::{Frame, PoseTrack};

/// A hand's name, BlazePose's wrist and its knuckles of little finger and index finger, and its wrist's joint in a fitted track.
type Hand = (&'static str, [usize; 3], usize);

const HANDS: [Hand; 2] = [
    ("left hand", [15, 17, 19], 20),
    ("right hand", [16, 18, 20], 21),
];
/// Least confidence of a point in sight.
const IN_SIGHT: f64 = 0.5;
/// A hand should be in sight in this share of the frames.
const OFTEN: f64 = 0.5;
/// The flat of a hand is seen if the angle between the view and the palm's normal is at most 60°: its cosine.
const FLAT: f64 = 0.5;
/// The flat of a hand should be seen in this share of the frames that show the hand.
const OPEN: f64 = 0.1;

/// Length of a hand from which its fingers can be told, pixels, and its length in distances from the wrist to the first knuckles.
const SMALLEST: f64 = 24.0;
const LENGTH: f64 = 2.0;

/// The hands that are in sight too seldom, too small, or hardly ever open to the camera; `track` has the fitted poses of `frames`.
pub(super) fn lacks(frames: &[FrameKeyPoints], track: &PoseTrack) -> Vec<Lack> {
    let lack = |hand: Hand| -> Option<Lack> {
        let (name, points, wrist) = hand;
        let is_in_sight = |frame: &FrameKeyPoints| {
            let sure = |at: usize| frame.picture.get(at).is_some_and(|it| it[2] >= IN_SIGHT);
            points.into_iter().skip(1).all(sure)
        };
        let poses = frames.iter().zip(&track.frames);
        let seen: Vec<&Frame> = poses
            .filter(|(points, _)| is_in_sight(points))
            .map(|(_, pose)| pose)
            .collect();
        let what = if (seen.len() as f64) < OFTEN * frames.len() as f64 {
            format!(
                "{name} in sight in {} of {} frames",
                seen.len(),
                frames.len()
            )
        } else if let Some(pixels) = length(frames, points).filter(|it| *it < SMALLEST) {
            return Some(Lack {
                what: format!("{name} {pixels:.0} pixels long"),
                effect: "its fingers can't be told, and stay half open".to_owned(),
                instead: "nearer to the camera, or with more pixels".to_owned(),
            });
        } else {
            let skeleton = Skeleton::from_track(&track.skeleton).ok()?;
            let is_flat = |frame: &&&Frame| is_flat(&skeleton, frame, track.image_size, wrist);
            let flat = seen.iter().filter(is_flat).count();
            if flat as f64 >= OPEN * seen.len() as f64 {
                return None;
            }
            let edges = seen.len() - flat;
            format!(
                "{name} seen from its edge in {edges} of {} frames",
                seen.len()
            )
        };
        Some(Lack {
            what,
            effect: "it will be rough".to_owned(),
            instead: "hands open, away from the body, facing the camera for a moment".to_owned(),
        })
    };
    HANDS.into_iter().filter_map(lack).collect()
}

/// The median length of the hand with these points, pixels; `None` if no frame has them.
fn length(frames: &[FrameKeyPoints], points: [usize; 3]) -> Option<f64> {
    let length = |frame: &FrameKeyPoints| {
        let [wrist, little, index] = points.map(|at| frame.picture.get(at).copied());
        let ([x, y, _], [u, v, _], [s, t, _]) = (wrist?, little?, index?);
        Some(LENGTH * (x - 0.5 * (u + s)).hypot(y - 0.5 * (v + t)))
    };
    let mut lengths: Vec<f64> = frames.iter().filter_map(length).collect();
    lengths.sort_by(f64::total_cmp);
    lengths.get(lengths.len() / 2).copied()
}

/// Whether palm or back of the hand at the joint `wrist` faces the camera.
fn is_flat(skeleton: &Skeleton, frame: &Frame, image_size: [u32; 2], wrist: usize) -> bool {
    let (Ok(pose), Ok(camera)) = (
        Pose::from_frame(frame),
        Camera::from_frame(frame, image_size),
    ) else {
        return false;
    };
    let transforms = skeleton.world_transforms(&pose);
    transforms.get(wrist).is_some_and(|hand| {
        let towards = normalised(sub(eye(&camera), position(hand)));
        // In the T-pose the palms face down.
        dot(rotate(hand, [0.0, 1.0, 0.0]), towards).abs() >= FLAT
    })
}

/// The position of a camera.
fn eye(camera: &Camera) -> [f64; 3] {
    camera.e.iter().take(3).fold([0.0; 3], |sum, row| {
        let [x, y, z, shift] = *row;
        add(sum, scale([x, y, z], -shift))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_synthetic::SyntheticPerson;

    fn points(left: f64, right: f64) -> FrameKeyPoints {
        let mut picture = vec![[0.0, 0.0, 0.9]; 33];
        for (point, confidence) in [(17, left), (19, 0.9), (18, right), (20, 0.9)] {
            picture[point] = [30.0, 0.0, confidence];
        }
        FrameKeyPoints {
            picture,
            ..FrameKeyPoints::default()
        }
    }

    /// Frames in which a person stands with the arms out and both wrists twisted by an angle, from the palm down.
    fn stands(twist: f32, count: usize) -> PoseTrack {
        let person = &SyntheticPerson::cast(1, 7)[0];
        let camera = SyntheticPerson::train_camera(64);
        let (mut track, _) = person.capture(1, 16);
        track.image_size = [64; 2];
        let mut pose = Pose::rest(24);
        for (_, _, wrist) in HANDS {
            pose.rotations[wrist] = [twist, 0.0, 0.0];
        }
        let frames = 0..count as u32;
        track.frames = frames.map(|index| camera.to_frame(index, &pose)).collect();
        track
    }

    #[test]
    fn a_hand_that_is_hidden_most_of_the_time_is_told() {
        let open = stands(1.5, 3);
        let shown = [points(0.9, 0.9), points(0.9, 0.8), points(0.9, 0.9)];
        assert!(lacks(&shown, &open).is_empty());
        let hidden = [points(0.9, 0.1), points(0.9, 0.2), points(0.9, 0.9)];
        let found = lacks(&hidden, &open);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].what, "right hand in sight in 1 of 3 frames");
        assert!(found[0].instead.contains("hands open"), "{found:?}");
    }

    #[test]
    fn a_hand_of_few_pixels_is_told() {
        let mut far = points(0.9, 0.9);
        far.picture.iter_mut().for_each(|point| point[0] *= 0.3);
        let found = lacks(&vec![far; 3], &stands(1.5, 3));
        let what: Vec<&str> = found.iter().map(|it| &*it.what).collect();
        assert_eq!(
            what,
            ["left hand 18 pixels long", "right hand 18 pixels long"]
        );
    }

    #[test]
    fn hands_that_are_never_open_to_the_camera_are_told() {
        let shown = vec![points(0.9, 0.9); 12];
        for twist in [0.0, 0.4, 3.0] {
            let found = lacks(&shown, &stands(twist, 12));
            let what: Vec<&str> = found.iter().map(|it| &*it.what).collect();
            let edge = ["left", "right"]
                .map(|side| format!("{side} hand seen from its edge in 12 of 12 frames"));
            assert_eq!(what, edge, "{twist}");
        }
        for twist in [0.8, 1.5, -1.5] {
            assert!(lacks(&shown, &stands(twist, 12)).is_empty(), "{twist}");
        }
        let mut once = stands(0.0, 12);
        once.frames[..2].clone_from_slice(&stands(1.5, 2).frames);
        assert!(lacks(&shown, &once).is_empty(), "two frames of twelve");
    }
}
