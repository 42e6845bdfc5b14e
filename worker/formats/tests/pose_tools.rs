//! Files by joblib, torch, pycocotools and numpy, compared with each other: all contain the same motion.

use std::path::PathBuf;
use yoto_formats::rle::RunLengths;
use yoto_formats::{Array, Value, npy, npz, pickle, torch};

const LIMIT: u64 = 1 << 24;
const FRAMES: usize = 16;

fn file(name: &str) -> Vec<u8> {
    let captures = "../../tests/formats/pose_tools/captures";
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join(captures)
        .join(name);
    std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn numbers(value: &Value, path: &[&str]) -> Array {
    let found = path.iter().try_fold(value, |value, key| value.get(key));
    let found = found.and_then(Value::numbers);
    found.unwrap_or_else(|| panic!("{path:?} of {}", value.kind()))
}

/// The value of a number key.
fn numbered(value: &Value, number: f64) -> &Value {
    let entries = value.entries().expect("a dictionary");
    let found = entries
        .iter()
        .find(|(key, _)| *key == Value::Number(number));
    &found.expect("the number").1
}

/// SMPL's translations of the first person, by WHAM.
fn truth() -> Array {
    let wham = pickle::read(&file("wham/output/demo/walk/wham_output.pkl")).expect("reads");
    numbers(numbered(&wham, 0.0), &["trans"])
}

#[test]
fn every_tool_has_the_same_motion() {
    let truth = truth();
    assert_eq!(truth.shape, [FRAMES, 3]);
    let gvhmr = torch::read(&file("gvhmr/outputs/demo/walk/hmr4d_results.pt"), LIMIT);
    let gvhmr = gvhmr.expect("reads");
    assert_eq!(numbers(&gvhmr, &["smpl_params_incam", "transl"]), truth);
    // The older form, in which the camera's values were overwritten by the world's.
    let converted = torch::read(&file("gvhmr/converted.pt"), LIMIT).expect("reads");
    let global = numbers(&gvhmr, &["smpl_params_global", "transl"]);
    assert_eq!(
        numbers(&converted, &["smpl_params_incam", "transl"]),
        global
    );
    assert_ne!(global, truth);
    let track = npy::read(&file("tram/results/walk/hps/hps_track_0.npy")).expect("reads");
    let tram = numbers(&track, &["pred_trans"]);
    assert_eq!(
        (&tram.shape[..], &tram.values),
        (&[FRAMES, 1, 3][..], &truth.values)
    );
    let frames: Vec<f64> = (0..FRAMES).map(|frame| frame as f64).collect();
    assert_eq!(numbers(&track, &["frame"]).values, frames);
    let prompt = pickle::read(&file("prompt_hmr/results/walk/results.pkl")).expect("reads");
    let people = prompt.get("people").expect("people");
    let first = numbered(people, 1.0);
    assert_eq!(numbers(first, &["smplx_cam", "trans"]), truth);
    // TRAM's rotations by rows and columns are PromptHMR's.
    let tram = numbers(&track, &["pred_rotmat"]);
    let prompt = numbers(first, &["smplx_cam", "rotmat"]);
    assert_eq!(tram.shape, [FRAMES, 24, 3, 3]);
    for (tram, prompt) in tram.values.chunks(24 * 9).zip(prompt.values.chunks(55 * 9)) {
        assert_eq!(tram[..22 * 9], prompt[..22 * 9]);
    }
}

#[test]
fn one_camera_of_all_frames_is_repeated() {
    let gvhmr = torch::read(&file("gvhmr/outputs/demo/walk/hmr4d_results.pt"), LIMIT);
    let cameras = numbers(&gvhmr.expect("reads"), &["K_fullimg"]);
    assert_eq!(cameras.shape, [FRAMES, 3, 3]);
    let (first, rest) = cameras.values.split_at(9);
    let focal = 64f64.hypot(96.0);
    assert!((first[0] - focal).abs() < 1e-4 && first[2] == 32.0 && first[5] == 48.0);
    assert!(rest.chunks(9).all(|camera| camera == first));
}

#[test]
fn vertices_are_left_out_when_nobody_asks_for_them() {
    let bytes = file("wham/output/demo/walk/wham_output.pkl");
    let whole = pickle::read(&bytes).expect("reads");
    assert_eq!(numbers(numbered(&whole, 1.0), &["verts"]).shape, [9, 24, 3]);
    let less = pickle::read_without(&bytes, &["verts"]).expect("reads");
    assert_eq!(numbered(&less, 1.0).get("verts"), Some(&Value::Nothing));
    let ids = numbers(numbered(&less, 1.0), &["frame_ids"]);
    assert_eq!(ids.values, (3..12).map(f64::from).collect::<Vec<_>>());
}

#[test]
fn masks_of_two_tools_agree() {
    let phalp = pickle::read(&file("phalp/outputs/results/demo_walk.pkl")).expect("reads");
    let masks = npy::read(&file("tram/results/walk/masks.npy")).expect("reads");
    let frames = phalp.entries().expect("frames");
    let masks = masks.items().expect("masks");
    assert_eq!((frames.len(), masks.len()), (FRAMES, FRAMES));
    let mut ghosts = 0;
    for ((path, frame), all) in frames.iter().zip(masks) {
        let path = path.text().expect("a path");
        let since = numbers(frame, &["tracked_time"]).values;
        let mut together = vec![0; 64 * 96];
        let people = frame.get("mask").and_then(Value::items).expect("masks");
        for (person, since) in people.iter().zip(&since) {
            let mask = RunLengths::read(person).expect("run lengths");
            assert_eq!((mask.height, mask.width), (96, 64), "{path}");
            let pixels = mask.decode();
            assert_eq!(
                pixels.iter().filter(|pixel| **pixel == 255).count(),
                mask.area()
            );
            assert!(mask.area() > 100, "{path}");
            if *since > 0.0 {
                ghosts += 1;
                continue;
            }
            for (pixel, one) in together.iter_mut().zip(pixels) {
                *pixel |= one;
            }
        }
        let all = RunLengths::read(all).expect("run lengths");
        assert!(all.decode() == together, "{path}");
    }
    assert_eq!(ghosts, 2);
}

#[test]
fn romp_has_its_results_in_a_dictionary() {
    let video = npz::read(&file("romp/video_results.npz"), LIMIT).expect("reads");
    let results = video.get("results").expect("results");
    assert_eq!(results.entries().map(<[_]>::len), Some(FRAMES));
    let frame = results.get("00000005.png").expect("a frame");
    assert_eq!(numbers(frame, &["joints"]).shape, [2, 71, 3]);
    assert_eq!(numbers(frame, &["track_ids"]).values, [7.0, 9.0]);
    assert_eq!(numbers(frame, &["verts"]).shape, [2, 24, 3]);
    let less = npz::read_without(&file("romp/video_results.npz"), LIMIT, &["verts"]);
    let less = less.expect("reads");
    let less = less
        .get("results")
        .and_then(|results| results.get("00000005.png"));
    assert_eq!(
        less.and_then(|frame| frame.get("verts")),
        Some(&Value::Nothing)
    );
    let sequences = video.get("sequence_results").expect("sequences");
    let second = numbered(sequences, 9.0);
    assert_eq!(numbers(second, &["smpl_thetas"]).shape, [9, 72]);
    let without = npz::read(&file("romp_without_smpl/00000005.npz"), LIMIT).expect("reads");
    let without = without.get("results").expect("results");
    assert_eq!(numbers(without, &["cam"]).shape, [2, 3]);
    assert_eq!(without.get("joints"), None);
}

fn seed(name: &str) -> Vec<u8> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/fuzz/corpus");
    std::fs::read(path.join(name)).expect("a seed")
}

