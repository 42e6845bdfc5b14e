//! Expressions, by a detector that looks at faces alone: jaw and eyelids are added to a track where a film shows a face that moves them.
//!
//! The jaw's angle is that of the gap between the lips about the jaw's axis. An eyelid's angle is that of the eye's aperture, relative to
//! the usual one in the seconds around: how far an eye seems open differs from person to person, and as the head turns and nods.

use crate::parts::EYES;
use crate::problem::quantile;
use crate::smooth::{Seen, Smoothing, smoothed};
use crate::{FacePoints, KeyPoints};
use yoto_capture::skeleton::parts::with_count;
use yoto_capture::skeleton::smpl::{WITH_FACE, WITH_FINGERS};
use yoto_capture::skeleton::transform::{length, sub};
use yoto_capture::skeleton::{Skeleton, fingers};
use yoto_proto::pose_track::PoseTrack;

/// Frames that must show a face, and their share of the film.
const FEWEST: usize = 5;
const LEAST_SHARE: f64 = 0.05;
/// Smallest face whose mouth can be read, pixels between the outer corners of the eyes.
const SMALLEST_FACE: f64 = 24.0;
/// Smallest one whose eyelids can be read: an eyelid moves by some 3 pixels.
const SMALLEST_EYES: f64 = 40.0;
/// Largest share of that distance that is depth: a face in profile hides one eye.
const PROFILE: f64 = 0.7;
/// Distance of the lips from the jaw's axis, metres.
const LIPS: f64 = 0.094;
/// Largest angle of the jaw, and the largest that counts as a closed mouth, radians: lips that touch have points 1 to 4 mm apart.
const WIDEST: f64 = 0.5;
const CLOSED: f64 = 0.05;
/// The share of the frames with smaller angles than a closed mouth has.
const LOW: f64 = 0.1;
/// Time to either side whose median aperture is the open eye's, seconds. Eyes that are closed for longer count as open.
const AROUND: f64 = 1.0;
/// Apertures of an eye that begins to close and of a closed one, as shares of the open one: the face model shows closed eyes as narrow ones
/// (docs/research/poses.md, "Expressions").
const APERTURES: [f64; 2] = [0.85, 0.7];
/// Angle by which a closed eyelid is turned, radians: the eye's aperture in the shared body.
const SHUT: f64 = 0.55;
/// Largest angle of a film that is a face at rest, radians.
const STILL: f64 = 0.12;
/// How expressions are smoothed: a blink lasts 0.1 to 0.3 seconds.
const SMOOTHING: Smoothing<3> = Smoothing {
    time: 0.03,
    median: 0.05,
    error: [0.015, 0.04, 0.04],
};

/// Adds jaw, eyes and eyelids to `track`, which was fitted to `points`, and fingers if it has none. A track of a film whose face can't be
/// read, or does not move, is not changed. Returns the number of frames that tell the expression.
pub(crate) fn add(points: &KeyPoints, track: &mut PoseTrack) -> usize {
    let read: Vec<Option<Face>> = (points.frames.iter())
        .map(|frame| frame.face.as_ref().and_then(Face::read))
        .collect();
    let shown = read.iter().flatten().count();
    let plain = Skeleton::from_track(&track.skeleton).ok();
    let skeleton = plain.and_then(|it| with_count(&it, WITH_FACE));
    let enough = shown >= FEWEST && shown as f64 >= LEAST_SHARE * points.frames.len() as f64;
    let Some(skeleton) = skeleton.filter(|_| enough) else {
        return 0;
    };
    let mut jaws: Vec<f64> = read.iter().flatten().map(|it| it.jaw).collect();
    let closed = quantile(&mut jaws, LOW).min(CLOSED);
    let times = points.frames.iter();
    let times: Vec<f64> = times.map(|it| f64::from(it.index) / points.fps).collect();
    let seen: Vec<Option<Seen<3>>> = (read.iter().zip(&times))
        .map(|(face, time)| {
            let face = face.as_ref()?;
            let near = || {
                let near = times.iter().zip(&read);
                let near = near.filter(|(other, _)| (*other - time).abs() <= AROUND);
                near.filter_map(|(_, face)| face.as_ref()?.eyes)
            };
            let [left, right] = match face.eyes {
                Some(eyes) => [0, 1].map(|side| {
                    let mut apertures: Vec<f64> = near().map(|eyes| eyes[side]).collect();
                    let open = quantile(&mut apertures, 0.5);
                    eyelid(eyes[side] / open.max(f64::MIN_POSITIVE))
                }),
                None => [0.0; 2],
            };
            Some(Seen {
                angles: [(face.jaw - closed).clamp(0.0, WIDEST), left, right],
                weight: face.weight,
            })
        })
        .collect();
    let smoothed = smoothed(&times, &seen, &[0.0; 3], &SMOOTHING);
    if smoothed.as_flattened().iter().all(|angle| *angle < STILL) {
        return 0;
    }
    track.skeleton = skeleton.to_track();
    for (frame, [jaw, left, right]) in track.frames.iter_mut().zip(smoothed) {
        // A film without hands has them half open.
        for joint in frame.pose.len() / 3..WITH_FINGERS {
            let relaxed = fingers::relaxed(joint).unwrap_or_default();
            frame.pose.extend(relaxed.map(f64::from));
        }
        for angle in [jaw, 0.0, 0.0, left, right] {
            frame.pose.extend([angle, 0.0, 0.0]);
        }
    }
    shown
}

