//! Measures of the pose track alone: the body's motion, and the directions from which it is seen.

use super::fit::view;
use crate::skeleton::Skeleton;
use crate::skeleton::transform::{Vec3, add, apply, inverse, length, scale, sub};
use yoto_proto::pose_track::PoseTrack;

/// Highest speed of a joint in any human motion, metres per second.
const FASTEST: f64 = 15.0;
/// A joint that jumps starts and stops within a frame: its acceleration is this multiple of the film's
/// median, and at least `SUDDEN`, metres per second squared.
const UNUSUAL: f64 = 6.0;
const SUDDEN: f64 = 50.0;
/// A shorter movement between two frames is never a jump, metres.
const STEP: f64 = 0.15;

/// Motion over a whole track.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    /// Frames before which a joint jumps.
    pub jumps: Vec<u32>,
    /// Length of the film.
    pub seconds: f64,
    /// Typical jitter of a joint, metres; `None` with fewer than four consecutive frames.
    pub jitter: Option<f64>,
    /// Frames seen from each of 12 directions around the body, from its front to its left.
    pub headings: [usize; 12],
    /// Least and greatest sideways distance of the hands, as shares of the distance with the arms
    /// stretched out; `None` for a skeleton that does not stretch its arms out at rest.
    pub reach: Option<[f64; 2]>,
    /// Median speed of the body's rotation in front of the camera while it rotates, degrees per second.
    pub rotation_speed: f64,
}

impl Motion {
    pub(super) fn of(track: &PoseTrack, skeleton: &Skeleton) -> Self {
        let joints: Vec<Vec<Vec3>> = track
            .frames
            .iter()
            .map(|frame| skeleton.posed_joints(&view(frame, track.image_size).0))
            .collect();
        let directions = directions(track, skeleton);
        Self {
            jumps: jumps(track, &joints),
            seconds: seconds(track),
            jitter: jitter(track, &joints),
            headings: headings(&directions),
            reach: reach(track, skeleton, &joints),
            rotation_speed: rotation_speed(track, &directions),
        }
    }
}

/// Frames between neighbours in the track, at least one.
fn gap(track: &PoseTrack, position: usize) -> f64 {
    let index = |at: usize| i64::from(track.frames[at].index);
    (index(position) - index(position - 1)).abs().max(1) as f64
}

/// Length of `track`.
fn seconds(track: &PoseTrack) -> f64 {
    let gaps = (1..track.frames.len()).map(|position| gap(track, position));
    (1.0 + gaps.sum::<f64>()) / track.fps.max(1.0)
}

/// Frames before which a joint moves too fast, or starts and stops at once. Bounds are per second, so that
/// a motion gets the same verdict at every frame rate.
fn jumps(track: &PoseTrack, joints: &[Vec<Vec3>]) -> Vec<u32> {
    let fps = track.fps.max(1.0);
    let steps: Vec<Vec<Vec3>> = joints
        .windows(2)
        .enumerate()
        .map(|(i, pair)| {
            let frames = gap(track, i + 1);
            let moved = pair[0].iter().zip(&pair[1]);
            moved
                .map(|(a, b)| scale(sub(*b, *a), 1.0 / frames))
                .collect()
        })
        .collect();
    // Per frame of the film: where frames are left out, a step is a mean over several, and steps farther
    // apart differ more.
    let changed = |joint: usize, earlier: usize, later: usize| -> Option<f64> {
        let from = steps.get(earlier)?.get(joint)?;
        let to = steps.get(later)?.get(joint)?;
        let apart = 0.5 * (gap(track, earlier + 1) + gap(track, later + 1));
        Some(length(sub(*to, *from)) / apart)
    };
    // For each step, the movement of the fastest joint, and the greatest change of a joint's step. The
    // change counts if it is large both before and after: a joint that only starts or stops is no jump.
    let found: Vec<[f64; 2]> = (0..steps.len())
        .map(|i| {
            let fastest = steps[i].iter().map(|step| length(*step));
            let sudden = (0..steps[i].len()).map(|joint| {
                let before = i.checked_sub(1).and_then(|last| changed(joint, last, i));
                let sides = [before, changed(joint, i, i + 1)];
                let least = sides.into_iter().flatten().fold(f64::INFINITY, f64::min);
                if least.is_finite() { least } else { 0.0 }
            });
            [fastest.fold(0.0, f64::max), sudden.fold(0.0, f64::max)]
        })
        .collect();
    let mut sorted: Vec<f64> = found.iter().map(|[_, sudden]| *sudden).collect();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let limit = STEP.max(UNUSUAL * usual).max(SUDDEN / (fps * fps));
    let jumped = |&(_, [fastest, sudden]): &(usize, &[f64; 2])| {
        *fastest > STEP.max(FASTEST / fps) || *sudden > limit
    };
    let jumps = found.iter().enumerate().filter(jumped);
    jumps.map(|(i, _)| track.frames[i + 1].index).collect()
}

