//! Files that break the conventions of the tools that wrote them: corrected and said, or refused.

use crate::pickled;
use crate::pose_tools::{files, import, indices, off, options, truth};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use yoto_capture::skeleton::transform::rodrigues;
use yoto_import::{Format, Imported, Options, read};

/// How far a body is beside the masks, metres.
const ASIDE: f64 = 0.08;

fn refused(clip: &Path, options: &Options) -> String {
    let done = read(Format::Auto, clip, options);
    done.map(|found| found.notes)
        .expect_err("refused")
        .to_string()
}

/// WHAM's file of the first person, changed.
fn wham(dir: &Path, frames: &[usize], change: impl Fn(&mut Value)) -> PathBuf {
    let body = &truth().people[0];
    let of = |frame: &usize| (body.poses[*frame].clone(), body.t[*frame]);
    let (poses, t): (Vec<Vec<f64>>, Vec<[f64; 3]>) = frames.iter().map(of).unzip();
    let numbers: Vec<usize> = (0..frames.len()).collect();
    let mut person =
        json!({"pose": poses, "trans": t, "betas": [vec![0.0; 10]], "frame_ids": numbers});
    change(&mut person);
    let path = dir.join("wham_output.pkl");
    pickled::write(&path, &json!({ "0": person }));
    path
}

fn all() -> Vec<usize> {
    (0..16).collect()
}

fn lands(found: &Imported) {
    let truth = truth();
    let off = off(&found.track, |frame| truth.people[0].pixels[frame].clone());
    assert!(off < 0.5, "{off:.2} px; {:?}", found.notes);
}

#[test]
fn a_translation_of_the_other_meaning_is_found_by_the_masks() {
    let dir = tempfile::tempdir().expect("a folder");
    let pelvis = truth().rest_joints[0];
    // Th = t + J0 − R J0, written where t belongs.
    let path = wham(dir.path(), &all(), |person| {
        for frame in 0..16 {
            let angle = |i: usize| person["pose"][frame][i].as_f64().expect("a number");
            let r = rodrigues([angle(0), angle(1), angle(2)]);
            for axis in 0..3 {
                let turned: f64 = (0..3).map(|i| r[axis][i] * pelvis[i]).sum();
                let t = person["trans"][frame][axis].as_f64().expect("a number");
                person["trans"][frame][axis] = (t + pelvis[axis] - turned).into();
            }
        }
    });
    let found = import(&options(dir.path(), path));
    lands(&found);
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("not as WHAM documents") && notes.contains("as EasyMocap's Th"),
        "{notes}"
    );
}

/// LHM's files with each changed.
fn lhm(dir: &Path, change: impl Fn(&mut Value)) -> PathBuf {
    let folder = dir.join("smplx_params");
    std::fs::create_dir_all(&folder).expect("a folder");
    for number in 1..=16 {
        let name = format!("{number:05}.json");
        let text = std::fs::read(files("lhm/smplx_params").join(&name)).expect("a file");
        let mut frame = serde_json::from_slice(&text).expect("JSON");
        change(&mut frame);
        std::fs::write(folder.join(name), frame.to_string()).expect("writes");
    }
    folder
}

#[test]
fn a_wrong_focal_length_is_found_by_the_masks() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = lhm(dir.path(), |frame| {
        for axis in 0..2 {
            let focal = frame["focal"][axis].as_f64().expect("a number");
            frame["focal"][axis] = (1.6 * focal).into();
        }
    });
    let found = import(&options(dir.path(), path));
    lands(&found);
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("not as LHM documents: the focal length √(W²+H²)"),
        "{notes}"
    );
}

/// A clip of every fourth frame, in which a frame is a large step.
fn steps(dir: &Path) -> PathBuf {
    let clip = dir.join("clip");
    for (folder, digits) in [("frames", 6), ("masks", 5)] {
        std::fs::create_dir_all(clip.join(folder)).expect("a folder");
        for at in 0..4 {
            let from = files(&format!("clip/{folder}/{:0digits$}.png", 4 * at));
            std::fs::copy(from, clip.join(format!("{folder}/{at:06}.png"))).expect("copies");
        }
    }
    clip
}

