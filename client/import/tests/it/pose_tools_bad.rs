//! Files of pose tools that are refused: known faults of tools, others' masks, damaged files, and what is no clip.

use crate::format;
use crate::pose_tools::{files, options};
use crate::pose_tools_made::{all, refused, wham};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use yoto_import::{Options, read};

#[test]
fn files_known_to_be_wrong_are_refused_by_name() {
    let dir = tempfile::tempdir().expect("a folder");
    let of = |path: &str| refused(&files("clip/frames"), &options(dir.path(), files(path)));
    let text = of("gvhmr/converted.pt");
    assert!(
        text.contains("converted.pt: smpl_params_incam: the same numbers as smpl_params_global"),
        "{text}"
    );
    let text = of("romp_without_smpl");
    assert!(
        text.contains("ran without SMPL") && text.contains("--calc_smpl"),
        "{text}"
    );
    for path in ["clip/masks/00000.png", "clip/frames"] {
        let text = of(path);
        for tool in [
            "4D-Humans (PHALP)",
            "GVHMR",
            "WHAM",
            "EasyMocap",
            "OpenPose",
        ] {
            assert!(text.contains(tool), "{path}: {text}");
        }
    }
    let forced = options(dir.path(), files("gvhmr/outputs/demo/walk"));
    let text = read(format("wham"), &files("clip/frames"), &forced);
    let text = text
        .map(|found| found.notes)
        .expect_err("refused")
        .to_string();
    assert!(
        text.contains("Looked for WHAM") && !text.contains("TRAM"),
        "{text}"
    );
    let unknown = Options {
        person: Some("17".into()),
        ..options(dir.path(), files("romp"))
    };
    let text = refused(&files("clip/frames"), &unknown);
    assert!(
        text.contains("there is no person 17; there are 7, 9"),
        "{text}"
    );
    let nothing = Options::default();
    let text = refused(&files("clip"), &nothing);
    assert!(
        text.contains("annots.npy") && text.contains("GVHMR"),
        "{text}"
    );
    let text = refused(&files("wham/output/demo/walk"), &nothing);
    assert!(text.contains("the clip is needed as well"), "{text}");
}

#[test]
fn masks_of_others_and_clips_of_another_shape_are_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let masks = dir.path().join("masks");
    let turned = dir.path().join("turned");
    for folder in [&masks, &turned] {
        std::fs::create_dir_all(folder).expect("a folder");
    }
    for frame in 0..16 {
        let mut mask = image::GrayImage::new(64, 96);
        for (x, y) in (44..62).flat_map(|x| (4..20).map(move |y| (x, y))) {
            mask.put_pixel(x, y, image::Luma([255]));
        }
        mask.save(masks.join(format!("{frame:05}.png")))
            .expect("writes");
        let picture = image::RgbImage::new(96, 64);
        picture
            .save(turned.join(format!("{frame:06}.png")))
            .expect("writes");
    }
    let elsewhere = Options {
        masks: Some(masks),
        ..options(dir.path(), files("wham/output/demo/walk"))
    };
    let text = refused(&files("clip/frames"), &elsewhere);
    assert!(
        text.contains("do not agree with the masks in masks") && text.contains("tried"),
        "{text}"
    );
    for path in [
        "phalp/outputs/results/demo_walk.pkl",
        "lhm",
        "tram/results/walk",
    ] {
        let options = Options {
            masks: None,
            ..options(dir.path(), files(path))
        };
        let text = refused(&turned, &options);
        assert!(text.contains("was it cut or turned?"), "{path}: {text}");
    }
}

#[test]
fn damaged_files_are_named_with_their_field() {
    let dir = tempfile::tempdir().expect("a folder");
    let of = |path: PathBuf| refused(&files("clip/frames"), &options(dir.path(), path));
    type Change<'a> = &'a dyn Fn(&mut Value);
    let cases: [(Change<'_>, &str); 6] = [
        (
            &|person| (0..5).for_each(|at| person["trans"][at][1] = Value::Null),
            "wham_output.pkl frame 0: the translation is NaN",
        ),
        (
            &|person| person["trans"] = json!([vec![0.0; 3]]),
            "0.trans: 1 rows for 16 poses",
        ),
        (
            &|person| person["pose"] = json!([vec![0.0; 70]]),
            "0.pose: a list of 1 instead of",
        ),
        (
            &|person| person["frame_ids"][2] = (-1.0).into(),
            "0.frame_ids[2]: not the number",
        ),
        (
            &|person| person["frame_ids"][2] = 1e300.into(),
            "0.frame_ids[2]",
        ),
        (
            &|person| person["betas"] = json!("tall"),
            "0.betas: text instead of",
        ),
    ];
    for (change, expected) in cases {
        let text = of(wham(dir.path(), &all(), change));
        assert!(text.contains(expected), "{expected}: {text}");
    }
    let far = wham(dir.path(), &all(), |person| {
        person["frame_ids"][15] = 4000.into()
    });
    let text = of(far);
    assert!(
        text.contains("a pose of frame 4000") && text.contains("has 16 frames"),
        "{text}"
    );
    for path in [
        "phalp/outputs/results/demo_walk.pkl",
        "wham/output/demo/walk/wham_output.pkl",
        "gvhmr/outputs/demo/walk/hmr4d_results.pt",
        "prompt_hmr/results/walk/results.pkl",
        "romp/video_results.npz",
        "tram/results/walk/hps/hps_track_0.npy",
    ] {
        let bytes = std::fs::read(files(path)).expect("reads");
        let name = Path::new(path).file_name().expect("a name");
        let cut = dir.path().join(name);
        for share in [0, 1, 5, 9] {
            std::fs::write(&cut, &bytes[..bytes.len() * share / 10]).expect("writes");
            let text = of(cut.clone());
            assert!(text.contains(&*name.to_string_lossy()), "{path}: {text}");
        }
    }
}

/// Errors name what the user gave, and how to mend it.
#[test]
fn what_is_no_clip_or_selects_nothing_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = folder.path().join("walk.mp4");
    std::fs::write(&text, "no video").expect("a file");
    let error = refused(&text, &Options::default());
    assert!(
        error.contains("walk.mp4: is not a video by its first bytes")
            && error.contains("--poses")
            && !error.contains("ZJU"),
        "{error}"
    );
    let clip = files("clip/frames");
    let nowhere = Options {
        poses: Some(folder.path().join("nowhere.pkl")),
        ..Options::default()
    };
    let error = refused(&clip, &nowhere);
    assert!(
        error.contains("nowhere.pkl: there is no such file"),
        "{error}"
    );
    let beyond = Options {
        frames: Some((20, 30, 1)),
        ..options(folder.path(), files("wham/output/demo/walk"))
    };
    let error = refused(&clip, &beyond);
    assert!(error.contains("none of its 16 frames"), "{error}");
}
