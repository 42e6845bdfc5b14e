//! A pose track, read according to its capture's plan.

use super::{FILE, MediaPlan};
use crate::pose_track::{PoseTrack, violation};
use crate::smpl;
use crate::v1::Violation;

/// A pose track after corrections and selection, with the mask of each frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// The selected frames, by rising index.
    pub track: PoseTrack,
    /// Index of each frame's mask: the frame's own, unless masks are shifted.
    pub masks: Vec<u32>,
    /// Notes for people on what was unified or left out.
    pub notes: Vec<String>,
}

impl MediaPlan {
    /// Reads the pose track in the file called `name`, corrects it, checks it, and keeps the
    /// selected frames. Corrections come before the check, since lengths in millimetres are
    /// out of range, and before the selection, since shifts count frames of the video. Joints of
    /// SMPL's tree get SMPL's names ([`smpl::unify`]).
    ///
    /// # Errors
    /// All faults of the track and of its corrections; never empty.
    pub fn track(&self, name: &str, bytes: &[u8]) -> Result<Planned, Vec<Violation>> {
        let correction = &self.correction;
        let mut track = if correction.is_identity() {
            PoseTrack::from_file(name, bytes)?
        } else {
            PoseTrack::from_file_unchecked(name, bytes)?
        };
        track.frames.sort_by_key(|frame| frame.index);
        let corrected = correction.apply(&track).map_err(|error| {
            let message = error.to_string();
            vec![violation(
                "NOT_CORRECTABLE",
                FILE,
                None,
                "correction",
                message,
            )]
        })?;
        if !correction.is_identity() {
            let mut violations = corrected.track.check();
            if !violations.is_empty() {
                for found in &mut violations {
                    name.clone_into(&mut found.file);
                }
                return Err(violations);
            }
        }
        let mut track = corrected.track;
        let mut notes: Vec<String> = smpl::unify(&mut track).into_iter().collect();
        notes.extend(self.beyond_last(&track));
        let (frames, masks) = std::mem::take(&mut track.frames)
            .into_iter()
            .zip(corrected.sources)
            .filter(|(frame, _)| self.selection.takes(frame.index))
            .map(|(frame, source)| (frame, source.mask))
            .unzip();
        track.frames = frames;
        if track.frames.is_empty() {
            let message = "none of the pose track's frames is selected";
            return Err(vec![violation("EMPTY", FILE, None, "selection", message)]);
        }
        Ok(Planned {
            track,
            masks,
            notes,
        })
    }

    /// A note about a selection that ends after the last frame of `track`.
    fn beyond_last(&self, track: &PoseTrack) -> Option<String> {
        let last = track.frames.last()?.index;
        let end = self
            .selection
            .end
            .filter(|&end| end > last.saturating_add(1))?;
        Some(format!(
            "frames up to {end} are asked for, but the last pose is of frame {last}: frames end there"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correction::{Correction, Unit, Units};
    use crate::media_plan::Selection;
    use crate::pose_track::{self, Frame, Skeleton, describe};

    /// Frames 4, 1, 2, 3 of one joint, 2500 from the camera.
    fn file() -> Vec<u8> {
        let frame = |index| Frame {
            index,
            pose: vec![0.0; 3],
            translation: [0.0; 3],
            k: [[9.0, 0.0, 4.0], [0.0, 9.0, 4.0], [0.0, 0.0, 1.0]],
            e: [
                [1.0, 0.0, 0.0, 0.0],
                [0.0, 1.0, 0.0, 0.0],
                [0.0, 0.0, 1.0, 25_000.0],
                [0.0, 0.0, 0.0, 1.0],
            ],
        };
        let track = PoseTrack {
            skeleton: Skeleton {
                names: vec!["root".into()],
                parents: vec![-1],
                rest_joints: vec![[0.0; 3]],
            },
            image_size: [8, 8],
            fps: 15.0,
            distortion: pose_track::NO_DISTORTION,
            frames: [4, 1, 2, 3].map(frame).to_vec(),
        };
        serde_json::to_vec(&track).expect("writes")
    }

    #[test]
    fn frames_are_sorted_corrected_and_then_selected() {
        let mut plan = MediaPlan::default();
        let faults = plan.track("poses.json", &file()).expect_err("25 km away");
        assert!(
            describe(&faults[0]).starts_with("poses.json frame 4: E"),
            "{faults:?}"
        );
        plan.correction = Correction {
            units: Units::all(Unit::Millimetre),
            mask_shift: 1,
            ..Correction::default()
        };
        plan.selection = Selection {
            first: 1,
            every: 2,
            end: None,
        };
        let json = serde_json::to_string(&plan).expect("writes");
        let plan: MediaPlan = serde_json::from_str(&json).expect("reads");
        let planned = plan.track("poses.json", &file()).expect("25 m away");
        let indices: Vec<u32> = planned.track.frames.iter().map(|it| it.index).collect();
        assert_eq!((indices, planned.masks), (vec![1, 3], vec![2, 4]));
        assert!((planned.track.frames[0].e[2][3] - 25.0).abs() < 1e-9);
        assert_eq!(planned.notes, [""; 0]);
    }

    #[test]
    fn a_selection_beyond_the_last_pose_is_told() {
        let mut plan = MediaPlan::default();
        plan.correction.units = Units::all(Unit::Millimetre);
        let notes = |plan: &MediaPlan| plan.track("poses.json", &file()).map(|it| it.notes);
        plan.selection.end = Some(5);
        assert_eq!(notes(&plan), Ok(vec![]), "frame 4 is the last");
        plan.selection.end = Some(6);
        let told =
            "frames up to 6 are asked for, but the last pose is of frame 4: frames end there";
        assert_eq!(notes(&plan), Ok(vec![told.to_owned()]));
    }

    #[test]
    fn what_leaves_nothing_is_said() {
        let field = |plan: &MediaPlan| {
            let faults = plan.track("poses.json", &file()).expect_err("nothing left");
            (faults[0].code.clone(), faults[0].field.clone())
        };
        let mut plan = MediaPlan::default();
        plan.correction.units = Units::all(Unit::Metre);
        plan.correction.mask_shift = 4;
        assert_eq!(
            field(&plan),
            ("NOT_CORRECTABLE".into(), "correction".into())
        );
        plan.correction.mask_shift = 0;
        plan.correction.units = Units::all(Unit::Centimetre);
        plan.selection.first = 9;
        assert_eq!(field(&plan), ("EMPTY".into(), "selection".into()));
    }
}
