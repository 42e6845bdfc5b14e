//! A few frames that can't be used, of datasets and of pose tools, are left out by name; many refuse the file.

use crate::pose_tools::{self, import};
use crate::pose_tools_made::{all, lands, lhm, wham};
use crate::{captures, format, npz, pickled};
use serde_json::{Value, json};
use std::path::Path;
use yoto_import::{Format, Imported, Options, Pictures, read};

const FRAMES: usize = 8;

fn smpl() -> Options {
    Options {
        body_model: Some(captures("smpl/model.npz")),
        ..Options::default()
    }
}

/// Indices of the frames that were read, which have a picture each.
fn indices(found: &Imported) -> Vec<u32> {
    let indices: Vec<u32> = found.track.frames.iter().map(|it| it.index).collect();
    let pictures = match &found.pictures {
        Pictures::Files(files) => files.len(),
        Pictures::Video { masks, .. } => masks.len(),
        Pictures::Decoded { .. } | Pictures::Capture(_) => 0,
    };
    assert_eq!(pictures, indices.len());
    indices
}

/// Reads a capture with few bad frames and one with many: the first leaves `left` and says `words`.
fn few_and_many(
    format: Format,
    write: &dyn Fn(&Path, &[usize]),
    bad: &[usize],
    left: &[u32],
    words: &[&str],
) {
    let dir = tempfile::tempdir().expect("a folder");
    let (few, many) = (dir.path().join("few"), dir.path().join("many"));
    write(&few, bad);
    let found = read(format, &few, &smpl()).expect("a few");
    let notes = found.notes.join("\n");
    for words in words {
        assert!(notes.contains(words), "{words}: {notes}");
    }
    assert_eq!(indices(&found), left);
    write(&many, &[0, 3, 5]);
    let text = read(format, &many, &smpl()).expect_err("many").to_string();
    assert!(text.contains("(3 of 8 frames can't be used)"), "{text}");
}

fn image(folder: &Path, name: &str) {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
    image::RgbImage::new(48, 64).save(path).expect("writes");
}

/// 72 zeros; of bad frames with a NaN at the left knee, of bad frames above 4 of another shape.
fn pose(at: usize, bad: &[usize]) -> Value {
    let mut pose = vec![json!(0.0); 72];
    if bad.contains(&at) {
        pose[3 * 4] = Value::Null;
        pose.truncate(if at > 4 { 70 } else { 72 });
    }
    json!(pose)
}

fn k() -> Value {
    json!([[90.0, 0.0, 24.0], [0.0, 90.0, 32.0], [0.0, 0.0, 1.0]])
}

fn away() -> Value {
    json!([
        [1.0, 0.0, 0.0, 0.0],
        [0.0, -1.0, 0.0, 0.0],
        [0.0, 0.0, -1.0, 3.0],
        [0.0, 0.0, 0.0, 1.0]
    ])
}

#[test]
fn zju_leaves_out_a_few() {
    let write = |to: &Path, bad: &[usize]| {
        std::fs::create_dir_all(to.join("new_params")).expect("a folder");
        let mut ims = Vec::new();
        for at in 0..FRAMES {
            let name = format!("Camera_B1/{at:06}.png");
            image(to, &name);
            image(&to.join("mask"), &name);
            ims.push(json!({"ims": [name]}));
            let body = json!({"poses": [pose(at, bad)], "shapes": [vec![0.0; 10]],
                "Rh": vec![[0.0; 3]], "Th": vec![[0.0; 3]]});
            pickled::write_npy(&to.join(format!("new_params/{at}.npy")), &body);
        }
        let turned = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
        let cams =
            json!({"K": [k()], "D": vec![[0.0; 5]], "R": [turned], "T": [[0.0, 0.0, 3000.0]]});
        pickled::write_npy(&to.join("annots.npy"), &json!({"cams": cams, "ims": ims}));
    };
    let said = [
        "left out: 2 of 8 poses",
        "2.npy frame 2: poses: the rotation of l_knee is NaN",
        "6.npy frame 6: poses: a list of 1 instead of [72]",
    ];
    few_and_many(format("zju"), &write, &[2, 6], &[0, 1, 3, 4, 5, 7], &said);
}