/// Typical noise of joint positions, metres, from their third differences.
///
/// Smooth motion has hardly any third difference, so it is noise times √(1 + 9 + 9 + 1) = √20, from the
/// coefficients 1, -3, 3, -1. A few jumps don't change its median over joints and frames.
fn jitter(track: &PoseTrack, joints: &[Vec<Vec3>]) -> Option<f64> {
    let mut found = Vec::new();
    for (start, four) in joints.windows(4).enumerate() {
        if (1..4).any(|i| gap(track, start + i) > 1.0) {
            continue;
        }
        let earlier = four[0].iter().zip(&four[1]);
        let later = four[2].iter().zip(&four[3]);
        for ((&a, &b), (&c, &d)) in earlier.zip(later) {
            let third = add(sub(d, a), scale(sub(b, c), 3.0));
            found.push(length(third));
        }
    }
    if found.is_empty() {
        return None;
    }
    found.sort_by(f64::total_cmp);
    // The median length of a vector of three standard normals is 1.538 (chi distribution).
    Some(found[found.len() / 2] / (1.538 * 20f64.sqrt()))
}

/// The direction from which each frame shows the body, degrees from its front towards its left, in the
/// root's frame: y up and z forward at rest, as in SMPL.
fn directions(track: &PoseTrack, skeleton: &Skeleton) -> Vec<f64> {
    let frames = track.frames.iter();
    frames
        .map(|frame| {
            let (pose, camera) = view(frame, track.image_size);
            let eye = apply(&inverse(&skeleton.body_to_world(&pose)), camera.centre());
            let [x, _, z] = sub(eye, skeleton.root());
            x.atan2(z).to_degrees().rem_euclid(360.0)
        })
        .collect()
}

fn headings(directions: &[f64]) -> [usize; 12] {
    let mut counts = [0; 12];
    for direction in directions {
        counts[((direction + 15.0) / 30.0) as usize % 12] += 1;
    }
    counts
}

/// The median speed over the frames in which the body rotates, degrees per second.
fn rotation_speed(track: &PoseTrack, directions: &[f64]) -> f64 {
    /// A slower body counts as standing, degrees per second.
    const STANDING: f64 = 10.0;
    let pairs = directions.windows(2).enumerate();
    let mut speeds: Vec<f64> = pairs
        .map(|(i, pair)| {
            let by = (pair[1] - pair[0] + 180.0).rem_euclid(360.0) - 180.0;
            by.abs() * track.fps.max(1.0) / gap(track, i + 1)
        })
        .filter(|speed| *speed > STANDING)
        .collect();
    speeds.sort_by(f64::total_cmp);
    speeds.get(speeds.len() / 2).copied().unwrap_or(0.0)
}

