//! The real pose model. Its files are not part of the project: these tests run if `YOTO_POSE_MODEL` names them, and fail
//! without it if `YOTO_TEST_POSE_MODEL` is `required`.

use std::path::{Path, PathBuf};
use yoto_landmarks::{
    LandmarkError, PersonLandmarks, PoseModel, Sighting, Target, Watcher, people,
};
use yoto_media::{Limits, Picture, decode_still};

fn model() -> Option<PoseModel> {
    let path = std::env::var_os("YOTO_POSE_MODEL").map(PathBuf::from);
    let required =
        std::env::var_os("YOTO_TEST_POSE_MODEL").is_some_and(|value| value == "required");
    assert!(
        path.is_some() || !required,
        "YOTO_POSE_MODEL names no model: deploy/models/get.sh fetches it"
    );
    path.map(|path| PoseModel::open(&path).expect("the pose model"))
}

/// A person of the demo, on black, 124 × 126 pixels.
fn person() -> Picture {
    decode_still(include_bytes!("person.png"), &Limits::default()).expect("a picture")
}

fn look(watcher: &mut Watcher, picture: &Picture) -> Option<PersonLandmarks> {
    let size = [picture.width, picture.height];
    watcher.look(0, &picture.rgb, size).expect("a picture")
}

/// BlazePose's points with left and right exchanged.
fn other_side(point: usize) -> usize {
    match point {
        0 => 0,
        1..=3 => point + 3,
        4..=6 => point - 3,
        _ if point % 2 == 1 => point + 1,
        _ => point - 1,
    }
}

#[test]
fn a_person_is_found_with_landmarks_and_mask() {
    let Some(model) = model() else { return };
    let picture = person();
    let mut watcher = Watcher::new(model);
    for time in 0..3 {
        let seen = look(&mut watcher, &picture).expect("a person");
        assert!(seen.score > 0.9, "picture {time}: {}", seen.score);
        // Nose above shoulders above hips above knees above ankles.
        for (upper, lower) in [(0, 11), (11, 23), (12, 24), (23, 25), (24, 26), (26, 28)] {
            let (upper, lower) = (seen.picture[upper][1], seen.picture[lower][1]);
            assert!(upper < lower, "picture {time}: {:?}", seen.picture);
        }
        // A body of its own size: hips about 0.2 m apart, no limb of several metres.
        let hips = (seen.space[23][0] - seen.space[24][0]).abs();
        assert!((0.1..0.4).contains(&hips), "{hips}");
        let (pixels, _) = picture.rgb.as_chunks::<3>();
        let (mut both, mut either) = (0, 0);
        for (pixel, coverage) in pixels.iter().zip(&seen.outline.coverage()) {
            let (drawn, found) = (pixel.iter().any(|level| *level > 40), *coverage > 127);
            both += usize::from(drawn && found);
            either += usize::from(drawn || found);
        }
        let share = both as f64 / either as f64;
        assert!(
            share > 0.8,
            "picture {time}: the mask shares {share} with the person"
        );
    }
}

/// The picture with each pixel `times` as wide and high.
fn enlarged(picture: &Picture, times: usize) -> Picture {
    let (pixels, _) = picture.rgb.as_chunks::<3>();
    let lines = pixels.chunks_exact(picture.width).flat_map(|line| {
        let wide: Vec<u8> = line.iter().flat_map(|pixel| pixel.repeat(times)).collect();
        wide.repeat(times)
    });
    Picture {
        width: picture.width * times,
        height: picture.height * times,
        rgb: lines.collect(),
        ..picture.clone()
    }
}

/// The landmarks of a mirrored picture are mirrored, except for the model's own errors. Exchanged sides, or a region that
/// is sampled at another position than its landmarks are mapped back to, would move them.
#[test]
fn a_mirrored_picture_has_mirrored_landmarks() {
    let Some(model) = model() else { return };
    let picture = enlarged(&person(), 8);
    let mut mirrored = picture.clone();
    for line in mirrored.rgb.chunks_exact_mut(3 * picture.width) {
        line.as_chunks_mut::<3>().0.reverse();
    }
    let mut watcher = Watcher::new(model);
    let one = look(&mut watcher, &picture).expect("a person");
    let other = look(&mut watcher, &mirrored).expect("a person");
    let differences = (0..33).map(|point| {
        let x = other.picture[other_side(point)][0];
        one.picture[point][0] + x - picture.width as f32
    });
    let mean = differences.sum::<f32>() / 33.0 / 2.0;
    assert!(mean.abs() < 4.0, "{mean} pixels of 992 to one side");
}

