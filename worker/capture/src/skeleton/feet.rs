//! Feet that rest on the ground. If a foot rests in the driver's motion, the legs of another body, which have
//! other proportions, are bent so that its foot rests too.

use super::transform::{
    Mat34, Vec3, add, apply, compose_axis_angle, cross, dot, inverse, length, normalised, position,
    rigid, rodrigues, rotate, scale, sub,
};
use super::{Pose, Skeleton};

/// Highest speed of the ball of a resting foot, hip heights per second: 0.18 m/s for an adult. Feet swing
/// ten times faster in a walk.
const RESTING_SPEED: f64 = 0.2;
/// Time over which a foot's speed is measured, seconds: estimated poses tremble from frame to frame.
const SPEED_WINDOW: f64 = 0.2;
/// Greatest height of a resting foot above the other one, hip heights.
const RESTING_HEIGHT: f64 = 0.07;
/// Longest reach of a leg, as a share of its length. A fully straight leg has no direction to bend in.
const REACH: f64 = 0.9995;
/// A vector shorter than this has no direction, metres.
const TINY: f64 = 1e-6;

/// A joint may be below the floor in this share of the poses, because estimates tremble.
const BELOW_FLOOR: f64 = 0.1;

/// Joints of a leg: hip, knee, ankle and the ball of the foot.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Leg {
    hip: usize,
    knee: usize,
    ankle: usize,
    ball: usize,
}

/// The resting feet in each pose of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Footing {
    /// For the left and the right foot, whether it rests, one entry per pose.
    pub rests: [Vec<bool>; 2],
}

impl Footing {
    /// The footing of the driver's `poses`, at the times `seconds`, in a world with the unit vector `up`. A
    /// body without legs of the usual names never rests.
    pub fn of(driver: &Skeleton, poses: &[Pose], seconds: &[f64], up: Vec3) -> Self {
        let none = || vec![false; poses.len()];
        let (Some(legs), Ok(size)) = (driver.legs(), driver.hip_height()) else {
            return Self {
                rests: [none(), none()],
            };
        };
        let joints: Vec<_> = poses.iter().map(|pose| driver.posed_joints(pose)).collect();
        let balls = legs.map(|leg| joints.iter().map(|it| it[leg.ball]).collect::<Vec<_>>());
        let lowest = |pose: usize| dot(balls[0][pose], up).min(dot(balls[1][pose], up));
        let rests = [0, 1].map(|side| {
            let rests = (0..poses.len()).map(|pose| {
                let low = dot(balls[side][pose], up) - lowest(pose) < RESTING_HEIGHT * size;
                let slow = speed(&balls[side], seconds, pose) < RESTING_SPEED * size;
                low && slow
            });
            rests.collect()
        });
        Self { rests }
    }

    /// Mean speed of the balls of resting feet in the `poses` of `body`, at the times `seconds`, metres per
    /// second; `None` if no foot rests in two poses in a row.
    pub fn sliding(&self, body: &Skeleton, poses: &[Pose], seconds: &[f64]) -> Option<f64> {
        let legs = body.legs()?;
        let joints: Vec<_> = poses.iter().map(|pose| body.posed_joints(pose)).collect();
        let (mut distance, mut time) = (0.0, 0.0);
        for (leg, rests) in legs.iter().zip(&self.rests) {
            for at in 1..joints.len().min(rests.len()) {
                if rests[at - 1] && rests[at] {
                    distance += length(sub(joints[at][leg.ball], joints[at - 1][leg.ball]));
                    time += seconds[at] - seconds[at - 1];
                }
            }
        }
        (time > 0.0).then(|| distance / time)
    }

    /// Bends the legs in the `poses` of `body`, at the times `seconds`, so that a resting foot stays at its
    /// mean position. The shift of a foot in the air changes smoothly from one rest to the next. Feet keep
    /// their directions, and everything above the hips stays.
    pub fn plant(&self, body: &Skeleton, poses: &mut [Pose], seconds: &[f64]) {
        let Some(legs) = body.legs() else {
            return;
        };
        for (leg, rests) in legs.iter().zip(&self.rests) {
            let positions = poses.iter().map(|pose| body.posed_joints(pose)[leg.ball]);
            let steps = steps(&positions.collect::<Vec<_>>(), rests, seconds);
            for (pose, step) in poses.iter_mut().zip(steps) {
                body.move_foot(*leg, pose, step);
            }
        }
    }
}

