//! What is wrong is said by file, frame and field.

use crate::{captures, format};
use std::path::Path;
use yoto_import::{Format, Options, TrackForm, read, write};

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("a folder");
    for entry in std::fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("an entry");
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).expect("copies");
        }
    }
}

/// What importing a capture says after `break_it` had its way with a copy of it.
fn fault(format: Format, name: &str, options: &Options, break_it: impl Fn(&Path)) -> String {
    let dir = tempfile::tempdir().expect("a folder");
    let source = dir.path().join("source");
    copy(&captures(name), &source);
    break_it(&source);
    let done = read(format, &source, options).and_then(|found| {
        write(
            &found,
            &dir.path().join("out"),
            TrackForm::Json,
            |_, _, _| {},
        )
    });
    done.expect_err("it is broken").to_string()
}

fn smpl() -> Options {
    Options {
        body_model: Some(captures("smpl/model.npz")),
        ..Options::default()
    }
}

#[test]
fn shape_parameters_need_a_body_model() {
    let none = Options::default();
    for (format, name) in [
        (format("zju"), "CoreView_377"),
        (format("humannerf"), "humannerf_wild"),
        #[cfg(feature = "hdf5")]
        (format("people-snapshot"), "people_snapshot/x-1-test"),
        (format("instant-avatar"), "instant_avatar"),
    ] {
        let text = fault(format, name, &none, |_| {});
        assert!(text.contains("--smpl FILE"), "{name}: {text}");
    }
}

fn remove(name: &'static str) -> impl Fn(&Path) {
    move |dir| std::fs::remove_file(dir.join(name)).expect("removes")
}

fn cut(name: &'static str) -> impl Fn(&Path) {
    move |dir| {
        let bytes = std::fs::read(dir.join(name)).expect("reads");
        std::fs::write(dir.join(name), &bytes[..bytes.len() / 2]).expect("writes");
    }
}

#[cfg(feature = "hdf5")]
fn empty(name: &'static str) -> impl Fn(&Path) {
    move |dir| std::fs::write(dir.join(name), b"").expect("writes")
}

#[cfg(feature = "hdf5")]
#[test]
fn missing_and_truncated_files_of_people_snapshot_are_named() {
    let snapshot = |break_it: &dyn Fn(&Path)| {
        fault(
            format("people-snapshot"),
            "people_snapshot/x-1-test",
            &smpl(),
            break_it,
        )
    };
    for name in ["masks.hdf5", "reconstructed_poses.hdf5", "camera.pkl"] {
        for text in [
            snapshot(&remove(name)),
            snapshot(&cut(name)),
            snapshot(&empty(name)),
        ] {
            assert!(text.contains(name), "{name}: {text}");
        }
    }
}

#[cfg(feature = "hdf5")]
#[test]
fn chunks_beyond_their_file_or_dataset_are_refused() {
    // The tree of chunks: a header of 24 bytes, then the first chunk's size, its filters, and its offsets.
    let cases: [(usize, &[u8], &str); 2] = [
        (24, &[0, 0xfe, 0xff, 0xff], "ends after the file"),
        (
            24 + 8 + 8,
            &[0xff; 8],
            "a chunk is at [0, 18446744073709551615, 0]",
        ),
    ];
    for (at, forged, reason) in cases {
        let text = fault(
            format("people-snapshot"),
            "people_snapshot/x-1-test",
            &smpl(),
            |dir| {
                let path = dir.join("masks.hdf5");
                let mut bytes = std::fs::read(&path).expect("reads");
                let tree = bytes.windows(5).position(|it| it == b"TREE\x01");
                let start = tree.expect("a tree of chunks") + at;
                bytes[start..start + forged.len()].copy_from_slice(forged);
                std::fs::write(path, bytes).expect("writes");
            },
        );
        assert!(
            text.contains("masks.hdf5") && text.contains(reason),
            "{text}"
        );
    }
}

#[test]
fn missing_and_truncated_files_are_named_with_their_frame() {
    let zju = |break_it: &dyn Fn(&Path)| fault(format("zju"), "CoreView_377", &smpl(), break_it);
    let text = zju(&remove("new_params/1.npy"));
    assert!(
        text.contains("new_params/1.npy frame 1: there is no such file"),
        "{text}"
    );
    let text = zju(&cut("new_params/2.npy"));
    assert!(text.contains("new_params/2.npy frame 2:"), "{text}");
    let text = zju(&cut("annots.npy"));
    assert!(
        text.contains("annots.npy") && text.contains("ends too early"),
        "{text}"
    );
    let text = zju(&remove("Camera_B1/000002.jpg"));
    assert!(
        text.contains("000002.jpg frame 2: there is no such file"),
        "{text}"
    );
    let text = zju(&cut("mask/Camera_B1/000001.png"));
    assert!(text.contains("000001.png frame 1:"), "{text}");

    let prepared = |break_it: &dyn Fn(&Path)| {
        let none = Options::default();
        fault(
            format("humannerf"),
            "humannerf_wild_prepared",
            &none,
            break_it,
        )
    };
    for name in ["cameras.pkl", "mesh_infos.pkl", "canonical_joints.pkl"] {
        for text in [prepared(&remove(name)), prepared(&cut(name))] {
            assert!(text.contains(name), "{name}: {text}");
        }
    }
    let text = prepared(&remove("masks/frame_000001.png"));
    assert!(
        text.contains("masks/frame_000001.png frame 1: there is no"),
        "{text}"
    );
}