/// A picture of 720 x 400 with the person at `left`, in other colours if `is_blue`.
fn scene(left: usize, is_blue: bool) -> Picture {
    let person = enlarged(&person(), 3);
    let mut scene = Picture {
        width: 720,
        height: 400,
        rgb: vec![60; 720 * 400 * 3],
        alpha: None,
        lossy: false,
    };
    for (y, line) in person.rgb.chunks_exact(3 * person.width).enumerate() {
        for (x, pixel) in line.as_chunks::<3>().0.iter().enumerate() {
            let [red, green, blue] = *pixel;
            let at = ((y + 10) * 720 + left + x) * 3;
            if pixel.iter().any(|level| *level > 24) {
                let pixel = if is_blue {
                    [blue / 2, red, green / 2]
                } else {
                    *pixel
                };
                scene.rgb[at..at + 3].copy_from_slice(&pixel);
            }
        }
    }
    scene
}

#[test]
fn one_of_two_people_is_followed() {
    let Some(model) = model() else { return };
    let mut watcher = Watcher::new(model);
    // One person goes on, and another stands elsewhere from the fifth picture on.
    let pictures: Vec<Picture> = (0..10)
        .map(|at| scene(if at < 5 { 4 * at } else { 345 }, at >= 5))
        .collect();
    let look = |watcher: &mut Watcher| -> Vec<Option<PersonLandmarks>> {
        let all = pictures.iter().enumerate();
        let mut look = |(at, it): (usize, &Picture)| watcher.look(at, &it.rgb, [720, 400]);
        all.map(|it| look(it).expect("a picture")).collect()
    };
    let found = look(&mut watcher);
    let sightings: Vec<Sighting> = found
        .iter()
        .enumerate()
        .filter_map(|(at, seen)| {
            Some(Sighting {
                at,
                figure: seen.as_ref()?.figure?,
                is_cut: false,
            })
        })
        .collect();
    assert_eq!(sightings.len(), 10);
    let everybody = people(&sightings);
    let numbers: Vec<Vec<usize>> = everybody
        .iter()
        .map(|person| person.seen.iter().map(|(at, _)| *at).collect())
        .collect();
    assert_eq!(everybody.len(), 2, "{numbers:?}");
    for (index, numbers) in numbers.iter().enumerate() {
        watcher.follow(Target::new(&everybody, index, 1));
        let found = look(&mut watcher);
        let found: Vec<usize> = (0..10).filter(|at| found[*at].is_some()).collect();
        assert_eq!(&found, numbers);
    }
}

#[test]
fn an_empty_picture_has_nobody_and_a_person_after_it_is_found() {
    let Some(model) = model() else { return };
    let mut watcher = Watcher::new(model);
    let picture = person();
    assert!(look(&mut watcher, &picture).is_some());
    let mut empty = picture.clone();
    empty.rgb.fill(0);
    assert!(look(&mut watcher, &empty).is_none());
    assert!(look(&mut watcher, &picture).is_some());
    let error = watcher
        .look(0, &picture.rgb, [3, 3])
        .expect_err("a wrong size");
    assert!(error.to_string().contains("3x3"), "{error}");
}

#[test]
fn what_is_missing_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let open = |path: &Path| PoseModel::open(path).expect_err("no model");
    let error = open(folder.path());
    assert!(matches!(error, LandmarkError::Empty(_)));
    assert!(
        error.to_string().contains("deploy/models/get.sh"),
        "{error}"
    );
    let heavy = folder.path().join("pose_landmark_heavy.tflite");
    std::fs::write(&heavy, "no model").expect("a file");
    let error = open(&heavy);
    assert!(
        error.to_string().contains("pose_detection.tflite"),
        "{error}"
    );
    std::fs::write(folder.path().join("pose_detection.tflite"), "no model").expect("a file");
    let error = open(folder.path());
    assert!(
        error.to_string().contains("not a TensorFlow Lite model"),
        "{error}"
    );
}
