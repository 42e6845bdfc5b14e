//! Checks of pose tracks: pure functions that name the frame and the field of each fault.

use super::{
    FILE, Frame, MAX_FRAMES, MAX_JOINTS, MAX_METRES, MAX_PIXELS, MAX_SIDE, PoseTrack, Skeleton,
    violation,
};
use crate::v1::Violation;
use std::collections::{HashMap, HashSet};

/// Most violations reported per capture, since a wrong unit repeats in every frame.
const MAX_VIOLATIONS: usize = 20;
/// Largest distortion coefficient. Coefficients of fish-eye lenses stay below 10.
const MAX_DISTORTION: f64 = 100.0;

/// Collects violations, up to a limit.
pub(super) struct Violations(Vec<Violation>);

impl Violations {
    pub(super) fn new() -> Self {
        Self(Vec::new())
    }

    pub(super) fn into_violations(self) -> Vec<Violation> {
        self.0
    }

    pub(super) fn add(
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
                    format!("{value} is not a finite number"),
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

/// The violations with another file's name.
pub(super) fn located(violations: Vec<Violation>, file: &str) -> Vec<Violation> {
    let at = |violation: Violation| Violation {
        file: file.to_owned(),
        ..violation
    };
    violations.into_iter().map(at).collect()
}

impl PoseTrack {
    /// All violations, with frame and field; empty for a valid track.
    pub fn check(&self) -> Vec<Violation> {
        let mut report = Violations::new();
        self.skeleton.check_into(&mut report);
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
        report.finite(None, "distortion", self.distortion, MAX_DISTORTION);
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
        let mut seen = HashSet::new();
        for frame in &self.frames {
            if !seen.insert(frame.index) {
                report.add(
                    "DUPLICATE",
                    Some(frame.index),
                    "index",
                    "this index is repeated",
                );
            }
            frame.check(self.joints(), &mut report);
        }
        report.0
    }
}

impl Skeleton {
    /// All violations, by field; empty for a valid skeleton.
    pub fn check(&self) -> Vec<Violation> {
        let mut report = Violations::new();
        self.check_into(&mut report);
        report.0
    }

    fn check_into(&self, report: &mut Violations) {
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
        for (field, found, what) in [
            ("names", self.names.len(), "names"),
            ("rest_joints", self.rest_joints.len(), "positions"),
        ] {
            if found != joints {
                report.add(
                    "SIZE_MISMATCH",
                    None,
                    format!("skeleton.{field}"),
                    format!("{found} {what} for {joints} joints"),
                );
            }
        }
        let mut named = HashMap::new();
        for (joint, name) in self.names.iter().enumerate() {
            if let Some(first) = named.insert(name, joint) {
                report.add(
                    "DUPLICATE",
                    None,
                    format!("skeleton.names[{joint}]"),
                    format!("'{name}' is also joint {first}"),
                );
            }
        }
        if let Some(cycle) = self.cycle() {
            let joints: Vec<String> = cycle.iter().map(usize::to_string).collect();
            let (first, path) = (cycle.first().copied(), joints.join(" → "));
            report.add(
                "CYCLE",
                None,
                format!("skeleton.parents[{}]", first.unwrap_or_default()),
                format!("the parents of joints {path} go in a circle"),
            );
            return;
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

    /// Joints of a cycle of parents, with the first joint again at the end.
    fn cycle(&self) -> Option<Vec<usize>> {
        let parent = |joint: usize| {
            let parent = self.parents.get(joint).copied()?;
            usize::try_from(parent).ok()
        };
        (0..self.parents.len()).find_map(|start| {
            let mut path = vec![start];
            let mut at = parent(start)?;
            while at != start {
                if path.len() > self.parents.len() {
                    return None;
                }
                path.push(at);
                at = parent(at)?;
            }
            path.push(start);
            Some(path)
        })
    }
}

impl Frame {
    fn check(&self, joints: usize, report: &mut Violations) {
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
        for (field, last, needed) in [
            ("K", &self.k[2][..], &[0.0, 0.0, 1.0][..]),
            ("E", &self.e[3][..], &[0.0, 0.0, 0.0, 1.0][..]),
        ] {
            let off = |(a, b): (&f64, &f64)| (a - b).abs() > 1e-6;
            if last.iter().zip(needed).any(off) {
                let message =
                    format!("the last row is {last:?}, not {needed:?}: is the matrix transposed?");
                report.add("OUT_OF_RANGE", at, field, message);
            }
        }
        self.check_rotation(report);
    }

    fn check_rotation(&self, report: &mut Violations) {
        let at = Some(self.index);
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
            return;
        }
        let minor = |a: usize, b: usize| r(1, a) * r(2, b) - r(1, b) * r(2, a);
        let volume = r(0, 0) * minor(1, 2) - r(0, 1) * minor(0, 2) + r(0, 2) * minor(0, 1);
        if volume < 0.0 {
            report.add(
                "NOT_A_ROTATION",
                at,
                "E",
                "the upper 3x3 part mirrors: its determinant is -1",
            );
        }
    }
}
