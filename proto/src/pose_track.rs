//! The pose track: who stands how in each frame, and seen by which camera.
//!
//! One JSON schema for every reader, checked by [`PoseTrack::check`] on both sides: by the
//! client before it uploads a byte, by the ingest job before it decodes one. A check names
//! the frame and the field, since "invalid poses" helps nobody with 10,000 frames.

use crate::v1::Violation;
use serde::{Deserialize, Serialize};

/// The file name of the pose track inside a capture.
pub const FILE: &str = "poses.json";
/// Frames of one capture, at most.
pub const MAX_FRAMES: usize = 100_000;
/// Joints of a skeleton, at most.
pub const MAX_JOINTS: usize = 256;
/// Longest image side, pixels.
pub const MAX_SIDE: u32 = 8192;
/// Pixels of all frames together, at most: what they decode to must fit somewhere.
pub const MAX_PIXELS: u64 = 1 << 34;
/// Farthest a person or camera may stand from the origin, metres. Farther is a unit error.
pub const MAX_METRES: f64 = 1e4;
/// Most violations reported of one capture; a wrong unit repeats in every frame.
const MAX_VIOLATIONS: usize = 20;

/// `poses.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PoseTrack {
    /// The joint tree.
    pub skeleton: Skeleton,
    /// Width and height of the stored images, pixels.
    pub image_size: [u32; 2],
    /// Frames a second.
    pub fps: f64,
    /// One entry a frame.
    pub frames: Vec<Frame>,
}

/// Joint names, parents and rest (T-pose) positions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Skeleton {
    /// K names.
    pub names: Vec<String>,
    /// K parents, each smaller than its child; the root has -1.
    pub parents: Vec<i32>,
    /// `[K, 3]`, metres.
    pub rest_joints: Vec<[f64; 3]>,
}

/// One frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Number in the image's file name.
    pub index: u32,
    /// `[3 K]` axis-angle, radians, local to the parent; the root's first.
    pub pose: Vec<f64>,
    /// Joint 0 stands at `rest_joints[0] + translation`, metres.
    pub translation: [f64; 3],
    /// Intrinsics, pixels; pixel centres at +0.5.
    #[serde(rename = "K")]
    pub k: [[f64; 3]; 3],
    /// World to camera, OpenCV axes, metres.
    #[serde(rename = "E")]
    pub e: [[f64; 4]; 4],
}

/// Collects what is wrong, up to a limit.
struct Report(Vec<Violation>);

impl Report {
    fn add(
        &mut self,
        code: &str,
        frame: Option<u32>,
        field: impl Into<String>,
        message: impl Into<String>,
    ) {
        if self.0.len() < MAX_VIOLATIONS {
            self.0.push(violation(code, FILE, frame, field, message));
        }
    }

    fn finite(
        &mut self,
        frame: Option<u32>,
        field: &str,
        values: impl IntoIterator<Item = f64>,
        limit: f64,
    ) {
        for (i, value) in values.into_iter().enumerate() {
            if !value.is_finite() {
                self.add(
                    "NOT_FINITE",
                    frame,
                    format!("{field}[{i}]"),
                    format!("{value} is not a number one can compute with"),
                );
                return;
            }
            if value.abs() > limit {
                self.add(
                    "OUT_OF_RANGE",
                    frame,
                    format!("{field}[{i}]"),
                    format!("{value} is beyond ±{limit}"),
                );
                return;
            }
        }
    }
}

/// A [`Violation`] with its place.
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
    format!("{text}: {}", violation.message)
}

impl PoseTrack {
    /// Reads and checks a pose track.
    ///
    /// # Errors
    /// Everything that is wrong with it, up to a limit; never empty.
    pub fn from_json(bytes: &[u8]) -> Result<Self, Vec<Violation>> {
        // serde_json reads NaN and 1e999 as syntax or range errors with a line and column.
        let track: Self = serde_json::from_slice(bytes).map_err(|error| {
            vec![violation(
                "UNREADABLE",
                FILE,
                None,
                format!("line {} column {}", error.line(), error.column()),
                error.to_string(),
            )]
        })?;
        let violations = track.check();
        if violations.is_empty() {
            Ok(track)
        } else {
            Err(violations)
        }
    }

    /// K.
    pub fn joints(&self) -> usize {
        self.skeleton.parents.len()
    }