#[test]
fn views_parameters_and_short_floats_are_read_in_both_forms() {
    for form in ["torch/zip", "torch/legacy"] {
        let value = torch::read(&seed(form), LIMIT).expect("reads");
        let turned = numbers(&value, &["a"]);
        assert_eq!(turned.shape, [3, 2], "{form}");
        assert_eq!(turned.values, [0.0, 3.0, 1.0, 4.0, 2.0, 5.0], "{form}");
        assert_eq!(numbers(&value, &["k"]).shape, [4, 3, 3], "{form}");
        assert_eq!(numbers(&value, &["h"]).values, [1.0; 2], "{form}");
        assert_eq!(numbers(&value, &["p"]).values, [0.0; 2], "{form}");
        assert_eq!(numbers(&value, &["o", "i"]).values, [1.0, 2.0], "{form}");
    }
}

#[test]
fn joblib_holds_arrays_objects_and_tensors() {
    let value = pickle::read(&seed("pickle/joblib")).expect("reads");
    assert_eq!(numbers(&value, &["a"]).shape, [2, 3]);
    let objects = [Value::Number(1.0), Value::Text("x".into())];
    assert_eq!(value.get("o").and_then(Value::items), Some(&objects[..]));
    assert_eq!(numbers(&value, &["t"]).values, [1.0; 2]);
    let packed = pickle::read(&seed("pickle/joblib_zlib")).expect("reads");
    assert_eq!(numbers(&packed, &["a"]).values, [1.0; 3]);
    assert_eq!(packed.get("s").and_then(Value::text), Some("x"));
}
