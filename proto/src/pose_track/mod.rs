//! The pose track: body pose and camera of each frame.
//!
//! One schema for every reader, as JSON (`poses.json`) or in protocol buffers (`poses.pb`),
//! checked by [`PoseTrack::check`] on both sides: by the client before it uploads a byte, by the
//! ingest job before it decodes one. A check names the frame and the field, since "invalid
//! poses" is no help for 10,000 frames.
//!
//! Files may have one camera for all frames, and pixel centres at integers or at +0.5; in memory
//! every frame has its camera and pixel centres are at +0.5, so that later code has one case.
//! Lens distortion is kept until ingest corrects it in the images.

mod binary;
mod check;
mod file;

use crate::text::{LINE_CHARACTERS, one_line};
use crate::v1::Violation;
use serde::{Deserialize, Serialize};

/// The file name of the pose track inside a capture.
pub const FILE: &str = "poses.json";
/// The file name of a pose track in protocol buffers.
pub const BINARY_FILE: &str = "poses.pb";
/// Either of them; a capture has one.
pub const FILES: [&str; 2] = [FILE, BINARY_FILE];
/// Frames of one capture, at most.
pub const MAX_FRAMES: usize = 100_000;
/// Joints of a skeleton, at most.
pub const MAX_JOINTS: usize = 256;
/// Longest image side, pixels.
pub const MAX_SIDE: u32 = 8192;
/// Pixels of all frames together, at most: a bound on the decoded size.
pub const MAX_PIXELS: u64 = 1 << 34;
/// Largest distance of a person or camera from the origin, metres. More is a unit error.
pub const MAX_METRES: f64 = 1e4;
/// No distortion.
pub const NO_DISTORTION: [f64; 5] = [0.0; 5];

/// A pose track in memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(into = "file::FileTrack", try_from = "file::FileTrack")]
pub struct PoseTrack {
    /// The joint tree.
    pub skeleton: Skeleton,
    /// Width and height of the stored images, pixels.
    pub image_size: [u32; 2],
    /// Frames per second.
    pub fps: f64,
    /// OpenCV's k1, k2, p1, p2, k3 of the stored images; zeros for none.
    pub distortion: [f64; 5],
    /// One entry per frame.
    pub frames: Vec<Frame>,
}

/// Joint names, parents and rest (T-pose) positions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Skeleton {
    /// K distinct names.
    pub names: Vec<String>,
    /// K parents, each smaller than its child; the root has -1.
    pub parents: Vec<i32>,
    /// `[K, 3]`, metres.
    pub rest_joints: Vec<[f64; 3]>,
}

/// One frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// The number in the image's file name.
    pub index: u32,
    /// `[3 K]` axis-angle, radians, local to the parent; the root's first.
    pub pose: Vec<f64>,
    /// Joint 0 is at `rest_joints[0] + translation`, metres.
    pub translation: [f64; 3],
    /// Intrinsics, pixels; pixel centres at +0.5.
    pub k: [[f64; 3]; 3],
    /// World to camera, OpenCV axes, metres.
    pub e: [[f64; 4]; 4],
}

/// A [`Violation`] with its location.
pub fn violation(
    code: &str,
    file: &str,
    frame: Option<u32>,
    field: impl Into<String>,
    message: impl Into<String>,
) -> Violation {
    Violation {
        code: code.into(),
        file: file.into(),
        frame,
        field: field.into(),
        message: message.into(),
    }
}

/// One line for people: `poses.json frame 17: pose[41]: NaN is not …`.
pub fn describe(violation: &Violation) -> String {
    let mut text = violation.file.clone();
    if let Some(frame) = violation.frame {
        text += &format!(" frame {frame}");
    }
    if !violation.field.is_empty() {
        text += &format!(": {}", violation.field);
    }
    one_line(&format!("{text}: {}", violation.message), LINE_CHARACTERS)
}

/// Whether a file's name says that it holds protocol buffers.
fn is_binary(name: &str) -> bool {
    name.to_ascii_lowercase().ends_with(".pb")
}

impl PoseTrack {
    /// Reads and checks a pose track: protocol buffers for a file name that ends in `.pb`, JSON
    /// for every other.
    ///
    /// # Errors
    /// All violations, up to a limit; never empty.
    pub fn from_file(name: &str, bytes: &[u8]) -> Result<Self, Vec<Violation>> {
        if is_binary(name) {
            Self::from_binary(bytes)
        } else {
            Self::from_json(bytes)
        }
    }