/// Sideways distances of the hands from the root in the body's own frame. Hands are the joints farthest
/// from the middle at rest. Of both hands the farther one counts: raising one arm at a time is enough.
fn reach(track: &PoseTrack, skeleton: &Skeleton, joints: &[Vec<Vec3>]) -> Option<[f64; 2]> {
    let [root_x, _, _] = skeleton.root();
    let aside = |joint: &usize| skeleton.rest[*joint][0] - root_x;
    let all = || 0..skeleton.rest.len();
    let left = all().max_by(|a, b| aside(a).total_cmp(&aside(b)))?;
    let right = all().min_by(|a, b| aside(a).total_cmp(&aside(b)))?;
    let bounds = skeleton.rest_bounds(0.0);
    let height = bounds.max[1] - bounds.min[1];
    // If the arms hang at rest, their reach is unknown.
    if aside(&left) < 0.3 * height || aside(&right) > -0.3 * height {
        return None;
    }
    let mut reach = [f64::INFINITY, f64::NEG_INFINITY];
    for (frame, joints) in track.frames.iter().zip(joints) {
        let to_body = inverse(&skeleton.body_to_world(&view(frame, track.image_size).0));
        let share = |joint: usize| (apply(&to_body, joints[joint])[0] - root_x) / aside(&joint);
        let farther = share(left).max(share(right));
        reach = [reach[0].min(farther), reach[1].max(farther)];
    }
    reach[0].is_finite().then_some(reach)
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_synthetic::SyntheticPerson;

    fn motion(frames: usize, break_it: impl FnOnce(&mut PoseTrack)) -> Motion {
        let person = &SyntheticPerson::cast(1, 4)[0];
        let camera = SyntheticPerson::train_camera(32);
        let poses = person.motion(frames);
        let mut track = PoseTrack {
            skeleton: person.skeleton(),
            image_size: [32, 32],
            distortion: [0.0; 5],
            fps: 15.0,
            frames: (0..)
                .zip(&poses)
                .map(|(i, pose)| camera.to_frame(i, pose))
                .collect(),
        };
        break_it(&mut track);
        let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
        Motion::of(&track, &skeleton)
    }

    #[test]
    fn a_body_that_turns_is_seen_from_all_sides() {
        let walk = motion(120, |_| {});
        assert!(walk.headings.iter().all(|&n| n >= 6), "{:?}", walk.headings);
        assert!(walk.jumps.is_empty(), "{:?}", walk.jumps);
        let still = motion(24, |track| {
            for frame in &mut track.frames {
                frame.pose[..3].fill(0.0);
            }
        });
        assert_eq!(still.headings[0], 24);
        let left = motion(24, |track| {
            for frame in &mut track.frames {
                // The body turns its left side (+x) to the camera at +z.
                frame.pose[..3].copy_from_slice(&[0.0, -std::f64::consts::FRAC_PI_2, 0.0]);
            }
        });
        assert_eq!(left.headings[3], 24);
    }

    #[test]
    fn a_jump_is_found_where_it_is_and_jitter_as_large_as_it_is() {
        let jump = motion(120, |track| {
            for frame in &mut track.frames[50..] {
                frame.translation[0] += 1.2;
            }
        });
        assert_eq!(jump.jumps, [50]);
        // The same motion at two rates. Steps of 0.3 m at the lower one are no jump.
        let fast = |frames: usize, fps: f64| {
            motion(frames, |track| {
                track.fps = fps;
                for (i, frame) in track.frames.iter_mut().enumerate() {
                    let time = i as f64 / fps;
                    frame.translation[0] += 0.4 * (std::f64::consts::TAU * 2.5 * time).sin();
                }
            })
        };
        let rates = [fast(40, 15.0), fast(80, 30.0)].map(|it| (it.jumps.len(), it.seconds));
        assert_eq!(rates[0].0, 0, "{rates:?}");
        assert_eq!(rates[1].0, 0, "{rates:?}");
        assert!((rates[0].1 - rates[1].1).abs() < 1e-9, "{rates:?}");
        // Every second frame of the faster one.
        let thinned = motion(40, |track| {
            track.fps = 30.0;
            for (i, frame) in track.frames.iter_mut().enumerate() {
                frame.index *= 2;
                let time = i as f64 / 15.0;
                frame.translation[0] += 0.4 * (std::f64::consts::TAU * 2.5 * time).sin();
            }
        });
        assert!(thinned.jumps.is_empty(), "{:?}", thinned.jumps);
        let smooth = motion(120, |_| {}).jitter.expect("enough frames");
        let mut state = 1u32;
        let mut uniform = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1u32 << 24) - 0.5
        };
        let noisy = motion(120, |track| {
            for frame in &mut track.frames {
                for value in &mut frame.translation {
                    // Uniform noise with a standard deviation of 2 cm.
                    *value += 0.02 * 12f64.sqrt() * uniform();
                }
            }
        });
        let noisy = noisy.jitter.expect("enough frames");
        assert!(
            smooth < 0.01 && (noisy - 0.02).abs() < 0.006,
            "{smooth} {noisy}"
        );
    }
}
