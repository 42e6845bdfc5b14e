//! What a client without a feature refuses, with the way to get one that has it.

#[cfg(not(feature = "matting"))]
use yoto_import::MattingModel;
use yoto_import::{Format, Options, read};

#[cfg(not(feature = "hdf5"))]
#[test]
fn people_snapshot_needs_the_feature_hdf5() {
    let folder = crate::captures("people_snapshot/x-1-test");
    for format in [Format::AUTO, crate::format("people-snapshot")] {
        let error = read(format, &folder, &Options::default()).expect_err("no reader of HDF5");
        let text = error.to_string();
        for part in [
            "reconstructed_poses.hdf5",
            "cargo run --features yoto/hdf5 --bin yoto -- ",
            "cargo install --path client --features hdf5",
        ] {
            assert!(text.contains(part), "{text}");
        }
    }
}

#[test]
fn a_file_of_people_snapshot_is_not_imported_alone() {
    let file = crate::captures("people_snapshot/x-1-test/masks.hdf5");
    let error = read(Format::AUTO, &file, &Options::default()).expect_err("one file");
    assert!(error.to_string().contains("name their folder"), "{error}");
}

#[cfg(not(feature = "matting"))]
#[test]
fn matting_models_need_the_feature_matting_before_any_work() {
    let options = Options {
        matting: Some(MattingModel {
            path: "modnet.onnx".into(),
            levels: None,
        }),
        ..Options::default()
    };
    let clip = std::path::Path::new("there is no such clip");
    let error = read(Format::AUTO, clip, &options).expect_err("no runtime for networks");
    let text = error.to_string();
    for part in [
        "modnet.onnx",
        "cargo run --features yoto/matting --bin yoto -- ",
        "cargo install --path client --features matting",
        "--masks",
    ] {
        assert!(text.contains(part), "{text}");
    }
}
