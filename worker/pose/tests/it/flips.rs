//! Stretches of frames in which a detector mistakes the back for the front: how many are found by motion and
//! by colours, and how often a right frame is reversed.

#[allow(dead_code, reason = "other tests use the rest")]
use crate::people::{Clip, Errors, camera, clip, joints};
use yoto_capture::skeleton::transform::{dot, sub};
use yoto_pose::{FitOptions, KeyPointSet, fit, patches};
use yoto_synthetic::SyntheticPerson;

const FRAMES: usize = 60;
/// Shoulders, in the fitted tree.
const SHOULDERS: [usize; 2] = [16, 17];

/// Four seconds, in which a person turns once.
fn walk(person: &SyntheticPerson) -> Clip {
    let mut poses = person.motion(2 * FRAMES);
    poses.truncate(FRAMES);
    let errors = Errors {
        picture: 0.005,
        space: Some(0.04),
    };
    let camera = camera(3.0, [720, 1280], 1500.0);
    clip(person, &poses, &camera, KeyPointSet::BlazePose33, errors, 1)
}

/// The output of a detector that mistakes back for front.
#[derive(Clone, Copy, Debug)]
enum Flip {
    /// The same points under the names of the other side.
    Names,
    /// The body that looks the same from the camera and faces the other way: depths change sign as well.
    Depths,
}

/// Mistakes back for front in `count` frames from `start` on.
fn flip(clip: &mut Clip, how: Flip, start: usize, count: usize) {
    let sides = [(1, 4), (2, 5), (3, 6)].into_iter();
    let sides: Vec<_> = sides
        .chain((7..33).step_by(2).map(|at| (at, at + 1)))
        .collect();
    for frame in &mut clip.points.frames[start..start + count] {
        for &(left, right) in &sides {
            frame.picture.swap(left, right);
            frame.space.swap(left, right);
        }
        if let Flip::Depths = how {
            frame
                .space
                .iter_mut()
                .for_each(|point| point[2] = -point[2]);
        }
    }
}

/// Frames with shoulders in the wrong direction after the fit.
fn wrong(clip: &Clip) -> usize {
    let options = FitOptions {
        height: Some(clip.height),
        ..FitOptions::default()
    };
    let fitted = fit(&clip.points, &options, &mut |_, _| ()).expect("fits");
    let across = |joints: &Vec<_>| {
        let [left, right] = SHOULDERS.map(|at| joints[at]);
        sub(left, right)
    };
    let found = joints(&fitted);
    let pairs = found.iter().zip(&clip.joints);
    pairs
        .filter(|(one, other)| dot(across(one), across(other)) < 0.0)
        .count()
}

#[test]
fn flips_of_many_frames_are_found_and_no_others() {
    for person in &SyntheticPerson::cast(2, 7) {
        let name = person.name();
        assert_eq!(wrong(&walk(person)), 0, "{name} without flips");
        for how in [Flip::Names, Flip::Depths] {
            for (start, count) in [(20, 1), (20, 3), (33, 8), (8, 29)] {
                let mut clip = walk(person);
                flip(&mut clip, how, start, count);
                let wrong = wrong(&clip);
                assert_eq!(wrong, 0, "{name}: {how:?}, {count} frames from {start} on");
            }
        }
    }
}

/// The same walk in small pictures before a grey wall, with the colours of the body.
fn filmed(person: &SyntheticPerson) -> Clip {
    const SIZE: [u32; 2] = [180, 320];
    const WALL: f64 = 120.0;
    let mut poses = person.motion(2 * FRAMES);
    poses.truncate(FRAMES);
    let errors = Errors {
        picture: 0.005,
        space: Some(0.04),
    };
    let camera = camera(3.0, SIZE, 375.0);
    let mut clip = clip(person, &poses, &camera, KeyPointSet::BlazePose33, errors, 1);
    for (pose, frame) in poses.iter().zip(&mut clip.points.frames) {
        let mut image = person.render(pose, &camera);
        let pixels = image.rgb.as_chunks_mut::<3>().0.iter_mut();
        for (pixel, coverage) in pixels.zip(&image.mask) {
            let wall = WALL * (1.0 - f64::from(*coverage) / 255.0);
            *pixel = pixel.map(|level| level.saturating_add(wall as u8));
        }
        let size = SIZE.map(|side| side as usize);
        frame.colours = patches(KeyPointSet::BlazePose33, frame, &image.rgb, size);
    }
    clip
}

#[test]
fn colours_find_stretches_that_begin_or_end_in_profile() {
    let person = &SyntheticPerson::cast(1, 7)[0];
    let walk = filmed(person);
    assert_eq!(wrong(&walk), 0, "without flips");
    for (start, count) in [(0, 10), (45, 15)] {
        let mut clip = walk.clone();
        flip(&mut clip, Flip::Depths, start, count);
        assert_eq!(wrong(&clip), 0, "{count} frames from {start} on");
        // Motion alone does not show it.
        for frame in &mut clip.points.frames {
            frame.colours.clear();
        }
        assert!(wrong(&clip) > 0, "{count} frames from {start} on");
    }
}