#[test]
fn wrong_numbers_are_named_with_their_field() {
    let edit = |change: &dyn Fn(&mut serde_json::Value)| {
        fault(format("humannerf"), "humannerf_wild", &smpl(), |dir| {
            let path = dir.join("metadata.json");
            let text = std::fs::read(&path).expect("reads");
            let mut json = serde_json::from_slice(&text).expect("JSON");
            change(&mut json);
            std::fs::write(&path, json.to_string()).expect("writes");
        })
    };
    let frame = "frame_000001";
    type Change<'a> = &'a dyn Fn(&mut serde_json::Value);
    let cases: [(Change<'_>, &str); 6] = [
        (
            &|json| json[frame]["poses"][7] = 1e30.into(),
            "frame 1: frame_000001.poses: the rotation of r_hip is 1",
        ),
        (
            &|json| json[frame]["poses"] = vec![0.0; 70].into(),
            "frame 1: frame_000001.poses: a list of 70 instead of [72]",
        ),
        (
            &|json| json[frame]["cam_intrinsics"] = "K".into(),
            "frame 1: frame_000001.cam_intrinsics: text instead of an array",
        ),
        (
            &|json| {
                json[frame]
                    .as_object_mut()
                    .expect("a frame")
                    .remove("betas");
            },
            "frame 1: frame_000001: there is no 'betas'",
        ),
        (
            &|json| json[frame]["cam_extrinsics"][0][0] = 7.into(),
            "poses.json frame 1: E: the upper 3x3",
        ),
        (
            &|json| json["../../etc/passwd"] = json[frame].take(),
            "is not a file name",
        ),
    ];
    for (change, expected) in cases {
        let text = edit(change);
        assert!(text.contains(expected), "{expected}: {text}");
    }
}

#[test]
fn counts_that_do_not_fit_are_said() {
    let text = fault(format("instant-avatar"), "instant_avatar", &smpl(), |dir| {
        std::fs::remove_file(dir.join("masks/mask_0002.npy")).expect("removes");
    });
    assert!(text.contains("masks: 3 masks for 4 images"), "{text}");
    let split = Options {
        poses: Some("poses/train.npz".into()),
        ..smpl()
    };
    let text = fault(format("instant-avatar"), "instant_avatar", &split, |_| {});
    assert!(text.contains("2 poses for 4 images"), "{text}");
    let text = fault(format("instant-avatar"), "instant_avatar", &smpl(), |dir| {
        std::fs::remove_file(dir.join("poses.npz")).expect("removes");
        std::fs::copy(dir.join("poses/train.npz"), dir.join("poses/test.npz")).expect("copies");
    });
    assert!(
        text.contains("--poses FILE") && text.contains("poses/test.npz"),
        "{text}"
    );
    let many = Options {
        camera: Some(23),
        ..smpl()
    };
    let text = fault(format("zju"), "CoreView_377", &many, |_| {});
    assert!(
        text.contains("cams.K: there is no camera 23: there are 23"),
        "{text}"
    );
    let none = Options {
        frames: Some((9, 12, 1)),
        ..smpl()
    };
    let text = fault(format("zju"), "CoreView_377", &none, |_| {});
    assert!(text.contains("0 of 3 frames"), "{text}");
}

#[test]
fn pictures_of_another_size_or_kind_are_refused() {
    let text = fault(format("humannerf"), "humannerf_wild", &smpl(), |dir| {
        let small = image::RgbImage::new(10, 10);
        small
            .save(dir.join("masks/frame_000001.png"))
            .expect("writes");
    });
    assert!(
        text.contains("frame_000001.png frame 1: 10x10 pixels"),
        "{text}"
    );
    let text = fault(format("humannerf"), "humannerf_wild", &smpl(), |dir| {
        std::fs::write(dir.join("images/frame_000001.png"), b"GIF89a").expect("writes");
    });
    assert!(text.contains("frame_000001.png frame 1:"), "{text}");
}

#[cfg(feature = "hdf5")]
#[test]
fn a_pickle_that_would_run_a_program_is_refused() {
    let text = fault(
        format("people-snapshot"),
        "people_snapshot/x-1-test",
        &smpl(),
        |dir| {
            std::fs::write(dir.join("camera.pkl"), b"cos\nsystem\n(S'true'\ntR.").expect("writes");
        },
    );
    assert!(
        text.contains("camera.pkl") && text.contains("calls os.system"),
        "{text}"
    );
}
