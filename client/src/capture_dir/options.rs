//! What a caller may say of a capture beyond what its files' names tell.

use yoto_proto::correction::Correction;
use yoto_proto::media_plan::{
    BackgroundSetting, MaskKind, MaskSource, MediaPlan, Selection, Timing,
};

/// Which images to take where a capture has both.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Prefer {
    /// The pictures in `frames/`.
    Images,
    /// The file `video.*`.
    Video,
}

/// How to read a capture. What is left as it is by default, the capture's own `media.json`
/// says.
#[derive(Debug, Clone, Default)]
pub struct CaptureOptions {
    /// Pictures or video.
    pub prefer: Option<Prefer>,
    /// What says where the person is.
    pub masks: Option<MaskSource>,
    /// What mask pictures mean.
    pub mask_kind: MaskKind,
    /// What stands around the person.
    pub background: BackgroundSetting,
    /// How pose frames find their frame of a video.
    pub timing: Timing,
    /// Which frames to take.
    pub selection: Selection,
    /// How the pose track's numbers are to be read.
    pub correction: Correction,
}

impl CaptureOptions {
    /// The same as a plan; which images go before others depends on what the capture has.
    pub(super) fn plan(&self) -> MediaPlan {
        MediaPlan {
            images: None,
            masks: self.masks.clone(),
            mask_kind: self.mask_kind,
            background: self.background,
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
