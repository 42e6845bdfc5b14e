//! Options for reading a capture's pictures and masks.

use crate::args::frame_range::FrameRange;
use clap::{Args, ValueEnum};
use std::path::Path;
use yoto_import::capture_dir::{CaptureOptions, Prefer};
use yoto_proto::correction::Correction;
use yoto_proto::media_plan::{
    BackgroundSetting, EdgeSetting, MaskKind, MaskSource, PICTURE_ENDINGS, Selection, Timing,
    has_ending,
};

/// Options for reading a capture where file names are not enough.
#[derive(Debug, Args)]
pub(crate) struct MediaArgs {
    /// Images to use if the capture has both frames/ and a video [default: frames/].
    #[arg(long, value_enum, value_name = "KIND")]
    frames: Option<Images>,
    /// Source of the masks: a folder, a video, a picture of the empty background, or 'alpha'.
    #[arg(long, value_name = "NAME")]
    masks: Option<String>,
    /// Meaning of mask pictures: coverage 0 to 255, the same inverted, or labels, of which all but 0
    /// are the person.
    #[arg(long, value_enum, value_name = "KIND", default_value = "coverage")]
    mask_kind: MaskValues,
    /// Background of the images; detected by default.
    #[arg(long, value_enum, value_name = "WHAT", default_value = "auto")]
    background: Around,
    /// Edges of the masks: auto solves them from the pictures' colours if the background is a scene; given keeps them.
    #[arg(long, value_enum, value_name = "HOW", default_value = "auto")]
    edges: Edges,
    /// How poses are matched to frames of a video: by number, or by time (for variable frame rates).
    #[arg(long, value_enum, value_name = "HOW", default_value = "index")]
    timing: By,
    /// Use every n-th pose frame.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
    /// Use every STEP-th pose frame from A on and below B, e.g. 100..400 or ..90:3. Each of the three may be left
    /// out.
    #[arg(long, value_name = "A..B:STEP")]
    range: Option<FrameRange>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Images {
    Images,
    Video,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum MaskValues {
    Coverage,
    Inverted,
    Labels,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Around {
    Auto,
    Black,
    Scene,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Edges {
    Auto,
    Given,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum By {
    Index,
    Time,
}

impl MediaArgs {
    /// Masks of a clip, for its import.
    pub(crate) fn masks(&self) -> Option<&Path> {
        self.masks.as_deref().map(Path::new)
    }

    /// The options in the library's type, with the correction of the track's numbers.
    pub(crate) fn options(&self, correction: Correction) -> CaptureOptions {
        let masks = self.masks.as_ref().map(|name| match name.as_str() {
            "alpha" => MaskSource::Alpha,
            name if has_ending(name, &PICTURE_ENDINGS) => MaskSource::Plate(name.to_owned()),
            name => MaskSource::Pictures(name.to_owned()),
        });
        let range = self.range.unwrap_or(FrameRange::ALL);
        CaptureOptions {
            prefer: self.frames.map(|images| match images {
                Images::Images => Prefer::Images,
                Images::Video => Prefer::Video,
            }),
            masks,
            mask_kind: match self.mask_kind {
                MaskValues::Coverage => MaskKind::Coverage,
                MaskValues::Inverted => MaskKind::Inverted,
                MaskValues::Labels => MaskKind::Labels,
            },
            background: match self.background {
                Around::Auto => BackgroundSetting::Auto,
                Around::Black => BackgroundSetting::Black,
                Around::Scene => BackgroundSetting::Scene,
            },
            edges: match self.edges {
                Edges::Auto => EdgeSetting::Auto,
                Edges::Given => EdgeSetting::Given,
            },
            timing: match self.timing {
                By::Index => Timing::Index,
                By::Time => Timing::Time,
            },
            selection: Selection {
                first: range.first,
                end: (range.end != FrameRange::ALL.end).then_some(range.end),
                every: self.every.saturating_mul(range.step),
            },
            correction,
        }
    }
}