#[test]
fn easymocap_needs_its_camera_and_keeps_its_lens() {
    let dir = tempfile::tempdir().expect("a folder");
    let smpl = dir.path().join("capture/smpl");
    std::fs::create_dir_all(&smpl).expect("a folder");
    for frame in 0..16 {
        let name = format!("{frame:06}.json");
        let from = files("easymocap/output/smpl").join(&name);
        std::fs::copy(from, smpl.join(name)).expect("copies");
    }
    let at = dir.path().join("capture");
    let text = refused(&files("clip/frames"), &options(dir.path(), at.clone()));
    assert!(text.contains("intri.yml: there is no intri.yml"), "{text}");
    std::fs::copy(files("easymocap/extri.yml"), at.join("extri.yml")).expect("copies");
    let text = std::fs::read_to_string(files("easymocap/intri.yml")).expect("reads");
    let lens = "0.000000, 0.000000, 0.000000, 0.000000, 0.000000";
    assert!(text.contains(lens), "{text}");
    std::fs::write(
        at.join("intri.yml"),
        text.replace(lens, "-0.1, 0.02, 0, 0.001, 0"),
    )
    .expect("writes");
    let found = import(&options(dir.path(), at.clone()));
    assert_eq!(found.track.distortion, [-0.1, 0.02, 0.0, 0.001, 0.0]);
    for (numbers, expected) in [
        ("-0.1, 0.02, 0, 0.001", Some([-0.1, 0.02, 0.0, 0.001, 0.0])),
        ("-0.1, much, 0, 0.001, 0", None),
        ("-0.1, 0.02", None),
    ] {
        std::fs::write(at.join("intri.yml"), text.replace(lens, numbers)).expect("writes");
        let read = read(
            Format::Auto,
            &files("clip/frames"),
            &options(dir.path(), at.clone()),
        );
        match (read, expected) {
            (Ok(found), Some(expected)) => assert_eq!(found.track.distortion, expected),
            (Err(error), None) => {
                let text = error.to_string();
                assert!(
                    text.contains("intri.yml: dist_01: not the 5 numbers"),
                    "{text}"
                );
            }
            (read, _) => panic!("{numbers}: {read:?}"),
        }
    }
    let second = Options {
        camera: Some(1),
        ..options(dir.path(), at.clone())
    };
    let message = refused(&files("clip/frames"), &second);
    assert!(
        message.contains("intri.yml: names: there is no camera 1"),
        "{message}"
    );
    std::fs::write(
        at.join("intri.yml"),
        text.replace("data: [", "data: [nan, "),
    )
    .expect("writes");
    let message = refused(&files("clip/frames"), &options(dir.path(), at));
    assert!(message.contains("intri.yml: K_01"), "{message}");
}

#[test]
fn poses_a_frame_late_are_found_by_the_masks() {
    let dir = tempfile::tempdir().expect("a folder");
    let clip = steps(dir.path());
    let shifted = |by: usize| {
        let path = wham(dir.path(), &[0, 4, 8], |person| {
            person["frame_ids"] = json!([by, by + 1, by + 2]);
        });
        let options = Options {
            masks: Some(clip.join("masks")),
            ..options(dir.path(), path)
        };
        read(Format::Auto, &clip.join("frames"), &options).expect("imports")
    };
    let (right, late) = (shifted(0), shifted(1));
    assert!(
        right.notes.join("\n").contains("read as WHAM documents"),
        "{:?}",
        right.notes
    );
    let notes = late.notes.join("\n");
    assert!(notes.contains("a frame earlier than its number"), "{notes}");
    assert_eq!(indices(&late.track), [0, 1, 2]);
    assert_eq!(right.track, late.track);
}

