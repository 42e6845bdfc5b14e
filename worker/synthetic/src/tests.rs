//! The properties of synthetic people on which training and evaluation rely.

use super::build::{BodyPart, joint};
use super::*;
use yoto_capture::skeleton::transform::{add, apply, compose, inverse, length, scale, sub};

fn people() -> Vec<SyntheticPerson> {
    SyntheticPerson::cast(3, 7)
}

fn coverage(image: &FrameImage) -> f64 {
    let sum: f64 = image.mask.iter().map(|&m| f64::from(m)).sum();
    sum / 255.0 / image.mask.len() as f64
}

#[test]
fn captures_are_valid_and_hold_the_whole_person() {
    for person in people() {
        let (track, images) = person.capture(12, 64);
        assert_eq!(track.check(), []);
        assert_eq!(track.frames.len(), images.len());
        assert!(
            (0.9..1.05)
                .contains(&(track.skeleton.rest_joints[0][1] / person.outfit.measures.scale))
        );
        for (frame, image) in images.iter().enumerate() {
            let share = coverage(image);
            assert!(
                (0.04..0.25).contains(&share),
                "{} frame {frame}: {share}",
                person.name()
            );
            let inside = yoto_capture::mask_box(&image.mask, 64, 64).expect("a person");
            assert!(
                inside.y0 > 0 && inside.y1 < 64 && inside.x0 > 0 && inside.x1 < 64,
                "{} frame {frame} is cut off: {inside:?}",
                person.name()
            );
            for (pixel, &mask) in image.rgb.chunks(3).zip(&image.mask) {
                assert!(pixel.iter().all(|&v| v <= mask), "{pixel:?} over {mask}");
            }
        }
    }
}

#[test]
fn held_out_views_show_the_person_too() {
    let person = &people()[1];
    for pose in person.unseen_motion(16) {
        for camera in SyntheticPerson::held_out_cameras(32) {
            let share = coverage(&person.render(&pose, &camera));
            assert!((0.04..0.25).contains(&share), "{share}");
        }
    }
}

#[test]
fn people_differ_and_seeds_repeat_them() {
    let camera = SyntheticPerson::train_camera(48);
    let front = |person: &SyntheticPerson| person.render(&Pose::rest(24), &camera);
    let seven = people();
    for (i, a) in seven.iter().enumerate() {
        for b in &seven[i + 1..] {
            assert_ne!(a.name(), b.name());
            assert_ne!(a.skeleton(), b.skeleton());
            let (a, b) = (front(a), front(b));
            let both: Vec<usize> = (0..a.mask.len())
                .filter(|&i| a.mask[i] == 255 && b.mask[i] == 255)
                .collect();
            assert!(both.len() > 100);
            let apart: f64 = both
                .iter()
                .flat_map(|i| (0..3).map(move |c| i * 3 + c))
                .map(|i| (f64::from(a.rgb[i]) - f64::from(b.rgb[i])).abs())
                .sum::<f64>()
                / (3 * both.len()) as f64;
            assert!(apart > 25.0, "mean difference {apart} of 255");
        }
    }
    let again = SyntheticPerson::cast(5, 7);
    for (a, b) in seven.iter().zip(&again) {
        assert_eq!(
            (a.name(), a.skeleton(), front(a)),
            (b.name(), b.skeleton(), front(b))
        );
        assert_eq!(a.motion(9), b.motion(9));
    }
    assert_ne!(front(&seven[0]), front(&SyntheticPerson::cast(1, 8)[0]));
}

#[test]
fn texture_sticks_to_the_body() {
    for person in people() {
        let poses = [
            person.motion(10).swap_remove(2),
            person.unseen_motion(16).swap_remove(10),
        ];
        let all: Vec<usize> = (0..person.capsules.len()).collect();
        let rest = person.skeleton.world_transforms(&Pose::rest(24));
        let mut compared = 0;
        let still = Drape::new(&person.skeleton, 1.0, None, 0.0);
        // Halfway along limbs, where the surface is that of one capsule unless limbs touch.
        let kinds = [BodyPart::UpperArm, BodyPart::Forearm, BodyPart::Shin];
        for capsule in person.capsules.iter().filter(|c| kinds.contains(&c.part)) {
            let middle = scale(add(capsule.from, capsule.to), 0.5);
            let radius = (capsule.radii[0] + capsule.radii[1]) / 2.0;
            for side in [[0.0, 0.0, radius], [0.0, 0.0, -radius]] {
                let point = add(middle, side);
                let [first, second] = poses.each_ref().map(|pose| {
                    let world = person.skeleton.world_transforms(pose)[capsule.joint];
                    let to_world = compose(&world, &inverse(&rest[capsule.joint]));
                    let moved = apply(&to_world, point);
                    let body = person.posed(pose, &still);
                    let distance = body.distance(moved, &all);
                    assert!(distance < 1e-3, "{distance} m off the body");
                    (distance > -1e-3).then(|| body.colour(moved, &all))
                });
                if let (Some(first), Some(second)) = (first, second) {
                    let apart = length(sub(first, second));
                    assert!(apart < 0.02, "{:?}: {first:?} {second:?}", capsule.part);
                    compared += 1;
                }
            }
        }
        assert!(compared >= 8, "only {compared} of 12 points are free");
    }
}

#[test]
fn one_camera_sees_every_side() {
    let person = &people()[0];
    let poses = person.motion(60);
    let facing: Vec<f32> = poses
        .iter()
        .map(|pose| pose.rotations[joint::PELVIS][1])
        .collect();
    for wanted in [-2.5f32, -1.5, -0.5, 0.5, 1.5, 2.5] {
        assert!(
            facing.iter().any(|f| (f - wanted).abs() < 0.3),
            "{wanted}: {facing:?}"
        );
    }
    let moved = |j: usize| {
        poses
            .iter()
            .map(|p| p.rotations[j])
            .any(|r| r != poses[0].rotations[j])
    };
    assert!(
        [
            joint::L_HIP,
            joint::L_KNEE,
            joint::L_SHOULDER,
            joint::L_ELBOW
        ]
        .into_iter()
        .all(moved)
    );
}
