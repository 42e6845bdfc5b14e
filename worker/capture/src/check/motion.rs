//! What the pose track tells by itself: how the body moves, and from where it is seen.

use super::fit::view;
use crate::skeleton::Skeleton;
use crate::skeleton::transform::{Vec3, add, apply, inverse, length, scale, sub};
use yoto_proto::pose_track::PoseTrack;

/// Nothing that a person does moves a joint faster, metres a second.
const FASTEST: f64 = 15.0;
/// A jump is also so many times the usual step of the joint that moves most.
const UNUSUAL: f64 = 6.0;
/// A step shorter than this is none, metres.
const STEP: f64 = 0.08;

/// Motion over a whole track.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    /// Frames before which a joint jumps.
    pub jumps: Vec<u32>,
    /// Typical tremble of a joint, metres; none with fewer than four neighbouring frames.
    pub jitter: Option<f64>,
    /// Frames seen from each of 12 directions around the body, from its front to its left.
    pub headings: [usize; 12],
}

impl Motion {
    pub(super) fn of(track: &PoseTrack, skeleton: &Skeleton) -> Self {
        let joints: Vec<Vec<Vec3>> = track
            .frames
            .iter()
            .map(|frame| skeleton.posed_joints(&view(frame, track.image_size).0))
            .collect();
        Self {
            jumps: jumps(track, &joints),
            jitter: jitter(track, &joints),
            headings: headings(track, skeleton),
        }
    }
}

/// Frames between neighbours in the track, at least one.
fn gap(track: &PoseTrack, position: usize) -> f64 {
    let index = |at: usize| i64::from(track.frames[at].index);
    (index(position) - index(position - 1)).abs().max(1) as f64
}

fn jumps(track: &PoseTrack, joints: &[Vec<Vec3>]) -> Vec<u32> {
    // A step is what the fastest joint moves from a frame to the next.
    let steps: Vec<f64> = joints
        .windows(2)
        .enumerate()
        .map(|(i, pair)| {
            let moved = pair[0]
                .iter()
                .zip(&pair[1])
                .map(|(a, b)| length(sub(*b, *a)));
            moved.fold(0.0, f64::max) / gap(track, i + 1)
        })
        .collect();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let limit = FASTEST / track.fps.max(1.0);
    let jumped = |&(_, step): &(usize, &f64)| {
        *step > STEP && (*step > limit.max(STEP) || *step > UNUSUAL * usual.max(STEP / 2.0))
    };
    let found = steps.iter().enumerate().filter(jumped);
    found.map(|(i, _)| track.frames[i + 1].index).collect()
}

/// The third difference of a position, which smooth motion has hardly any of, is noise times
/// the root of 1 + 9 + 9 + 1; its median over joints and frames is not moved by a few jumps.
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
    // The median length of a vector of three unit normals is 1.538.
    Some(found[found.len() / 2] / (1.538 * 20f64.sqrt()))
}

/// Directions are told in the root's frame: y up and z forward at rest, as SMPL stands.
fn headings(track: &PoseTrack, skeleton: &Skeleton) -> [usize; 12] {
    let mut counts = [0; 12];
    for frame in &track.frames {
        let (pose, camera) = view(frame, track.image_size);
        let root = skeleton.root();
        let eye = apply(&inverse(&skeleton.body_to_world(&pose)), camera.centre());
        let [x, _, z] = sub(eye, root);
        let turn = x.atan2(z).to_degrees().rem_euclid(360.0);
        counts[((turn + 15.0) / 30.0) as usize % 12] += 1;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::SyntheticPerson;

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
        let turning = motion(120, |_| {});
        assert!(
            turning.headings.iter().all(|&n| n >= 6),
            "{:?}",
            turning.headings
        );
        assert!(turning.jumps.is_empty(), "{:?}", turning.jumps);
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