    /// What is wrong, with frame and field; empty when nothing is.
    pub fn check(&self) -> Vec<Violation> {
        let mut report = Report(Vec::new());
        self.skeleton.check(&mut report);
        let [width, height] = self.image_size;
        if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
            report.add(
                "OUT_OF_RANGE",
                None,
                "image_size",
                format!("{width}x{height}: each side must be 1 to {MAX_SIDE}"),
            );
        }
        if !(self.fps.is_finite() && self.fps > 0.0 && self.fps <= 1000.0) {
            report.add(
                "OUT_OF_RANGE",
                None,
                "fps",
                format!("{} is not between 0 and 1000", self.fps),
            );
        }
        if self.frames.is_empty() || self.frames.len() > MAX_FRAMES {
            report.add(
                "OUT_OF_RANGE",
                None,
                "frames",
                format!(
                    "{} frames: 1 to {MAX_FRAMES} are allowed",
                    self.frames.len()
                ),
            );
            return report.0;
        }
        let pixels = self.frames.len() as u64 * u64::from(width) * u64::from(height);
        if pixels > MAX_PIXELS {
            report.add(
                "OUT_OF_RANGE",
                None,
                "image_size",
                format!("{pixels} pixels in all frames: at most {MAX_PIXELS} are allowed"),
            );
        }
        let mut seen = std::collections::HashSet::new();
        for frame in &self.frames {
            if !seen.insert(frame.index) {
                report.add(
                    "DUPLICATE",
                    Some(frame.index),
                    "index",
                    "this index stands twice",
                );
            }
            frame.check(self.joints(), &mut report);
        }
        report.0
    }
}

impl Skeleton {
    fn check(&self, report: &mut Report) {
        let joints = self.parents.len();
        if joints == 0 || joints > MAX_JOINTS {
            report.add(
                "OUT_OF_RANGE",
                None,
                "skeleton.parents",
                format!("{joints} joints: 1 to {MAX_JOINTS} are allowed"),
            );
            return;
        }
        if self.names.len() != joints {
            report.add(
                "SIZE_MISMATCH",
                None,
                "skeleton.names",
                format!("{} names for {joints} joints", self.names.len()),
            );
        }
        if self.rest_joints.len() != joints {
            report.add(
                "SIZE_MISMATCH",
                None,
                "skeleton.rest_joints",
                format!("{} positions for {joints} joints", self.rest_joints.len()),
            );
        }
        for (joint, &parent) in self.parents.iter().enumerate() {
            let valid = if joint == 0 {
                parent == -1
            } else {
                parent >= 0 && (parent as usize) < joint
            };
            if !valid {
                report.add("BAD_TREE", None, format!("skeleton.parents[{joint}]"),
                    format!("{parent}: joint 0 is the root (-1), every other joint comes after its parent"));
                return;
            }
        }
        report.finite(
            None,
            "skeleton.rest_joints",
            self.rest_joints.iter().flatten().copied(),
            MAX_METRES,
        );
    }
}

impl Frame {
    fn check(&self, joints: usize, report: &mut Report) {
        let at = Some(self.index);
        if self.pose.len() != 3 * joints {
            report.add(
                "SIZE_MISMATCH",
                at,
                "pose",
                format!(
                    "{} numbers, {joints} joints need {}",
                    self.pose.len(),
                    3 * joints
                ),
            );
        }
        report.finite(at, "pose", self.pose.iter().copied(), 1e3);
        report.finite(at, "translation", self.translation, MAX_METRES);
        report.finite(at, "K", self.k.into_iter().flatten(), 1e7);
        report.finite(at, "E", self.e.into_iter().flatten(), MAX_METRES);
        if !(self.k[0][0] > 0.0 && self.k[1][1] > 0.0) {
            report.add("OUT_OF_RANGE", at, "K", "focal lengths must be above 0");
        }
        let r = |i: usize, j: usize| self.e[i][j];
        let worst = (0..3)
            .flat_map(|i| (0..3).map(move |j| (i, j)))
            .map(|(i, j)| {
                let dot: f64 = (0..3).map(|k| r(i, k) * r(j, k)).sum();
                (dot - if i == j { 1.0 } else { 0.0 }).abs()
            })
            .fold(0.0, f64::max);
        if worst > 1e-3 {
            report.add(
                "NOT_A_ROTATION",
                at,
                "E",
                format!("the upper 3x3 part is off orthonormal by {worst:.3}"),
            );
        }
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
        let error = PoseTrack::from_json(b"{\n \"fps\": NaN}").expect_err("NaN is no JSON");
        assert!(describe(&error[0]).contains("line 2"), "{error:?}");
    }
}
