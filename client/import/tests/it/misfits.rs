//! Key points and masks that are not quite of the clip: mirrored or early points, people with two numbers, times as numbers, masks
//! of another resolution, cut-outs, and black ones.

use crate::format;
use crate::key_points::off;
use image::{GrayImage, Luma, Rgba, RgbaImage};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use yoto_import::{ImportError, Imported, Options, PointRotation, read};

/// Width and height of the clip.
const SIZE: [u32; 2] = [64, 96];

fn files(name: &str) -> PathBuf {
    crate::captures("../pose_tools/captures").join(name)
}

/// AlphaPose's list with only the person 1, changed.
fn person(dir: &Path, mut change: impl FnMut(&mut Value)) -> PathBuf {
    let text = std::fs::read(files("alphapose/alphapose-results.json")).expect("a file");
    let list: Vec<Value> = serde_json::from_slice(&text).expect("JSON");
    let mut own: Vec<Value> = list
        .into_iter()
        .filter(|it| it["idx"] == json!(1))
        .collect();
    assert_eq!(own.len(), 16);
    own.iter_mut().for_each(&mut change);
    let path = dir.join("alphapose-results.json");
    std::fs::write(&path, Value::from(own).to_string()).expect("writes");
    path
}

fn number(record: &Value) -> usize {
    let name = record["image_id"].as_str().expect("a name");
    let digits: String = name.chars().filter(char::is_ascii_digit).collect();
    digits.parse().expect("a number")
}

/// The person's masks, as coverage in pictures of `size`, changed.
fn masks(dir: &Path, size: [u32; 2], change: impl Fn(usize, GrayImage) -> GrayImage) -> PathBuf {
    let folder = dir.join("masks");
    std::fs::create_dir_all(&folder).expect("a folder");
    for frame in 0..16 {
        let all = image::open(files(&format!("clip/masks/{frame:05}.png"))).expect("a mask");
        let all = all.into_rgb8();
        let inside = |x, y| *all.get_pixel(x, y) == image::Rgb([128, 0, 0]);
        let at = |x: u32, y: u32| inside(x * SIZE[0] / size[0], y * SIZE[1] / size[1]);
        let mask = GrayImage::from_fn(size[0], size[1], |x, y| Luma([255 * u8::from(at(x, y))]));
        let path = folder.join(format!("{frame:06}.png"));
        change(frame, mask).save(path).expect("writes");
    }
    folder
}

fn import(poses: PathBuf, masks: Option<PathBuf>) -> Result<Imported, ImportError> {
    let options = Options {
        poses: Some(poses),
        masks,
        fps: Some(25.0),
        ..Options::default()
    };
    read(format("key-points"), &files("clip/frames"), &options)
}

fn notes(found: Result<Imported, ImportError>) -> (String, usize) {
    let found = found.expect("imports");
    (found.notes.join("\n"), found.track.frames.len())
}

/// Changes the x and y of each point.
fn points(record: &mut Value, change: impl Fn([f64; 2]) -> [f64; 2]) {
    let numbers = record["keypoints"].as_array_mut().expect("points");
    for point in numbers.chunks_exact_mut(3) {
        let [x, y] = change([0, 1].map(|at| point[at].as_f64().expect("a number")));
        (point[0], point[1]) = (json!(x), json!(y));
    }
}

/// Gives each point of COCO's 17 its counterpart's place, as a detector does that sees a mirrored picture.
fn exchanged(record: &mut Value) {
    let numbers = record["keypoints"].as_array_mut().expect("points");
    for left in (1..17).step_by(2) {
        for axis in 0..3 {
            numbers.swap(3 * left + axis, 3 * (left + 1) + axis);
        }
    }
}