    /// K.
    pub fn joints(&self) -> usize {
        self.skeleton.parents.len()
    }

    /// Whether the stored images are without distortion, as from a pinhole camera.
    pub fn is_pinhole(&self) -> bool {
        self.distortion == NO_DISTORTION
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track() -> PoseTrack {
        let identity = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
        PoseTrack {
            skeleton: Skeleton {
                names: vec!["root".into(), "tip".into()],
                parents: vec![-1, 0],
                rest_joints: vec![[0.0; 3], [0.0, 1.0, 0.0]],
            },
            image_size: [64, 64],
            fps: 15.0,
            distortion: NO_DISTORTION,
            frames: vec![Frame {
                index: 17,
                pose: vec![0.0; 6],
                translation: [0.0; 3],
                k: [[50.0, 0.0, 32.0], [0.0, 50.0, 32.0], [0.0, 0.0, 1.0]],
                e: std::array::from_fn(|i| std::array::from_fn(|j| identity(i, j))),
            }],
        }
    }

    #[test]
    fn a_good_track_passes_and_survives_json() {
        let json = serde_json::to_vec(&track()).expect("serialises");
        assert_eq!(PoseTrack::from_json(&json), Ok(track()));
        assert_eq!(
            serde_json::from_slice::<PoseTrack>(&json).ok(),
            Some(track())
        );
    }

    #[test]
    fn what_json_does_not_have_is_named_with_its_field() {
        let good = serde_json::to_string(&track()).expect("serialises");
        let pose = "[0.0,0.0,0.0,0.0,0.0,0.0]";
        assert_eq!(good.matches(pose).count(), 1);
        for (number, word) in [
            ("NaN", "NaN is not a number"),
            ("-Infinity", "-Infinity is not a number"),
            ("Infinity", "Infinity is not a number"),
            ("1e999", "number out of range"),
            ("\"1\"", "invalid type: string"),
        ] {
            let bad = good.replace(pose, &format!("[0.0,0.0,{number},0.0,0.0,0.0]"));
            let found = PoseTrack::from_json(bad.as_bytes()).expect_err("is refused");
            let text = describe(&found[0]);
            let expected = format!("poses.json: frames[0].pose[2]: {word}");
            assert!(text.starts_with(&expected), "{text}");
        }
        let found = PoseTrack::from_json(format!("{good} x").as_bytes()).expect_err("has a rest");
        assert!(found[0].message.starts_with("trailing"), "{found:?}");
    }

    #[test]
    fn both_forms_hold_the_same() {
        let mut track = track();
        track.distortion = [0.1, -0.2, 0.001, 0.002, 0.05];
        track.frames.push(Frame {
            index: 18,
            ..track.frames[0].clone()
        });
        let still = track.to_binary();
        assert_eq!(PoseTrack::from_file("a.pb", &still), Ok(track.clone()));
        track.frames[1].k[0][2] += 1.0;
        let moving = track.to_binary();
        assert_eq!(PoseTrack::from_binary(&moving), Ok(track.clone()));
        assert!(moving.len() > still.len());
        let json = serde_json::to_vec(&track).expect("serialises");
        assert_eq!(PoseTrack::from_file("a.json", &json), Ok(track));
    }

    #[test]
    fn what_files_leave_out_is_filled_in() {
        let mut json = serde_json::to_value(track()).expect("serialises");
        let frame = json["frames"][0].as_object_mut().expect("a frame");
        let camera = serde_json::json!({"K": frame.remove("K"), "E": frame.remove("E")});
        let read = |json: &serde_json::Value| PoseTrack::from_json(json.to_string().as_bytes());
        let faults = read(&json).expect_err("no camera");
        let lines: Vec<String> = faults.iter().map(describe).collect();
        assert!(
            lines[0].starts_with("poses.json frame 17: K: neither"),
            "{lines:?}"
        );
        assert!(
            lines[1].starts_with("poses.json frame 17: E: neither"),
            "{lines:?}"
        );
        assert!(serde_json::from_value::<PoseTrack>(json.clone()).is_err());

        json["camera"] = camera;
        assert_eq!(read(&json), Ok(track()));
        // The same camera, counted from the first pixel's centre.
        json["pixel_centre"] = 0.0.into();
        for axis in 0..2 {
            json["camera"]["K"][axis][2] = (31.5).into();
        }
        assert_eq!(read(&json), Ok(track()));
        json["pixel_centre"] = 1.0.into();
        let faults = read(&json).expect_err("no convention");
        assert_eq!(faults[0].field, "pixel_centre");
    }

    #[test]
    fn binary_lists_have_their_lengths() {
        use prost::Message;
        let message = crate::v1::PoseTrack::decode(&track().to_binary()[..]).expect("decodes");
        type Break = fn(&mut crate::v1::PoseTrack);
        let cases: [(Break, &str); 6] = [
            (|m| m.skeleton = None, "poses.pb: skeleton: is missing"),
            (
                |m| m.distortion = vec![0.1; 4],
                "poses.pb: distortion: 4 numbers, 5",
            ),
            (|m| m.intrinsics.truncate(8), "poses.pb: K: 8 numbers, 9"),
            (
                |m| m.frames[0].extrinsics = vec![0.0],
                "poses.pb frame 17: E: 1 numbers",
            ),
            (
                |m| m.frames[0].translation.clear(),
                "poses.pb frame 17: translation: 0",
            ),
            (
                |m| m.frames[0].rotations[1] = 1e30,
                "poses.pb frame 17: pose[1]: 1",
            ),
        ];
        for (break_it, expected) in cases {
            let mut broken = message.clone();
            break_it(&mut broken);
            let faults = PoseTrack::from_binary(&broken.encode_to_vec()).expect_err(expected);
            let line = describe(&faults[0]);
            assert!(line.starts_with(expected), "{expected}: {line}");
        }
        assert!(PoseTrack::from_binary(b"\xff\xff").is_err());
    }

    #[test]
    fn each_fault_names_its_frame_and_field() {
        type Break = fn(&mut PoseTrack);
        let cases: &[(Break, &str)] = &[
            (
                |t| t.frames[0].pose[4] = f64::NAN,
                "poses.json frame 17: pose[4]: NaN",
            ),
            (
                |t| t.frames[0].pose.truncate(5),
                "poses.json frame 17: pose: 5 numbers",
            ),
            (
                |t| t.frames[0].translation[1] = 1e30,
                "poses.json frame 17: translation[1]",
            ),
            (
                |t| t.frames[0].k[1][1] = 0.0,
                "poses.json frame 17: K: focal",
            ),
            (
                |t| t.frames[0].e[0][0] = 2.0,
                "poses.json frame 17: E: the upper 3x3",
            ),
            (
                |t| t.frames[0].e[0][0] = -1.0,
                "poses.json frame 17: E: the upper 3x3 part mirrors",
            ),
            (
                |t| t.frames[0].k[2] = [32.0, 32.0, 1.0],
                "poses.json frame 17: K: the last row",
            ),
            (
                |t| t.frames[0].e[3][1] = 1.0,
                "poses.json frame 17: E: the last row",
            ),
            (
                |t| t.distortion[2] = f64::NAN,
                "poses.json: distortion[2]: NaN",
            ),
            (
                |t| t.skeleton.names[1] = "root".into(),
                "poses.json: skeleton.names[1]: 'root' is also joint 0",
            ),
            (
                |t| t.skeleton.parents = vec![1, 0],
                "poses.json: skeleton.parents[0]: the parents of joints 0 → 1 → 0",
            ),
            (
                |t| t.skeleton.parents[1] = -1,
                "poses.json: skeleton.parents[1]: -1: joint 0",
            ),
            (
                |t| t.frames.push(t.frames[0].clone()),
                "poses.json frame 17: index",
            ),
            (
                |t| t.skeleton.parents[1] = 1,
                "poses.json: skeleton.parents[1]",
            ),
            (|t| t.skeleton.names.clear(), "poses.json: skeleton.names"),
            (|t| t.image_size = [0, 9], "poses.json: image_size"),
            (
                |t| {
                    t.image_size = [8192, 8192];
                    t.frames = (0..300)
                        .map(|index| Frame {
                            index,
                            ..t.frames[0].clone()
                        })
                        .collect();
                },
                "poses.json: image_size: 20132659200 pixels",
            ),
            (|t| t.fps = f64::INFINITY, "poses.json: fps"),
            (|t| t.frames.clear(), "poses.json: frames: 0"),
        ];
        for (break_it, expected) in cases {
            let mut broken = track();
            break_it(&mut broken);
            let found: Vec<String> = broken.check().iter().map(describe).collect();
            assert!(
                found.iter().any(|line| line.starts_with(expected)),
                "{expected}: {found:?}"
            );
        }
    }

    #[test]
    fn broken_json_says_where() {
        let error = PoseTrack::from_json(b"{\n \"fps\": NaN}").expect_err("NaN is not JSON");
        assert!(describe(&error[0]).contains("line 2"), "{error:?}");
    }
}
