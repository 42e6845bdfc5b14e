//! Measures the fit on made-up people: `measure [frames] [person]`.

#[path = "../tests/people/mod.rs"]
mod people;

use people::{Errors, camera, clip, error, joints};
use std::time::Instant;
use yoto_capture::synthetic::SyntheticPerson;
use yoto_pose::{FitOptions, KeyPointSet, fit};

fn main() {
    let numbers: Vec<usize> = std::env::args().skip(1).flat_map(|n| n.parse()).collect();
    let count = numbers.first().copied().unwrap_or(150);
    let person = &SyntheticPerson::cast(5, 7)[numbers.get(1).copied().unwrap_or(0) % 5];
    let space = Some(0.04);
    for (name, set, space, down) in [
        ("blazepose", KeyPointSet::BlazePose33, space, 3.0),
        ("blazepose 2d", KeyPointSet::BlazePose33, None, 3.0),
        ("coco", KeyPointSet::Coco17, None, 3.0),
        ("openpose", KeyPointSet::OpenPose25, None, 3.0),
        ("joints", KeyPointSet::Joints24, space, 3.0),
        ("blazepose down 20", KeyPointSet::BlazePose33, space, 20.0),
        ("unseen", KeyPointSet::BlazePose33, space, 3.0),
        ("coco unseen", KeyPointSet::Coco17, None, 3.0),
    ] {
        let camera = camera(down, [720, 1280], 1500.0);
        let picture = 0.005;
        let poses = if name.contains("unseen") {
            person.unseen_motion(count)
        } else {
            person.motion(count)
        };
        let clip = clip(person, &poses, &camera, set, Errors { picture, space }, 1);
        let options = FitOptions {
            height: Some(clip.height),
            ..FitOptions::default()
        };
        let started = Instant::now();
        let mut steps = 0;
        match fit(&clip.points, &options, &mut |done, all| {
            if done < all {
                steps = done;
            }
        }) {
            Ok(fitted) => println!(
                "{name}: {:.1} mm, {:.2} px, focal {:.0} (true {:.0}), down {:.1}, {} steps, {:.1} s",
                1e3 * error(&joints(&fitted), &clip.joints),
                fitted.reprojection_px,
                fitted.focal,
                clip.focal,
                fitted.camera_down_degrees,
                steps,
                started.elapsed().as_secs_f64(),
            ),
            Err(error) => println!("{name}: {error}"),
        }
    }
}