#[test]
fn mirrored_and_turned_points_are_named_and_undone_as_the_error_says() {
    let dir = tempfile::tempdir().expect("a folder");
    let masks = masks(dir.path(), SIZE, |_, mask| mask);
    let [w, h] = SIZE.map(f64::from);
    let right = import(person(dir.path(), |_| ()), Some(masks.clone())).expect("imports");
    let right = off(&right, 0);
    type Change<'a> = &'a dyn Fn([f64; 2]) -> [f64; 2];
    let cases: [(&str, &str, bool, Change<'_>); 5] = [
        (
            "mirrored left to right",
            "--mirror-points",
            true,
            &|[x, y]| [w - 1.0 - x, y],
        ),
        (
            "turned by 90° clockwise",
            "--turn-points 90",
            false,
            &|[x, y]| [h - 1.0 - y, x],
        ),
        (
            "turned by 90° counter-clockwise",
            "--turn-points 270",
            false,
            &|[x, y]| [y, w - 1.0 - x],
        ),
        ("turned by 180°", "--turn-points 180", false, &|[x, y]| {
            [w - 1.0 - x, h - 1.0 - y]
        }),
        (
            "upside down",
            "--turn-points 180 --mirror-points",
            true,
            &|[x, y]| [x, h - 1.0 - y],
        ),
    ];
    for (words, advice, is_mirrored, change) in cases {
        let poses = person(dir.path(), |record| {
            points(record, change);
            if is_mirrored {
                exchanged(record);
            }
        });
        let message = import(poses.clone(), Some(masks.clone()))
            .expect_err(words)
            .to_string();
        assert!(
            message.contains(&format!("they are those of pictures {words}"))
                && message.contains(&format!("with {advice} they become those of the clip")),
            "{message}"
        );
        let undone = Options {
            poses: Some(poses),
            masks: Some(masks.clone()),
            fps: Some(25.0),
            mirror_points: advice.contains("--mirror-points"),
            point_rotation: advice.contains("--turn-points").then_some({
                match advice {
                    advice if advice.contains("90") => PointRotation::Quarter,
                    advice if advice.contains("270") => PointRotation::ThreeQuarters,
                    _ => PointRotation::Half,
                }
            }),
            ..Options::default()
        };
        let found = read(format("key-points"), &files("clip/frames"), &undone).expect(words);
        let far = off(&found, 0);
        assert!(
            (far - right).abs() < 0.05,
            "{words}: {far:.2} px, {right:.2} px as given"
        );
        let notes = found.notes.join("\n");
        assert!(notes.contains("back to the clip as it is shown"), "{notes}");
        // What is still wrong after the options is told as that.
        let wrong = Options {
            mirror_points: !undone.mirror_points,
            ..undone
        };
        let without = wrong.point_rotation.is_none() && !wrong.mirror_points;
        let done = read(format("key-points"), &files("clip/frames"), &wrong);
        let message = done.map(|found| found.notes).expect_err(words).to_string();
        assert!(
            message.contains("after the options that turn and mirror them") != without,
            "{message}"
        );
    }
}

#[test]
fn points_of_larger_and_smaller_pictures_are_named_with_the_factor() {
    let dir = tempfile::tempdir().expect("a folder");
    for (factor, said) in [(2.0, "128x192, 2.00 times"), (0.5, "32x48, 0.50 times")] {
        let path = person(dir.path(), |record| {
            points(record, |[x, y]| [factor * x, factor * y]);
        });
        let masks = masks(dir.path(), SIZE, |_, mask| mask);
        let error = import(path, Some(masks)).expect_err(said).to_string();
        assert!(error.contains(said), "{error}");
    }
}

#[test]
fn early_points_are_told() {
    let dir = tempfile::tempdir().expect("a folder");
    let masks = masks(dir.path(), SIZE, |_, mask| mask);
    let right = notes(import(person(dir.path(), |_| ()), Some(masks.clone())));
    assert!(!right.0.contains("--mask-shift"), "{}", right.0);
    let early = |by: usize| {
        let poses = person(dir.path(), |record| {
            let frame = number(record).saturating_sub(by);
            record["image_id"] = json!(format!("{frame:06}.png"));
        });
        let text = std::fs::read(&poses).expect("a file");
        let list: Vec<Value> = serde_json::from_slice(&text).expect("JSON");
        // The first of them would be before the clip.
        let list: Vec<&Value> = list.iter().skip(by).collect();
        std::fs::write(&poses, json!(list).to_string()).expect("writes");
        import(poses, Some(masks.clone()))
    };
    let (notes, _) = notes(early(2));
    assert!(notes.contains("--mask-shift 2"), "{notes}");
    let message = early(4).expect_err("far from the masks").to_string();
    assert!(message.contains("seem to be 4 frames early"), "{message}");
}

#[test]
fn a_person_with_two_numbers_keeps_all_frames() {
    let dir = tempfile::tempdir().expect("a folder");
    let poses = person(dir.path(), |record| {
        if number(record) >= 8 {
            record["idx"] = json!(7);
        }
    });
    let (notes, frames) = notes(import(poses, None));
    assert!(
        notes.contains("person 1 goes on as 7 (1 frame later"),
        "{notes}"
    );
    assert_eq!(frames, 16);
}

#[test]
fn times_in_names_are_taken_in_their_order() {
    let dir = tempfile::tempdir().expect("a folder");
    let poses = person(dir.path(), |record| {
        let time = 231_935 + 40 * number(record);
        record["image_id"] = json!(format!("{time}.jpg"));
    });
    let (notes, frames) = notes(import(poses, None));
    assert!(
        notes.contains("16 frames are taken in their order"),
        "{notes}"
    );
    assert_eq!(frames, 16);
}

#[test]
fn masks_of_half_the_size_are_made_as_large() {
    let dir = tempfile::tempdir().expect("a folder");
    let masks = masks(dir.path(), SIZE.map(|side| side / 2), |_, mask| mask);
    let (notes, frames) = notes(import(person(dir.path(), |_| ()), Some(masks)));
    assert!(
        notes.contains("of 32x48, made as large as the clip"),
        "{notes}"
    );
    assert_eq!(frames, 16);
    let other = tempfile::tempdir().expect("a folder");
    let masks = self::masks(other.path(), [48, 48], |_, mask| mask);
    let message = import(person(other.path(), |_| ()), Some(masks)).expect_err("another shape");
    assert!(message.to_string().contains("48x48"), "{message}");
}

#[test]
fn cut_outs_give_their_alpha_and_black_masks_no_frame() {
    let dir = tempfile::tempdir().expect("a folder");
    let folder = masks(dir.path(), SIZE, |frame, mask| match frame {
        10 => GrayImage::new(SIZE[0], SIZE[1]),
        _ => mask,
    });
    let poses = person(dir.path(), |_| ());
    let (text, frames) = notes(import(poses.clone(), Some(folder.clone())));
    assert!(
        text.contains("1 frame without anybody in the mask (10)"),
        "{text}"
    );
    assert_eq!(frames, 15);
    // The same as alpha, over colours that are no labels.
    for frame in 0..16u8 {
        let path = folder.join(format!("{frame:06}.png"));
        let mask = image::open(&path).expect("a mask").into_luma8();
        let pixel = |x, y| Rgba([frame * 9 + x as u8, y as u8, 80, mask.get_pixel(x, y).0[0]]);
        RgbaImage::from_fn(SIZE[0], SIZE[1], pixel)
            .save(&path)
            .expect("writes");
    }
    let (text, frames) = notes(import(poses, Some(folder)));
    assert!(text.contains("the alpha channel of masks"), "{text}");
    assert_eq!(frames, 15);
}