impl Skeleton {
    /// The height of the floor along the unit vector `up`: the height of the lowest joint in the lowest of `poses`; 0 without
    /// poses.
    pub fn floor(&self, poses: &[Pose], up: Vec3) -> f64 {
        let lowest = |pose: &Pose| {
            let joints = self.posed_joints(pose);
            joints
                .iter()
                .map(|joint| dot(*joint, up))
                .fold(f64::INFINITY, f64::min)
        };
        let mut heights: Vec<f64> = poses.iter().map(lowest).collect();
        heights.sort_by(f64::total_cmp);
        let at = (BELOW_FLOOR * heights.len() as f64) as usize;
        heights.get(at).copied().unwrap_or_default()
    }
}

/// Speed of a joint around the pose `at`, from its `positions` in all poses, metres per second.
fn speed(positions: &[Vec3], seconds: &[f64], at: usize) -> f64 {
    let near = |other: &usize| (seconds[*other] - seconds[at]).abs() <= SPEED_WINDOW / 2.0;
    let first = (0..at).rev().take_while(near).last();
    let last = (at + 1..positions.len()).take_while(near).last();
    let first = first.unwrap_or(at.saturating_sub(1));
    let last = last.unwrap_or((at + 1).min(positions.len() - 1));
    let time = seconds[last] - seconds[first];
    match time > 0.0 {
        true => length(sub(positions[last], positions[first])) / time,
        false => f64::INFINITY,
    }
}

/// The shift of a foot in each pose, so that it stands still while it rests; `positions` are the foot's in all
/// poses.
fn steps(positions: &[Vec3], rests: &[bool], seconds: &[f64]) -> Vec<Vec3> {
    let mut steps = vec![[0.0; 3]; positions.len()];
    let mut before: Option<usize> = None;
    let mut at = 0;
    while at < positions.len() {
        if !rests.get(at).copied().unwrap_or_default() {
            at += 1;
            continue;
        }
        let end = (at..positions.len()).take_while(|it| rests[*it]).count() + at;
        let sum = positions[at..end]
            .iter()
            .fold([0.0; 3], |sum, p| add(sum, *p));
        let mean = scale(sum, 1.0 / (end - at) as f64);
        for it in at..end {
            steps[it] = sub(mean, positions[it]);
        }
        let from = before.map_or(steps[at], |before| steps[before]);
        let to = steps[at];
        let first = before.map_or(0, |before| before + 1);
        for it in first..at {
            let since = before.map_or(seconds[at], |before| seconds[before]);
            let share = (seconds[it] - since) / (seconds[at] - since).max(TINY);
            // Smoothstep: the foot leaves and lands without a jump of its speed.
            let smooth = share * share * (3.0 - 2.0 * share);
            steps[it] = add(from, scale(sub(to, from), smooth));
        }
        before = Some(end - 1);
        at = end;
    }
    if let Some(last) = before {
        let held = steps[last];
        steps[last + 1..].fill(held);
    }
    steps
}

impl Skeleton {
    /// The left and the right leg, if the joints have the usual names and form a chain.
    fn legs(&self) -> Option<[Leg; 2]> {
        let named = |side: &str, joint: &str| {
            let name = format!("{side}_{joint}");
            self.names.iter().position(|it| *it == name)
        };
        let leg = |side: &str| {
            let leg = Leg {
                hip: named(side, "hip")?,
                knee: named(side, "knee")?,
                ankle: named(side, "ankle")?,
                ball: named(side, "foot")?,
            };
            let chained = self.parents[leg.ball] == Some(leg.ankle)
                && self.parents[leg.ankle] == Some(leg.knee)
                && self.parents[leg.knee] == Some(leg.hip);
            chained.then_some(leg)
        };
        Some([leg("l")?, leg("r")?])
    }

