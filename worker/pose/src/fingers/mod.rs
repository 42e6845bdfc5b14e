//! Fingers, by a detector that looks at hands alone: joints of fingers are added to a track where a film shows hands.
//!
//! A finger bends at three joints and spreads at the first, which is read off the directions of its bones beside the palm
//! ([`angles`]). Angles of all frames are smoothed together; where a hand is not seen they become those of a hand at rest
//! ([`smoothed`]).

mod angles;

use crate::parts::sight;
use crate::smooth::{Seen, Smoothing, smoothed};
use crate::{HandPoints, KeyPoints};
use angles::{HandShape, NUMBERS, relaxed};
use yoto_capture::skeleton::fingers::with_fingers;
use yoto_capture::skeleton::smpl::JOINTS;
use yoto_capture::skeleton::transform::{log_map, matvec};
use yoto_capture::skeleton::{Skeleton, Vec3};
use yoto_proto::pose_track::PoseTrack;

/// Frames that must show a hand, and their share of the film.
const FEWEST: usize = 5;
const LEAST_SHARE: f64 = 0.05;
/// Pixels from the wrist to the middle finger's first joint from which a hand counts in full: smaller ones are read less exactly.
const LARGE: f64 = 20.0;
/// How fingers are smoothed (docs/research/poses.md, "Fingers").
const SMOOTHING: Smoothing<NUMBERS> = Smoothing {
    time: 0.12,
    median: 0.11,
    error: [0.3; NUMBERS],
};

/// Adds fingers to `track`, which was fitted to `points` with a camera of this `focal` length, pixels. A track of a film that does not show
/// hands is not changed. Returns the number of frames that show the left and the right hand.
pub(crate) fn add(points: &KeyPoints, focal: f64, track: &mut PoseTrack) -> [usize; 2] {
    let frames = points.frames.len();
    let shown = [0, 1].map(|side| {
        let all = points.frames.iter();
        all.filter(|frame| frame.hands[side].is_some()).count()
    });
    let enough = |count: usize| count >= FEWEST && count as f64 >= LEAST_SHARE * frames as f64;
    let plain = Skeleton::from_track(&track.skeleton).ok();
    let Some(skeleton) = plain.and_then(|it| with_fingers(&it)) else {
        return [0; 2];
    };
    if !shown.into_iter().any(enough) {
        return [0; 2];
    }
    let [width, height] = points.image_size.map(f64::from);
    let camera = [0.5 * width, 0.5 * height, focal];
    let angles = [0, 1].map(|side| {
        let shape = HandShape::of(&skeleton, side);
        let seen = points.frames.iter().map(|frame| {
            let hand = frame.hands[side].as_ref()?;
            Some(Seen {
                angles: shape.as_ref()?.read(&in_camera(hand, camera))?,
                weight: hand.confidence * size(hand).min(1.0).powi(2),
            })
        });
        let times = points
            .frames
            .iter()
            .map(|it| f64::from(it.index) / points.fps);
        let smoothed = smoothed(
            &times.collect::<Vec<_>>(),
            &seen.collect::<Vec<_>>(),
            &relaxed(),
            &SMOOTHING,
        );
        (shape, smoothed)
    });
    track.skeleton = skeleton.to_track();
    for (at, frame) in track.frames.iter_mut().enumerate() {
        frame.pose.truncate(3 * JOINTS.len());
        for (shape, angles) in &angles {
            let rotations = match shape {
                Some(shape) => shape.rotations(&angles[at]).map(|it| log_map(&it)),
                None => [[0.0; 3]; 15],
            };
            frame.pose.extend(rotations.as_flattened());
        }
    }
    shown
}

/// Size of a hand in its picture, as a multiple of [`LARGE`].
fn size(hand: &HandPoints) -> f64 {
    let ([x, y], [u, v]) = (hand.picture[0], hand.picture[9]);
    (x - u).hypot(y - v) / LARGE
}

/// The points of a hand in the camera's axes: its detector sees it as if the camera looked straight at it.
fn in_camera(hand: &HandPoints, camera: [f64; 3]) -> [Vec3; 21] {
    let sight = sight(hand.picture[0], camera);
    hand.space.map(|point| matvec(&sight, point))
}