/// A face in one frame.
struct Face {
    /// The jaw's angle, radians.
    jaw: f64,
    /// The apertures of the left and the right eye as shares of the distance from the eyes to the mouth; `None` if they are too small.
    eyes: Option<[f64; 2]>,
    /// From 0 to 1.
    weight: f64,
}

impl Face {
    /// The face with these points; `None` if it is too small or in profile.
    fn read(face: &FacePoints) -> Option<Self> {
        let distance = |a: [f64; 3], b: [f64; 3]| length(sub(a, b));
        let [_, _, _, left, _, _, right, left_mouth, right_mouth] = face.picture;
        let across = distance(left, right);
        if across < SMALLEST_FACE || (left[2] - right[2]).abs() > PROFILE * across {
            return None;
        }
        let gap = distance(face.lips[0], face.lips[1]) * EYES / across;
        let jaw = 2.0 * (0.5 * gap / LIPS).min(1.0).asin();
        // Heights of eyes and of the face shrink alike as the head nods, and neither does as it turns.
        let middle = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|axis| 0.5 * (a[axis] + b[axis]));
        let flat = |a: [f64; 3], b: [f64; 3]| (a[0] - b[0]).hypot(a[1] - b[1]);
        let high = flat(middle(left, right), middle(left_mouth, right_mouth));
        let eyes = face.eyelids.map(|[upper, lower]| flat(upper, lower) / high);
        let is_finite = [jaw, eyes[0], eyes[1]].iter().all(|it| it.is_finite());
        is_finite.then_some(Self {
            jaw,
            eyes: (across >= SMALLEST_EYES).then_some(eyes),
            weight: face.confidence,
        })
    }
}