    /// Moves the foot of `leg` by `step`, metres, as far as the leg reaches, by inverse kinematics of its two
    /// bones. The foot keeps its direction.
    fn move_foot(&self, leg: Leg, pose: &mut Pose, step: Vec3) {
        let frames = self.world_transforms(pose);
        let [hip, knee, ankle] = [leg.hip, leg.knee, leg.ankle].map(|it| position(&frames[it]));
        let (thigh, shank) = (sub(knee, hip), sub(ankle, knee));
        let (upper, lower) = (length(thigh), length(shank));
        let wanted = sub(add(ankle, step), hip);
        if length(step) < TINY || length(wanted) < TINY || upper < TINY || lower < TINY {
            return;
        }
        // The law of cosines for thigh, shank and reach gives the knee's flexion; the clamp keeps the
        // triangle possible.
        let nearest = (upper - lower).abs() + (1.0 - REACH) * lower;
        let reach = length(wanted).clamp(nearest, REACH * (upper + lower));
        let flexion = |cosine: f64| cosine.clamp(-1.0, 1.0).acos();
        let now = flexion(dot(thigh, shank) / (upper * lower));
        let then = (reach * reach - upper * upper - lower * lower) / (2.0 * upper * lower);
        let across = cross(thigh, shank);
        // A straight knee has no plane to bend in; it bends about the thigh's x axis.
        let hinge = match length(across) > 1e-4 * upper * lower {
            true => normalised(across),
            false => rotate(&frames[leg.hip], [1.0, 0.0, 0.0]),
        };
        let bend = scale(hinge, flexion(then) - now);
        let bent = add(knee, apply(&rotation(bend), shank));
        let swing = shortest(sub(bent, hip), wanted);
        // Each rotation, from the world into the frame of its joint's parent.
        let above = self.parents[leg.hip].map_or_else(|| rotation([0.0; 3]), |it| frames[it]);
        let undone = compose_axis_angle(scale(bend, -1.0), scale(swing, -1.0));
        for (joint, frame, world) in [
            (leg.hip, &above, swing),
            (leg.knee, &frames[leg.hip], bend),
            (leg.ankle, &frames[leg.knee], undone),
        ] {
            let local = rotate(&inverse(frame), world);
            let own = &mut pose.rotations[joint];
            *own = compose_axis_angle(local, own.map(f64::from)).map(|v| v as f32);
        }
    }
}

fn rotation(axis_angle: Vec3) -> Mat34 {
    rigid(rodrigues(axis_angle), [0.0; 3])
}

/// The axis-angle vector of the shortest rotation from the direction of `from` to that of `to`.
fn shortest(from: Vec3, to: Vec3) -> Vec3 {
    let across = cross(from, to);
    let sine = length(across);
    match sine > 0.0 {
        true => scale(across, sine.atan2(dot(from, to)) / sine),
        false => [0.0; 3],
    }
}

#[cfg(test)]
mod tests {
    use super::super::retarget::carried;
    use super::super::{smpl, transfer};
    use super::*;

    const UP: Vec3 = [0.0, 1.0, 0.0];

    fn average() -> Skeleton {
        Skeleton {
            names: smpl::JOINTS.iter().map(|it| it.0.to_owned()).collect(),
            parents: smpl::JOINTS.iter().map(|it| it.1).collect(),
            rest: smpl::AVERAGE_REST.to_vec(),
        }
    }

    /// The average body with shanks of `share` their length and thighs that make up for it.
    fn short_shanks(share: f64) -> Skeleton {
        let mut body = average();
        for knee in [4, 5] {
            body.rest[knee][1] =
                body.rest[knee + 3][1] + share * (body.rest[knee][1] - body.rest[knee + 3][1]);
        }
        body
    }

    /// Two steps of a walk along z: 20 poses on the left foot, 20 on the right one, 25 per second.
    fn walk(body: &Skeleton) -> (Vec<Pose>, Vec<f64>, Footing) {
        let left: Vec<bool> = (0..40).map(|at| at < 20).collect();
        let footing = Footing {
            rests: [left.clone(), left.iter().map(|it| !it).collect()],
        };
        let seconds: Vec<f64> = (0..40).map(|at| f64::from(at) / 25.0).collect();
        let mut poses: Vec<Pose> = (0..40u8)
            .map(|at| {
                let mut pose = Pose::rest(body.joints());
                // The foot in the air is lifted and swings ahead.
                let (standing, swings) = if at < 20 { (1, 2) } else { (2, 1) };
                let share = f32::from(at % 20) / 20.0;
                pose.rotations[standing][0] = 0.5 * share - 0.25;
                pose.rotations[standing + 3][0] = 0.5;
                pose.rotations[swings][0] = 0.25 - 1.2 * share;
                pose.rotations[swings + 3][0] = 1.2;
                pose.translation = [0.0, -0.12, f32::from(at) * 0.02];
                pose
            })
            .collect();
        footing.plant(body, &mut poses, &seconds);
        (poses, seconds, footing)
    }

