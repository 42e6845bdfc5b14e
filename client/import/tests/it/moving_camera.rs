//! Cameras that move: bodies and cameras stand in the tool's world, and bodies are seen where they were.

use crate::pose_tools::{ToWorld, files, import, off, options, truth};
use crate::{format, pickled};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use yoto_capture::skeleton::Skeleton;
use yoto_import::{Format, Imported, Options, read};

/// TRAM's folder with another file of cameras.
fn tram(dir: &Path, cameras: &str) -> PathBuf {
    let to = dir.join(Path::new(cameras).file_stem().expect("a name"));
    std::fs::create_dir_all(to.join("hps")).expect("a folder");
    for (from, name) in [
        ("results/walk/hps/hps_track_0.npy", "hps/hps_track_0.npy"),
        ("results/walk/masks.npy", "masks.npy"),
        (cameras, "camera.npy"),
    ] {
        std::fs::copy(files("tram").join(from), to.join(name)).expect("copies");
    }
    to
}

/// The world's joints of each frame are those of the script, moved by its cameras, and land on their
/// pixels.
fn stands_in(found: &Imported, cameras: &[ToWorld]) {
    let truth = truth();
    let body = &truth.people[0];
    let skeleton = Skeleton::from_track(&found.track.skeleton).expect("a skeleton");
    for frame in &found.track.frames {
        let at = frame.index as usize;
        let pose = yoto_capture::camera::Pose::from_frame(frame).expect("a pose");
        let camera = &cameras[at];
        for (joint, seen) in skeleton.posed_joints(&pose).iter().zip(&body.joints[at]) {
            for axis in 0..3 {
                let turned: f64 = (0..3).map(|i| camera.r[axis][i] * seen[i]).sum();
                let wanted = turned + camera.t[axis];
                assert!((joint[axis] - wanted).abs() < 2e-3, "frame {at}: {joint:?}");
            }
        }
    }
    let off = off(&found.track, |frame| body.pixels[frame].clone());
    assert!(off < 0.5, "{off:.2} px");
    assert_eq!(found.track.frames.len(), 16);
}

/// The direction from the pelvis to the neck, in the world.
fn spine(found: &Imported, at: usize) -> [f64; 3] {
    let skeleton = Skeleton::from_track(&found.track.skeleton).expect("a skeleton");
    let pose = yoto_capture::camera::Pose::from_frame(&found.track.frames[at]).expect("a pose");
    let joints = skeleton.posed_joints(&pose);
    let way: [f64; 3] = std::array::from_fn(|i| joints[12][i] - joints[0][i]);
    let length = way.iter().map(|v| v * v).sum::<f64>().sqrt();
    way.map(|v| v / length)
}

#[test]
fn tram_s_bodies_stand_upright_in_its_world() {
    let dir = tempfile::tempdir().expect("a folder");
    let cameras = &truth().tools["tram"].camera_to_world;
    let found = import(&options(dir.path(), files("tram/results/walk")));
    stands_in(&found, &cameras["world"]);
    assert!(found.notes.join("\n").contains("whose y points up"));
    for at in 0..16 {
        assert!(spine(&found, at)[1] > 0.98, "{:?}", spine(&found, at));
    }
    // A later version does not say where up is.
    let later = import(&options(dir.path(), tram(dir.path(), "cameras/later.npy")));
    stands_in(&later, &cameras["first"]);
    let notes = later.notes.join("\n");
    assert!(notes.contains("first frame's camera"), "{notes}");
    let still = import(&options(dir.path(), tram(dir.path(), "cameras/still.npy")));
    assert!(!still.notes.join("\n").contains("moves"));
    for frame in &still.track.frames {
        let is_own = |i: usize, j: usize| frame.e[i][j] == f64::from(u8::from(i == j));
        assert!((0..4).all(|i| (0..4).all(|j| is_own(i, j))));
    }
    // A focal length of the user's moves bodies along the view, wherever the camera is.
    let longer = Options {
        focal: Some(2.0 * found.track.frames[0].k[0][0]),
        ..options(dir.path(), files("tram/results/walk"))
    };
    let longer = import(&longer);
    let depth = |found: &Imported, at: usize| {
        let frame = &found.track.frames[at];
        let rest = found.track.skeleton.rest_joints[0];
        let along = |i: usize| frame.e[2][i] * (rest[i] + frame.translation[i]);
        (0..3).map(along).sum::<f64>() + frame.e[2][3]
    };
    for at in [0, 15] {
        assert!((depth(&longer, at) / depth(&found, at) - 2.0).abs() < 1e-9);
    }
}

/// PromptHMR's file of the first person, with cameras.
fn prompt_hmr(dir: &Path, change: impl Fn(&mut Value)) -> PathBuf {
    let truth = truth();
    let (body, cameras) = (&truth.people[0], &truth.tools["tram"].camera_to_world);
    let rotations = |pose: &Vec<f64>| -> Value {
        let all = (0..55).map(|joint| {
            let axis = |i: usize| pose.get(3 * joint + i).copied().unwrap_or_default();
            let rotation = [axis(0), axis(1), axis(2)];
            let rotation = if joint < 22 { rotation } else { [0.0; 3] };
            yoto_capture::skeleton::transform::rodrigues(rotation)
        });
        json!(all.collect::<Vec<_>>())
    };
    let of = |name: &str| {
        let (r, t): (Vec<_>, Vec<_>) = cameras[name].iter().map(|it| (it.r, it.t)).unzip();
        json!({"pred_cam_R": r, "pred_cam_T": t, "img_focal": truth.tools["tram"].k[0][0],
            "img_center": [32.0, 48.0]})
    };
    let mut file = json!({
        "people": {"1": {"frames": (0..16).collect::<Vec<_>>(), "smplx_cam": {
            "rotmat": body.poses.iter().map(rotations).collect::<Vec<_>>(),
            "shape": [vec![0.0; 10]], "trans": body.t}}},
        "camera": of("first"), "camera_world": of("world"),
    });
    change(&mut file);
    let path = dir.join("results.pkl");
    pickled::write(&path, &file);
    path
}