#[test]
fn humannerf_s_wild_video_leaves_out_a_few() {
    let write = |to: &Path, bad: &[usize]| {
        let mut all = serde_json::Map::new();
        for at in 0..FRAMES {
            let name = format!("frame_{at:06}");
            image(to, &format!("images/{name}.png"));
            image(to, &format!("masks/{name}.png"));
            let body = json!({"poses": pose(at, bad), "betas": vec![0.0; 10],
                "cam_intrinsics": k(), "cam_extrinsics": away()});
            all.insert(name, body);
        }
        std::fs::write(to.join("metadata.json"), json!(all).to_string()).expect("writes");
        if !bad.contains(&0) {
            std::fs::remove_file(to.join("masks/frame_000007.png")).expect("removes");
        }
    };
    let said = [
        "frame 2: frame_000002.poses: the rotation of l_knee is NaN",
        "masks/frame_000007.png frame 7: there is no such file",
    ];
    let left = [0, 1, 3, 4, 5, 6];
    few_and_many(format("humannerf"), &write, &[2], &left, &said);
}

#[test]
fn humannerf_s_prepared_capture_leaves_out_a_few() {
    let write = |to: &Path, bad: &[usize]| {
        let (mut bodies, mut cameras) = (serde_json::Map::new(), serde_json::Map::new());
        for at in 0..FRAMES {
            let name = format!("frame_{at:06}");
            image(to, &format!("images/{name}.png"));
            image(to, &format!("masks/{name}.png"));
            let body = json!({"Rh": vec![0.0; 3], "Th": vec![0.0; 3], "poses": pose(at, bad),
                "tpose_joints": vec![[0.0; 3]; 24]});
            bodies.insert(name.clone(), body);
            let mut camera = json!({"intrinsics": k(), "extrinsics": away()});
            // The first frame's lens does not count if the frame is left out.
            if bad == [0] && at == 3 {
                camera["extrinsics"][0][3] = Value::Null;
            }
            cameras.insert(name, camera);
        }
        pickled::write(&to.join("mesh_infos.pkl"), &json!(bodies));
        pickled::write(&to.join("cameras.pkl"), &json!(cameras));
        let rest = json!({"joints": vec![[0.0; 3]; 24]});
        pickled::write(&to.join("canonical_joints.pkl"), &rest);
    };
    let said = [
        "mesh_infos.pkl frame 0: frame_000000.poses: the rotation of l_knee is NaN",
        "cameras.pkl frame 3: frame_000003.extrinsics[3]: NaN is not a finite number",
    ];
    let left = [1, 2, 4, 5, 6, 7];
    few_and_many(format("humannerf"), &write, &[0], &left, &said);
}

#[test]
fn instant_avatar_leaves_out_a_few() {
    let write = |to: &Path, bad: &[usize]| {
        for at in 0..FRAMES {
            image(to, &format!("images/{at:04}.png"));
            image(to, &format!("masks/{at:04}.png"));
        }
        let mut thetas = [0.0; FRAMES * 72];
        let mut moved = [0.0; FRAMES * 3];
        for &at in bad {
            match at {
                2 => moved[3 * at + 1] = f64::INFINITY,
                _ => thetas[72 * at + 3 * 4] = f64::NAN,
            }
        }
        let k: Vec<f64> = serde_json::from_value::<Vec<[f64; 3]>>(k())
            .expect("numbers")
            .concat();
        let e: Vec<f64> = serde_json::from_value::<Vec<[f64; 4]>>(away())
            .expect("numbers")
            .concat();
        npz::write(
            &to.join("cameras.npz"),
            &[
                ("intrinsic", &[3, 3], &k),
                ("extrinsic", &[4, 4], &e),
                ("width", &[], &[48.0]),
                ("height", &[], &[64.0]),
            ],
        );
        npz::write(
            &to.join("poses.npz"),
            &[
                ("betas", &[10], &[0.0; 10]),
                ("thetas", &[FRAMES, 72], &thetas),
                ("transl", &[FRAMES, 3], &moved),
            ],
        );
    };
    let said = [
        "poses.npz frame 2: the translation is inf",
        "poses.npz frame 6: the rotation of l_knee is NaN",
    ];
    let left = [0, 1, 3, 4, 5, 7];
    few_and_many(format("instant-avatar"), &write, &[2, 6], &left, &said);
}