#[test]
fn a_person_beside_the_masks_is_not_taken_for_being_seen_longer() {
    let dir = tempfile::tempdir().expect("a folder");
    let body = &truth().people[0];
    let seen = |frames: std::ops::Range<usize>, aside: f64| {
        let t = body.t[frames.clone()].iter();
        let t: Vec<[f64; 3]> = t.map(|[x, y, z]| [x + aside, *y, *z]).collect();
        json!({"pose": body.poses[frames.clone()], "trans": t, "betas": [vec![0.0; 10]],
            "frame_ids": frames.collect::<Vec<_>>()})
    };
    let path = dir.path().join("wham_output.pkl");
    let taken = |people: Value| {
        pickled::write(&path, &people);
        let found = import(&options(dir.path(), path.clone()));
        let notes = found.notes.join("\n");
        (notes, indices(&found.track))
    };
    // The one beside agrees to 65 %, in twice as many frames; the person to 95 %.
    let (notes, frames) = taken(json!({"1": seen(0..16, ASIDE), "2": seen(3..11, 0.0)}));
    assert!(notes.contains("person 2 is taken (8 frames)"), "{notes}");
    assert_eq!(frames, (3..11).collect::<Vec<_>>());
    // One person under two numbers, one after the other.
    let (notes, frames) = taken(json!({"1": seen(0..4, 0.0), "2": seen(6..16, 0.0)}));
    assert!(
        notes.contains("person 1 goes on as 2 (3 frames later"),
        "{notes}"
    );
    assert_eq!(frames, (0..4).chain(6..16).collect::<Vec<_>>());
    // Somebody else appears elsewhere.
    let (notes, _) = taken(json!({"1": seen(0..4, 2.0), "2": seen(6..16, 0.0)}));
    assert!(notes.contains("person 2 is taken (10 frames)"), "{notes}");
}

#[test]
fn exchanged_sides_are_refused_by_name() {
    let dir = tempfile::tempdir().expect("a folder");
    let body = &truth().people[0];
    let mirror = |joints: &[[f64; 3]]| {
        let pairs = [
            (1, 2),
            (4, 5),
            (7, 8),
            (10, 11),
            (13, 14),
            (16, 17),
            (18, 19),
            (20, 21),
            (22, 23),
        ];
        let mut joints = joints.to_vec();
        pairs
            .iter()
            .for_each(|&(left, right)| joints.swap(left, right));
        joints.resize(71, [0.0; 3]);
        joints
    };
    let mut frames = serde_json::Map::new();
    for frame in 0..16 {
        let results = json!({"smpl_thetas": [body.poses[frame]], "smpl_betas": [vec![0.0; 10]],
            "cam_trans": [body.t[frame]], "joints": [mirror(&body.joints[frame])], "track_ids": [0]});
        frames.insert(format!("{frame:06}.png"), results);
    }
    let path = dir.path().join("video_results.pkl");
    pickled::write(&path, &json!({ "results": frames }));
    let options = Options {
        rest_joints: None,
        ..options(dir.path(), path)
    };
    let text = refused(&files("clip/frames"), &options);
    assert!(
        text.contains("video_results.pkl: the left hip is on the person's right"),
        "{text}"
    );
}

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
    let text = read(Format::Wham, &files("clip/frames"), &forced);
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

#[test]
fn a_pose_that_is_not_finite_is_left_out_by_frame_and_joint() {
    let dir = tempfile::tempdir().expect("a folder");
    let whole = import(&options(dir.path(), wham(dir.path(), &all(), |_| ())));
    let spoiled = wham(dir.path(), &all(), |person| {
        person["pose"][5][3 * 4 + 1] = Value::Null;
        person["trans"][9][2] = 1e12.into();
    });
    let found = import(&options(dir.path(), spoiled));
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
    assert_eq!(indices(&found.track), left);
    lands(&found);
    assert_eq!(indices(&whole.track), all());
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
    let found = import(&options(dir.path(), path.clone()));
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("left out: 2 of 16 poses") && notes.contains("00003.json frame 2"),
        "{notes}"
    );
    let left: Vec<usize> = all()
        .into_iter()
        .filter(|at| ![2, 7].contains(at))
        .collect();
    assert_eq!(indices(&found.track), left);
}

/// Errors name what the user gave, and how to mend it.
#[test]
fn what_is_no_clip_or_selects_nothing_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = folder.path().join("walk.mp4");
    std::fs::write(&text, "no video").expect("a file");
    let error = refused(&text, &Options::default());
    assert!(
        error.contains("walk.mp4: is no video by its first bytes")
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