#[test]
fn prompt_hmr_s_bodies_stand_upright_in_its_world() {
    let dir = tempfile::tempdir().expect("a folder");
    let cameras = &truth().tools["tram"].camera_to_world;
    let path = prompt_hmr(dir.path(), |_| ());
    let found = import(&options(dir.path(), path));
    stands_in(&found, &cameras["world"]);
    assert!(spine(&found, 7)[1] > 0.98);
    let path = prompt_hmr(dir.path(), |file| {
        file.as_object_mut()
            .expect("an object")
            .remove("camera_world");
    });
    stands_in(&import(&options(dir.path(), path)), &cameras["first"]);
}

#[test]
fn wrong_cameras_are_named_with_their_frame() {
    let dir = tempfile::tempdir().expect("a folder");
    let refused = |change: &dyn Fn(&mut Value)| {
        let path = prompt_hmr(dir.path(), change);
        let read = read(
            Format::AUTO,
            &files("clip/frames"),
            &options(dir.path(), path),
        );
        read.map(|found| found.notes)
            .expect_err("refused")
            .to_string()
    };
    let spoil = |file: &mut Value, frames: &[usize]| {
        for frame in frames {
            file["camera_world"]["pred_cam_R"][*frame][0] = json!([2.0, 0.0, 0.0]);
        }
    };
    let text = refused(&|file| spoil(file, &[5, 6, 7, 8, 9]));
    assert!(
        text.contains("results.pkl frame 5: camera_world.pred_cam_R")
            && text.contains("(5 of 16 frames can't be used)"),
        "{text}"
    );
    let few = prompt_hmr(dir.path(), |file| {
        spoil(file, &[5]);
        file["camera_world"]["pred_cam_T"][9][0] = Value::Null;
    });
    let found = import(&options(dir.path(), few));
    let notes = found.notes.join("\n");
    for said in [
        "left out: 2 of 16 poses",
        "frame 5: camera_world.pred_cam_R: the camera's matrix is not a rotation",
        "frame 9: camera_world.pred_cam_R: the camera's rotation or position is not finite",
    ] {
        assert!(notes.contains(said), "{said}: {notes}");
    }
    assert_eq!(found.track.frames.len(), 14);
    let text = refused(&|file| {
        for name in ["pred_cam_R", "pred_cam_T"] {
            let rows = file["camera_world"][name].as_array_mut().expect("rows");
            rows.truncate(11);
        }
    });
    assert!(text.contains("there is no camera of frame 11"), "{text}");
    let text = refused(&|file| {
        file["camera"]["pred_cam_T"]
            .as_array_mut()
            .expect("rows")
            .pop();
    });
    assert!(text.contains("camera.pred_cam_T: 15 rows"), "{text}");
}

#[test]
fn ex_avatar_s_camera_is_from_the_world() {
    let dir = tempfile::tempdir().expect("a folder");
    let tool = &truth().tools["ex_avatar"];
    let cameras = &truth().tools["tram"].camera_to_world["world"];
    for folder in ["smplx_optimized/smplx_params", "cam_params"] {
        std::fs::create_dir_all(dir.path().join(folder)).expect("a folder");
        for (frame, camera) in cameras.iter().enumerate() {
            let name = format!("{folder}/{frame}.json");
            let text = std::fs::read(files("ex_avatar").join(&name)).expect("a file");
            let mut json: Value = serde_json::from_slice(&text).expect("JSON");
            if folder == "cam_params" {
                let ToWorld { r, t } = camera;
                let column_of = |i: usize| std::array::from_fn::<f64, 3, _>(|j| r[j][i]);
                json["R"] = json!([column_of(0), column_of(1), column_of(2)]);
                let shift = |i: usize| -(0..3).map(|j| r[j][i] * t[j]).sum::<f64>();
                json["t"] = json!([shift(0), shift(1), shift(2)]);
            }
            std::fs::write(dir.path().join(name), json.to_string()).expect("writes");
        }
    }
    let found = import(&options(dir.path(), dir.path().to_owned()));
    assert!(found.notes.join("\n").contains("the world of cam_params"));
    let pixels = tool.people[0].pixels.as_ref().expect("of its camera");
    let off = off(&found.track, |frame| pixels[frame].clone());
    assert!(off < 0.5, "{off:.2} px");
    assert!(spine(&found, 9)[1] > 0.98, "{:?}", spine(&found, 9));
    let without = |frame: usize| {
        std::fs::remove_file(dir.path().join(format!("cam_params/{frame}.json"))).expect("removes");
        read(
            format("exavatar"),
            &files("clip/frames"),
            &options(dir.path(), dir.path().to_owned()),
        )
    };
    let found = without(3).expect("the others have cameras");
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("cam_params/3.json frame 3: there is no such file"),
        "{notes}"
    );
    assert_eq!(found.track.frames.len(), 15);
    for frame in 4..7 {
        without(frame).expect("few");
    }
    let text = without(7).expect_err("many").to_string();
    assert!(text.contains("(5 of 16 frames can't be used)"), "{text}");
}