/// A copy of `from` whose numbers `before` are `after`.
#[cfg(feature = "hdf5")]
fn patched(from: std::path::PathBuf, before: &[f32], after: &[f32]) -> Vec<u8> {
    let bytes_of = |numbers: &[f32]| -> Vec<u8> {
        let bytes = numbers.iter().map(|number| number.to_le_bytes());
        bytes.flatten().collect()
    };
    let mut bytes = std::fs::read(from).expect("reads");
    let wanted = bytes_of(before);
    let places: Vec<usize> = bytes
        .windows(wanted.len())
        .enumerate()
        .filter_map(|(at, window)| (window == wanted).then_some(at))
        .collect();
    let [at] = places[..] else {
        panic!("{} places", places.len());
    };
    bytes.splice(at..at + wanted.len(), bytes_of(after));
    bytes
}

#[cfg(feature = "hdf5")]
#[test]
fn people_snapshot_leaves_out_one() {
    let from = captures("people_snapshot/x-1-test");
    let dir = tempfile::tempdir().expect("a folder");
    let whole = read(format("people-snapshot"), &from, &smpl()).expect("reads");
    for name in ["camera.pkl", "masks.hdf5"] {
        std::fs::copy(from.join(name), dir.path().join(name)).expect("copies");
    }
    std::fs::create_dir_all(dir.path().join("images")).expect("a folder");
    for at in 0..4 {
        let name = format!("images/image_{at:04}.png");
        std::fs::copy(from.join(&name), dir.path().join(name)).expect("copies");
    }
    let knee: Vec<f32> = whole.track.frames[0].pose[12..15]
        .iter()
        .map(|value| *value as f32)
        .collect();
    let bytes = patched(from.join("reconstructed_poses.hdf5"), &knee, &[f32::NAN; 3]);
    std::fs::write(dir.path().join("reconstructed_poses.hdf5"), bytes).expect("writes");
    let found = read(format("people-snapshot"), dir.path(), &smpl()).expect("one");
    assert_eq!(indices(&found), [1, 2, 3]);
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("reconstructed_poses.hdf5 frame 0: the rotation of l_knee is NaN"),
        "{notes}"
    );
    let two = Options {
        frames: Some((0, 2, 1)),
        ..smpl()
    };
    let text = read(format("people-snapshot"), dir.path(), &two)
        .expect_err("a half")
        .to_string();
    assert!(text.contains("(1 of 2 frames can't be used)"), "{text}");
}

#[test]
fn a_pose_that_is_not_finite_is_left_out_by_frame_and_joint() {
    let dir = tempfile::tempdir().expect("a folder");
    let whole = import(&pose_tools::options(
        dir.path(),
        wham(dir.path(), &all(), |_| ()),
    ));
    let spoiled = wham(dir.path(), &all(), |person| {
        person["pose"][5][3 * 4 + 1] = Value::Null;
        person["trans"][9][2] = 1e12.into();
    });
    let found = import(&pose_tools::options(dir.path(), spoiled));
    let notes = found.notes.join("\n");
    for said in [
        "left out: 2 of 16 poses",
        "frame 5: the rotation of l_knee is NaN",
        "frame 9: the translation is 1000000000000",
        "2 frames without a pose of the person (5, 9)",
    ] {
        assert!(notes.contains(said), "{said}: {notes}");
    }
    let left: Vec<usize> = all()
        .into_iter()
        .filter(|at| ![5, 9].contains(at))
        .collect();
    assert_eq!(pose_tools::indices(&found.track), left);
    lands(&found);
    assert_eq!(pose_tools::indices(&whole.track), all());
}

#[test]
fn a_frame_of_another_shape_is_left_out() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = lhm(dir.path(), |_| ());
    let spoil = |number: usize, text: &str| {
        std::fs::write(path.join(format!("{number:05}.json")), text).expect("writes");
    };
    spoil(
        3,
        r#"{"root_pose": [0, 0], "body_pose": [], "trans": [0, 0, 0], "betas": [0]}"#,
    );
    // As Python writes a number that JSON does not have.
    let text = std::fs::read_to_string(path.join("00008.json")).expect("reads");
    let at = text.find("\"trans\":[").expect("a translation") + 9;
    spoil(
        8,
        &format!(
            "{}NaN,{}",
            &text[..at],
            &text[at + text[at..].find(',').expect("two") + 1..]
        ),
    );
    let found = import(&pose_tools::options(dir.path(), path.clone()));
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("left out: 2 of 16 poses") && notes.contains("00003.json frame 2"),
        "{notes}"
    );
    let left: Vec<usize> = all()
        .into_iter()
        .filter(|at| ![2, 7].contains(at))
        .collect();
    assert_eq!(pose_tools::indices(&found.track), left);
}
