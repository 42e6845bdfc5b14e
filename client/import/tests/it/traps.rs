//! Every pose tool's files with the same mistakes: another focal length, another meaning of the translation,
//! poses that are one frame late, poses of another person, gaps. Each is named or refused, for every tool.

use crate::pickled;
use crate::pose_tools::{files, indices, off, options, truth};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use yoto_capture::skeleton::transform::{Mat3, matvec, rodrigues};
use yoto_import::{Format, Imported, Options, pose_tools, read};

type Vec3 = [f64; 3];

/// Most by which joints may be beside their pixels: a body that is as large from 16 times as far away, where
/// 4D-Humans has it, looks flatter by that.
const FLATTER: f64 = 4.0;

/// The tools, by the names that notes give them.
fn tools() -> Vec<(Tool, &'static str)> {
    let tools = pose_tools().map(|(format, name)| (Tool::of(format.name()), name));
    tools.collect()
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Tool {
    Phalp,
    Wham,
    Gvhmr,
    Tram,
    Romp,
    PromptHmr,
    Lhm,
    ExAvatar,
    EasyMocap,
}

/// What a file says of one frame.
#[derive(Clone)]
struct Row {
    number: usize,
    pose: Vec<f64>,
    /// Where the pelvis is, in the camera's axes.
    pelvis: Vec3,
}

/// A file's numbers.
struct Written {
    rows: Vec<Row>,
    /// Focal length that the positions belong to, pixels.
    focal: f64,
    /// Factor on the focal length that the file says, if it says one.
    said: f64,
    /// Whether the translation has another meaning than the tool's.
    other_place: bool,
}

/// The script's camera.
fn focal() -> f64 {
    64.0f64.hypot(96.0)
}

fn rows(frames: impl IntoIterator<Item = usize>) -> Vec<Row> {
    let truth = truth();
    let (body, pelvis) = (&truth.people[0], truth.rest_joints[0]);
    let row = |at: usize| Row {
        number: at,
        pose: body.poses[at].clone(),
        pelvis: std::array::from_fn(|i| body.t[at][i] + pelvis[i]),
    };
    frames.into_iter().map(row).collect()
}

impl Tool {
    fn of(format: &str) -> Self {
        match format {
            "phalp" => Self::Phalp,
            "wham" => Self::Wham,
            "gvhmr" => Self::Gvhmr,
            "tram" => Self::Tram,
            "romp" => Self::Romp,
            "prompthmr" => Self::PromptHmr,
            "lhm" => Self::Lhm,
            "exavatar" => Self::ExAvatar,
            "easymocap" => Self::EasyMocap,
            other => panic!("no files of {other} are written here: add it to Tool"),
        }
    }

    /// The focal length that the tool documents, where its files have none.
    fn documented(self) -> Option<f64> {
        match self {
            Self::Phalp => Some(5000.0 / 256.0 * 96.0),
            Self::Wham => Some(focal()),
            Self::Romp => Some(443.4 / 512.0 * 96.0),
            _ => None,
        }
    }

    /// As the tool writes it.
    fn right(self, rows: Vec<Row>) -> Written {
        Written {
            rows,
            focal: self.documented().unwrap_or(focal()),
            said: 1.0,
            other_place: false,
        }
    }

    /// Writes the file or folder to `dir`; its path.
    fn write(self, dir: &Path, written: &Written) -> PathBuf {
        let pelvis = truth().rest_joints[0];
        let k = written.said * written.focal;
        let root = |row: &Row| -> Vec3 { [row.pose[0], row.pose[1], row.pose[2]] };
        // In the tool's meaning, or in another's.
        let t = |row: &Row| -> Vec3 {
            let mut position = row.pelvis;
            // At another focal length the body is as large as it is seen.
            position[2] *= written.focal / focal();
            let th = |position: Vec3| {
                let about = matvec(&rodrigues(root(row)), pelvis);
                std::array::from_fn(|i| position[i] - about[i])
            };
            let smpl = |position: Vec3| std::array::from_fn(|i| position[i] - pelvis[i]);
            match (self, written.other_place) {
                (Self::Lhm, false) => position,
                (Self::Lhm | Self::EasyMocap, true) => smpl(position),
                (Self::EasyMocap, false) | (_, true) => th(position),
                (_, false) => smpl(position),
            }
        };
        let body = |row: &Row| row.pose[3..66].to_vec();
        let rotations = |row: &Row, count: usize| -> Vec<Mat3> {
            let axes = row.pose.as_chunks::<3>().0;
            let axis = |at: usize| {
                axes.get(at)
                    .copied()
                    .filter(|_| at < 22)
                    .unwrap_or_default()
            };
            (0..count).map(|at| rodrigues(axis(at))).collect()
        };
        let rows = &written.rows;
        let all = |of: &dyn Fn(&Row) -> Value| -> Value { rows.iter().map(of).collect() };
        let numbers: Vec<usize> = rows.iter().map(|row| row.number).collect();
        let betas = vec![0.0; 10];
        let put = |name: &str, value: &Value| {
            let path = dir.join(name);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            match path.extension().and_then(|it| it.to_str()) {
                Some("json") => std::fs::write(&path, value.to_string()).expect("writes"),
                Some("npy") => pickled::write_npy(&path, value),
                _ => pickled::write(&path, value),
            }
            path
        };
        match self {
            Self::Phalp => {
                let frame = |row: &Row| {
                    let rotations = rotations(row, 24);
                    let smpl = json!({"global_orient": [rotations[0]], "body_pose": rotations[1..], "betas": betas});
                    let value = json!({"time": row.number, "tid": [1], "tracked_time": [0], "smpl": [smpl],
                        "camera": [t(row)], "size": [[96, 64]]});
                    (format!("img/{:06}.jpg", row.number), value)
                };
                let frames: serde_json::Map<_, _> = rows.iter().map(frame).collect();
                put("demo_walk.pkl", &Value::Object(frames))
            }
            Self::Wham => {
                let person = json!({"pose": all(&|row| json!(row.pose)), "trans": all(&|row| json!(t(row))),
                    "betas": [betas], "frame_ids": numbers});
                put("wham_output.pkl", &json!({"0": person}))
            }
            Self::Gvhmr => {
                let incam = json!({"global_orient": all(&|row| json!(root(row))), "betas": [betas],
                    "body_pose": all(&|row| json!(body(row))), "transl": all(&|row| json!(t(row)))});
                let k = json!([[[k, 0.0, 32.0], [0.0, k, 48.0], [0.0, 0.0, 1.0]]]);
                put(
                    "hmr4d_results.pkl",
                    &json!({"smpl_params_incam": incam, "K_fullimg": k}),
                )
            }
            Self::Tram => {
                let track = json!({"pred_rotmat": all(&|row| json!(rotations(row, 24))), "pred_shape": [betas],
                    "pred_trans": all(&|row| json!([t(row)])), "frame": numbers});
                put("hps/hps_track_0.npy", &track);
                put(
                    "camera.npy",
                    &json!({"img_focal": k, "img_center": [32.0, 48.0]}),
                );
                dir.to_owned()
            }
            Self::Romp => {
                let frame = |row: &Row| {
                    let joints = vec![[0.0; 3]; 71];
                    let value = json!({"smpl_thetas": [row.pose], "smpl_betas": [betas],
                        "cam_trans": [t(row)], "joints": [joints], "track_ids": [0]});
                    (format!("{:06}.png", row.number), value)
                };
                let frames: serde_json::Map<_, _> = rows.iter().map(frame).collect();
                put("video_results.pkl", &json!({ "results": frames }))
            }
            Self::PromptHmr => {
                let body = json!({"rotmat": all(&|row| json!(rotations(row, 55))), "shape": [betas],
                    "trans": all(&|row| json!(t(row)))});
                let people = json!({"1": {"frames": numbers, "smplx_cam": body}});
                let camera = json!({"img_focal": k, "img_center": [32.0, 48.0]});
                put("results.pkl", &json!({"people": people, "camera": camera}))
            }
            Self::Lhm => {
                for row in rows {
                    let frame = json!({"root_pose": root(row), "body_pose": body(row), "betas": betas,
                        "trans": t(row), "focal": [k, k], "princpt": [32.0, 48.0],
                        "img_size_wh": [64.0, 96.0], "pad_ratio": 0.0});
                    put(&format!("smplx_params/{:05}.json", row.number + 1), &frame);
                }
                dir.join("smplx_params")
            }
            Self::ExAvatar => {
                for row in rows {
                    let frame = json!({"root_pose": root(row), "body_pose": body(row), "trans": t(row),
                        "expr": [0.0]});
                    put(
                        &format!("smplx_optimized/smplx_params/{}.json", row.number),
                        &frame,
                    );
                    let unturned = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                    let camera = json!({"R": unturned, "t": vec![0.0; 3], "focal": [k, k],
                        "princpt": [32.0, 48.0]});
                    put(&format!("cam_params/{}.json", row.number), &camera);
                }
                dir.to_owned()
            }
            Self::EasyMocap => {
                for row in rows {
                    let mut pose = row.pose.clone();
                    pose[..3].fill(0.0);
                    let person = json!({"id": 0, "Rh": [root(row)], "Th": [t(row)], "poses": [pose],
                        "shapes": [betas]});
                    put(
                        &format!("smpl/{:06}.json", row.number),
                        &json!({ "annots": [person] }),
                    );
                }
                let matrix = format!(
                    "%YAML:1.0\n---\nnames:\n  - \"01\"\nK_01: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n  \
                     data: [{k}, 0, 32, 0, {k}, 48, 0, 0, 1]\n"
                );
                std::fs::write(dir.join("intri.yml"), matrix).expect("writes");
                dir.to_owned()
            }
        }
    }
}

/// What importing `written` says.
fn import(tool: Tool, written: &Written) -> Result<Imported, String> {
    let dir = tempfile::tempdir().expect("a folder");
    let path = tool.write(dir.path(), written);
    let options = options(dir.path(), path);
    let found = read(Format::AUTO, &files("clip/frames"), &options);
    found.map_err(|error| error.to_string())
}

/// The body is where it is seen, to `most` pixels, and the note says that it is not as the tool documents.
fn is_named(tool: (Tool, &str), written: &Written, words: &str, most: f64) {
    let name = tool.1;
    let found = import(tool.0, written).unwrap_or_else(|error| panic!("{name}: {error}"));
    let notes = found.notes.join("\n");
    assert!(
        notes.contains(&format!("not as {name} documents: ")) && notes.contains(words),
        "{words}: {notes}"
    );
    let truth = truth();
    let off = off(&found.track, |frame| truth.people[0].pixels[frame].clone());
    assert!(off < most, "{name}: {off:.2} px; {notes}");
}

#[test]
fn what_is_right_is_read_as_documented() {
    for (tool, name) in tools() {
        let found = import(tool, &tool.right(rows(0..16)));
        let found = found.unwrap_or_else(|error| panic!("{name}: {error}"));
        let notes = found.notes.join("\n");
        assert!(
            notes.contains(&format!("read as {name} documents")),
            "{notes}"
        );
        assert_eq!(indices(&found.track), (0..16).collect::<Vec<_>>(), "{name}");
    }
}

#[test]
fn another_focal_length_is_named() {
    for tool in tools() {
        // A file with a focal length says a wrong one; positions in others are for another than documented.
        let written = match tool.0.documented() {
            None => Written {
                said: 1.6,
                ..tool.0.right(rows(0..16))
            },
            Some(documented) => Written {
                focal: if documented == focal() {
                    443.4 / 512.0 * 96.0
                } else {
                    focal()
                },
                ..tool.0.right(rows(0..16))
            },
        };
        is_named(tool, &written, "the focal length", FLATTER);
    }
}

#[test]
fn another_meaning_of_the_translation_is_named() {
    for tool in tools() {
        let written = Written {
            other_place: true,
            ..tool.0.right(rows(0..16))
        };
        is_named(tool, &written, "the translation as", FLATTER);
    }
}

/// A clip of every fourth frame, in which a frame is a large step.
fn steps(dir: &Path) -> PathBuf {
    let clip = dir.join("steps");
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
fn poses_a_frame_late_are_named() {
    for (tool, name) in tools() {
        let dir = tempfile::tempdir().expect("a folder");
        let clip = steps(dir.path());
        // GVHMR's rows have no numbers: a first one too many makes the others late.
        let frames: &[usize] = match tool {
            Tool::Gvhmr => &[0, 0, 4, 8],
            _ => &[0, 4, 8],
        };
        let mut rows = rows(frames.iter().copied());
        let first = if tool == Tool::Gvhmr { 0 } else { 1 };
        for (at, row) in rows.iter_mut().enumerate() {
            row.number = at + first;
        }
        let path = tool.write(dir.path(), &tool.right(rows));
        let options = Options {
            masks: Some(clip.join("masks")),
            ..options(dir.path(), path)
        };
        let found = read(Format::AUTO, &clip.join("frames"), &options);
        let found = found.unwrap_or_else(|error| panic!("{name}: {error}"));
        let notes = found.notes.join("\n");
        assert!(
            notes.contains("a frame earlier than its number"),
            "{name}: {notes}"
        );
        let truth = truth();
        let off = off(&found.track, |frame| {
            truth.people[0].pixels[4 * frame].clone()
        });
        assert!(off < FLATTER, "{name}: {off:.2} px");
    }
}

#[test]
fn poses_of_another_person_are_refused() {
    for (tool, name) in tools() {
        let mut rows = rows(0..16);
        rows.iter_mut().for_each(|row| row.pelvis[0] += 0.7);
        let error = import(tool, &tool.right(rows));
        let error = error.map(|found| found.notes).expect_err(name);
        assert!(
            error.contains("the poses do not agree with") && error.contains("of the same person?"),
            "{name}: {error}"
        );
    }
}

#[test]
fn gaps_are_said_and_left_out() {
    for (tool, name) in tools() {
        let kept: Vec<usize> = match tool {
            // Its rows have no numbers, so that only the end can be missing.
            Tool::Gvhmr => (0..12).collect(),
            _ => (0..16).filter(|at| !(5..9).contains(at)).collect(),
        };
        let found = import(tool, &tool.right(rows(kept.iter().copied())));
        let found = found.unwrap_or_else(|error| panic!("{name}: {error}"));
        let notes = found.notes.join("\n");
        let missing = if tool == Tool::Gvhmr {
            "12–15"
        } else {
            "5–8"
        };
        assert!(
            notes.contains(&format!(
                "4 frames without a pose of the person ({missing})"
            )),
            "{name}: {notes}"
        );
        assert_eq!(indices(&found.track), kept, "{name}");
    }
}
