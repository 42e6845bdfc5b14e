//! Options of a caller for reading a capture, besides its file names.

use yoto_proto::correction::Correction;
use yoto_proto::media_plan::{
    BackgroundSetting, EdgeSetting, MaskKind, MaskSource, MediaPlan, Selection, Timing,
};

/// Images to use if a capture has both.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Prefer {
    /// The pictures in `frames/`.
    Images,
    /// The file `video.*`.
    Video,
}

/// Options for reading a capture. Defaults leave the decision to the capture's own
/// `media.json`.
#[derive(Debug, Clone, Default)]
pub struct CaptureOptions {
    /// Pictures or video.
    pub prefer: Option<Prefer>,
    /// Source of the masks.
    pub masks: Option<MaskSource>,
    /// Meaning of mask pictures.
    pub mask_kind: MaskKind,
    /// Background of the person.
    pub background: BackgroundSetting,
    /// Treatment of the masks' edges.
    pub edges: EdgeSetting,
    /// Match of pose frames to frames of a video.
    pub timing: Timing,
    /// Selected frames.
    pub selection: Selection,
    /// Correction of the pose track's numbers.
    pub correction: Correction,
}

impl CaptureOptions {
    /// The options as a plan; the images in use depend on the capture's files.
    pub(super) fn plan(&self) -> MediaPlan {
        MediaPlan {
            images: None,
            masks: self.masks.clone(),
            mask_kind: self.mask_kind,
            background: self.background,
            edges: self.edges,
            timing: self.timing,
            selection: self.selection,
            correction: self.correction,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_goes_before_the_file_and_the_rest_stays() {
        let own = MediaPlan {
            timing: Timing::Time,
            mask_kind: MaskKind::Labels,
            ..MediaPlan::default()
        };
        let said = CaptureOptions {
            masks: Some(MaskSource::Alpha),
            ..CaptureOptions::default()
        };
        let plan = said.plan().over(own);
        assert_eq!(
            (plan.timing, plan.mask_kind),
            (Timing::Time, MaskKind::Labels)
        );
        assert_eq!(plan.masks, Some(MaskSource::Alpha));
    }
}
