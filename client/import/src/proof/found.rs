//! The result of the readers of pose tools: people, frame by frame, in the numbers of the tool.

use super::camera_pose::CameraPose;
use crate::geometry::{Mat3, Vec3, rodrigues, sub};
use crate::identities::{PersonTrack, joined};
use crate::track::SmplPose;
use std::sync::Arc;
use yoto_formats::rle::RunLengths;
use yoto_proto::pose_track::NO_DISTORTION;

/// Intrinsics that a file has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Intrinsics {
    /// Pixels.
    pub focal: [f64; 2],
    /// Principal point, pixels from the first pixel's centre; the image's middle if absent.
    pub centre: Option<[f64; 2]>,
    /// Width and height of the images that it belongs to, if the file says.
    pub size: Option<[f64; 2]>,
    /// Share of the clip's width and height that margins around its images add to these.
    pub margin: f64,
}

impl Intrinsics {
    /// Intrinsics from a 3×3 matrix, rows first; its principal point is the image's middle.
    pub(crate) fn of_middle(k: &[f64; 9]) -> Self {
        Self {
            focal: [k[0], k[4]],
            centre: Some([k[2], k[5]]),
            size: Some([2.0 * k[2], 2.0 * k[5]]),
            margin: 0.0,
        }
    }
}

/// A tool's estimate of a person in one frame.
#[derive(Clone, Debug)]
pub(crate) struct PoseEstimate {
    /// Frame of the tool's clip, from 0.
    pub number: usize,
    /// The picture's name, if the file has it.
    pub image: Option<String>,
    /// The root's rotation is in the camera's axes (or in the world's, with `e`).
    pub pose: SmplPose,
    /// Translation, in the meaning of the tool.
    pub t: Vec3,
    pub betas: Vec<f64>,
    /// Posed joints by SMPL's number, metres, before the translation.
    pub joints: Vec<(usize, Vec3)>,
    pub mask: Option<Arc<RunLengths>>,
    pub intrinsics: Option<Intrinsics>,
    /// World to camera; `None` where the body is in the camera's axes.
    pub e: Option<[[f64; 4]; 4]>,
    /// The camera's pose in the world, where the body is in the camera's axes and the camera moves.
    pub camera_pose: Option<CameraPose>,
}

impl PoseEstimate {
    /// With the parts that every tool has.
    pub(crate) fn new(number: usize, pose: SmplPose, t: Vec3, betas: Vec<f64>) -> Self {
        Self {
            number,
            image: None,
            pose,
            t,
            betas,
            joints: Vec::new(),
            mask: None,
            intrinsics: None,
            e: None,
            camera_pose: None,
        }
    }

    /// The root's rotation.
    pub(crate) fn root(&self) -> Mat3 {
        rodrigues([self.pose[0], self.pose[1], self.pose[2]])
    }
}

/// A person of a clip.
#[derive(Clone, Debug)]
pub(crate) struct TrackedPerson {
    /// The tool's number or name.
    pub name: String,
    /// In the order of their frames.
    pub seen: Vec<PoseEstimate>,
}

/// The contents of a tool's files.
#[derive(Clone, Debug)]
pub(crate) struct ToolOutput {
    pub people: Vec<TrackedPerson>,
    /// Frames of the tool's clip, if the files say.
    pub frames: Option<usize>,
    /// Width and height of the tool's clip, if the files say.
    pub size: Option<[f64; 2]>,
    /// OpenCV's k1 k2 p1 p2 k3 of the clip.
    pub distortion: [f64; 5],
    /// The tool's other ids of people who were joined, with the name that each goes by.
    pub other_ids: Vec<(String, String)>,
    /// Masks of all people together, by frame.
    pub masks: Vec<(usize, Arc<RunLengths>)>,
    pub notes: Vec<String>,
}

/// Largest motion at once and per frame, metres, and as a share of the distance from the camera, which one camera finds only
/// roughly.
const MOTION: [f64; 3] = [0.3, 0.1, 0.1];

impl PersonTrack for TrackedPerson {
    fn name(&self) -> &str {
        &self.name
    }

    fn ends(&self) -> Option<[usize; 2]> {
        Some([self.seen.first()?.number, self.seen.last()?.number])
    }

    fn distance(&self, next: &Self, gap: usize) -> f64 {
        let (Some(a), Some(b)) = (self.seen.last(), next.seen.first()) else {
            return f64::INFINITY;
        };
        let [x, y, z] = sub(b.t, a.t);
        let [at_once, per_frame, of_depth] = MOTION;
        let allowed = at_once + per_frame * gap as f64;
        // Depth is coarse: the motion along the view may be larger.
        (x.hypot(y) / allowed).max(z.abs() / (allowed + of_depth * a.t[2].abs()))
    }

    fn append(&mut self, next: Self) {
        self.seen.extend(next.seen);
    }

    fn frames(&self) -> usize {
        self.seen.len()
    }
}

impl ToolOutput {
    /// Joins the tracks of a person whom the tool lost and found again; each with a note.
    pub(crate) fn joined(&self, notes: &mut Vec<String>) -> Self {
        let people = joined(self.people.clone(), notes);
        let has = |person: &TrackedPerson, number: usize, t: Vec3| {
            person
                .seen
                .iter()
                .any(|it| it.number == number && it.t == t)
        };
        let lost = self
            .people
            .iter()
            .filter(|it| people.iter().all(|one| one.name != it.name));
        let other_ids = lost.filter_map(|lost| {
            let first = lost.seen.first()?;
            let person = people.iter().find(|one| has(one, first.number, first.t))?;
            Some((lost.name.clone(), person.name.clone()))
        });
        Self {
            other_ids: other_ids.collect(),
            people,
            ..self.clone()
        }
    }

    pub(crate) fn of(people: Vec<TrackedPerson>) -> Self {
        Self {
            people,
            frames: None,
            size: None,
            distortion: NO_DISTORTION,
            other_ids: Vec::new(),
            masks: Vec::new(),
            notes: Vec::new(),
        }
    }
}
