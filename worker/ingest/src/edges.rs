//! Treatment of the masks' edges: what is behind a person is learned from some frames before all are read.

use super::capture::Capture;
use super::order::{Progress, Stage};
use super::reader::Reader;
use std::sync::Arc;
use yoto_media::edge::{BackgroundBuilder, KnownBackground};
use yoto_media::video::Ffmpeg;
use yoto_proto::media_plan::{Background, EdgeSetting, MaskSource};

/// A background is learned from at most this number of frames.
const FRAMES: usize = 24;

/// Treatment of the masks' edges.
#[derive(Debug, Clone)]
pub(super) enum Edges {
    /// The edges of the masks.
    Given,
    /// Solved from colours, before this background.
    Solved(Arc<KnownBackground>),
}

impl Edges {
    /// A note about the treatment, for people.
    pub(crate) fn note(&self) -> Option<String> {
        let Self::Solved(known) = self else {
            return None;
        };
        let share = 100.0 * known.share();
        Some(format!(
            "edges: solved from colours; the background is known in {share:.0} % of the picture, elsewhere \
             continued from around the person"
        ))
    }
}

/// How to treat the edges of `capture`'s masks, from some of its frames. Faults are left to the pass that reads all frames.
pub(super) fn learned(capture: &Capture, ffmpeg: &Ffmpeg, tell: &mut dyn FnMut(Progress)) -> Edges {
    let from_pictures = matches!(capture.sources.masks, MaskSource::Pictures(_));
    if capture.plan.edges == EdgeSetting::Given || !from_pictures {
        return Edges::Given;
    }
    let track = &capture.track;
    let step = track.frames.len().div_ceil(FRAMES).max(1);
    let some: Vec<usize> = (0..track.frames.len()).step_by(step).collect();
    let Ok(mut reader) = Reader::open(capture, &some, ffmpeg, tell) else {
        return Edges::Given;
    };
    let mut builder: Option<BackgroundBuilder> = None;
    for (done, &at) in some.iter().enumerate() {
        let (Some(frame), Some(&mask)) = (track.frames.get(at), capture.masks.get(at)) else {
            continue;
        };
        tell(Progress {
            stage: Stage::Decoding,
            file: reader.file_of(frame.index).to_owned(),
            frame: Some(frame.index),
            done,
            total: some.len(),
        });
        let Ok((picture, mask)) = reader.filmed(frame, mask, track.image_size) else {
            return Edges::Given;
        };
        if reader.background(&picture, &mask) == Background::Black {
            return Edges::Given;
        }
        builder
            .get_or_insert_with(|| BackgroundBuilder::new(picture.width, picture.height))
            .add(&picture, &mask);
    }
    builder.map_or(Edges::Given, |it| Edges::Solved(Arc::new(it.finish())))
}