    #[test]
    fn a_walk_stays_on_its_feet_on_legs_of_other_proportions() {
        let driver = average();
        let (poses, seconds, wanted) = walk(&driver);
        let sliding = wanted.sliding(&driver, &poses, &seconds).expect("steps");
        assert!(sliding < 1e-4, "{sliding}");
        // The first and last poses of a step are those of a foot that still or already moves.
        let found = Footing::of(&driver, &poses, &seconds, UP);
        for (side, at) in [(0, 2..18), (1, 22..38)] {
            assert!(at.clone().all(|it| found.rests[side][it]), "{found:?}");
            assert!(
                !at.into_iter().any(|it| found.rests[1 - side][it]),
                "{found:?}"
            );
        }

        let body = short_shanks(0.8);
        let mut moved = carried(&driver, &body, &poses, UP).expect("fits");
        let before = moved.clone();
        let slid = found.sliding(&body, &moved, &seconds).expect("steps");
        found.plant(&body, &mut moved, &seconds);
        let slides = found.sliding(&body, &moved, &seconds).expect("steps");
        assert!(
            slid > 0.03 && slides < 1e-4,
            "{slid} m/s, then {slides} m/s"
        );
        // A transfer plants feet, except on the driver's own body.
        let other = transfer(&driver, &body, &poses, &seconds, UP);
        assert_eq!(other.as_ref(), Ok(&moved));
        let own = transfer(&driver, &driver, &poses, &seconds, UP);
        assert_eq!(own.as_ref(), Ok(&poses));
        for (before, after) in before.iter().zip(&moved) {
            let (before, after) = (body.world_transforms(before), body.world_transforms(after));
            // Feet keep their directions, and everything but the legs its position.
            for row in 0..3 {
                for column in 0..3 {
                    for foot in [7, 8] {
                        let turned = before[foot][row][column] - after[foot][row][column];
                        assert!(turned.abs() < 1e-6, "{turned}");
                    }
                }
            }
            for joint in [0, 1, 2, 9, 22] {
                assert!(length(sub(position(&before[joint]), position(&after[joint]))) < 1e-9);
            }
        }
    }

    #[test]
    fn a_foot_out_of_reach_is_approached_by_a_straight_leg() {
        let body = average();
        let leg = body.legs().expect("legs")[0];
        for step in [[0.0, -2.0, 0.0], [0.0, 3.0, 0.1], [0.3, 0.2, -0.4]] {
            let mut pose = Pose::rest(body.joints());
            let hip = body.posed_joints(&pose)[leg.hip];
            let ankle = add(body.posed_joints(&pose)[leg.ankle], step);
            body.move_foot(leg, &mut pose, step);
            let joints = body.posed_joints(&pose);
            let (wanted, found) = (sub(ankle, hip), sub(joints[leg.ankle], hip));
            let away = length(sub(normalised(wanted), normalised(found)));
            assert!(away < 1e-5, "{step:?}: {away}");
            let bones = |k: usize, j: usize| length(sub(joints[j], joints[k]));
            let rest = |k: usize, j: usize| length(sub(body.rest[j], body.rest[k]));
            assert!((bones(leg.hip, leg.knee) - rest(leg.hip, leg.knee)).abs() < 1e-6);
        }
        // Knees bend forwards.
        let mut pose = Pose::rest(body.joints());
        body.move_foot(leg, &mut pose, [0.0, 0.2, 0.0]);
        let joints = body.posed_joints(&pose);
        assert!(joints[leg.knee][2] > joints[leg.hip][2] + 0.1, "{joints:?}");
    }

    #[test]
    fn a_still_pose_a_jump_and_a_body_without_legs_stay_as_they_are() {
        let body = average();
        let still = vec![Pose::rest(body.joints())];
        assert_eq!(
            Footing::of(&body, &still, &[0.0], UP).rests,
            [[false], [false]]
        );
        let jump: Vec<Pose> = (0..5u8)
            .map(|at| Pose {
                translation: [0.0, f32::from(at) * 0.2, 0.0],
                ..Pose::rest(body.joints())
            })
            .collect();
        let seconds = [0.0, 0.1, 0.2, 0.3, 0.4];
        let footing = Footing::of(&body, &jump, &seconds, UP);
        assert_eq!(footing.sliding(&body, &jump, &seconds), None);
        let mut after = jump.clone();
        footing.plant(&body, &mut after, &seconds);
        assert_eq!(after, jump);
        let arm = super::super::tests::arm();
        let poses = vec![Pose::rest(3); 5];
        let footing = Footing::of(&arm, &poses, &seconds, UP);
        assert_eq!(footing.sliding(&arm, &poses, &seconds), None);
    }
}