/// The angle of an eyelid by its eye's aperture as a share of the open one.
fn eyelid(aperture: f64) -> f64 {
    let [begins, closed] = APERTURES;
    SHUT * ((begins - aperture) / (begins - closed)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameKeyPoints, KeyPointSet};
    use yoto_capture::skeleton::smpl::{AVERAGE_REST, JOINTS};
    use yoto_proto::pose_track::Frame;

    /// A face from before, whose eyes' outer corners are this far apart, with an open mouth and open eyes as told, from 0 to 1.
    fn face(pixels: f64, mouth: f64, eyes: [f64; 2]) -> FacePoints {
        let at = |x: f64, y: f64| [pixels * x, pixels * y, 0.0];
        let eyelids = [0, 1].map(|side| {
            let (x, half) = ([0.34, -0.34][side], 0.05 * eyes[side]);
            [at(x, -half), at(x, half)]
        });
        let corners = [0.2, 0.34, 0.5].map(|x| at(x, 0.0));
        let right = [-0.2, -0.34, -0.5].map(|x| at(x, 0.0));
        let mut picture = [at(0.0, 0.4); 9];
        picture[1..4].copy_from_slice(&corners);
        picture[4..7].copy_from_slice(&right);
        FacePoints {
            picture,
            lips: [at(0.0, 0.7), at(0.0, 0.71 + 0.3 * mouth)],
            eyelids,
            confidence: 0.95,
        }
    }

    /// A film of faces, and the track of a body that stands still.
    fn film(faces: Vec<Option<FacePoints>>) -> (KeyPoints, PoseTrack) {
        let frame = |(index, face)| FrameKeyPoints {
            index,
            face,
            ..FrameKeyPoints::default()
        };
        let points = KeyPoints {
            set: KeyPointSet::BlazePose33,
            image_size: [640, 480],
            fps: 30.0,
            frames: (0..).zip(faces).map(frame).collect(),
        };
        let track = PoseTrack {
            skeleton: Skeleton {
                names: JOINTS.map(|(name, _)| name.to_owned()).to_vec(),
                parents: JOINTS.map(|(_, parent)| parent).to_vec(),
                rest: AVERAGE_REST.to_vec(),
            }
            .to_track(),
            image_size: [640, 480],
            fps: 30.0,
            distortion: [0.0; 5],
            frames: (points.frames.iter())
                .map(|frame| Frame {
                    index: frame.index,
                    pose: vec![0.0; 3 * JOINTS.len()],
                    translation: [0.0, 0.0, 3.0],
                    k: [[600.0, 0.0, 320.0], [0.0, 600.0, 240.0], [0.0, 0.0, 1.0]],
                    e: [[0.0; 4]; 4],
                })
                .collect(),
        };
        (points, track)
    }

    /// The angle about x of a joint in each frame.
    fn angles(track: &PoseTrack, joint: usize) -> Vec<f64> {
        track.frames.iter().map(|it| it.pose[3 * joint]).collect()
    }

    #[test]
    fn a_mouth_that_speaks_and_eyes_that_blink_move_the_face() {
        let mouth = |at: usize| 0.5 - 0.5 * (at as f64 * 0.3).cos();
        let faces = (0..60).map(|at| {
            let eyes = if (20..25).contains(&at) { 0.0 } else { 1.0 };
            (at < 50).then(|| face(60.0, mouth(at), [eyes, 1.0]))
        });
        let (points, mut track) = film(faces.collect());
        assert_eq!(add(&points, &mut track), 50);
        assert_eq!(track.joints(), WITH_FACE);
        assert!(track.frames.iter().all(|it| it.pose.len() == 3 * WITH_FACE));
        let jaw = angles(&track, 54);
        // 0.3 of 90 mm, 94 mm from the axis.
        assert!((jaw[10] - 0.28).abs() < 0.05, "{}", jaw[10]);
        assert!(jaw[0] < 0.05 && jaw[20] < 0.08, "{} {}", jaw[0], jaw[20]);
        let [left, right] = [57, 58].map(|joint| angles(&track, joint));
        assert!(left[22] > 0.4 && left[10] < 0.02, "{left:?}");
        assert!(right.iter().all(|angle| angle.abs() < 0.02), "{right:?}");
        // Where nobody is seen, the face comes to rest.
        assert!(left[59] < 0.02);
        // Fingers, which no frame shows, are half open.
        assert!(
            track.frames[0].pose[3 * 24..3 * 54]
                .iter()
                .any(|it| *it != 0.0)
        );
    }

    #[test]
    fn a_face_that_tells_nothing_changes_nothing() {
        let profile = |mut it: FacePoints| {
            it.picture[3][2] = 60.0;
            it
        };
        let moving = |at: usize| 0.5 - 0.5 * (at as f64 * 0.3).cos();
        let films: [&dyn Fn(usize) -> Option<FacePoints>; 6] = [
            &|at| Some(face(SMALLEST_FACE - 1.0, moving(at), [1.0; 2])),
            &|at| Some(profile(face(60.0, moving(at), [1.0; 2]))),
            &|at| (at < 4).then(|| face(60.0, moving(at), [1.0; 2])),
            // Eyes that blink are too small to be read, and the mouth is closed.
            &|at| {
                Some(face(
                    SMALLEST_EYES - 1.0,
                    0.0,
                    [if at % 20 < 4 { 0.0 } else { 1.0 }; 2],
                ))
            },
            // A head that nods slowly, so that its eyes seem narrower.
            &|at| Some(face(60.0, 0.0, [1.0 - at as f64 / 600.0; 2])),
            // A face at rest, whose points tremble.
            &|at| {
                Some(face(
                    60.0,
                    0.02 * moving(7 * at),
                    [0.95 + 0.05 * moving(at); 2],
                ))
            },
        ];
        for (at, faces) in films.into_iter().enumerate() {
            let (points, mut track) = film((0..240).map(faces).collect());
            let before = track.clone();
            assert_eq!(add(&points, &mut track), 0, "{at}");
            assert_eq!(track, before, "{at}");
        }
    }
}
