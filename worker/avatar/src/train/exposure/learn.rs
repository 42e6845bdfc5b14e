//! The part of a step that learns the exposure of its frame.

use super::{CaptureExposures, fit};
use crate::config::{ExposureConfig, LearnExposure};
use crate::host::read;
use crate::render::FrameExposure;
use crate::train::TrainError;
use crate::train::model::Model;
use crate::train::people::{TrainFrame, TrainSubject};
use burn::tensor::Tensor;
use tracing::trace_span;
use yoto_capture::FrameImage;
use yoto_proto::pose_track::PoseTrack;

/// Exposures of the film with `track`, which go on from those `known`; none where they are not learned.
pub(in crate::train) fn begin(
    config: &ExposureConfig,
    track: &PoseTrack,
    known: Option<CaptureExposures>,
) -> Option<CaptureExposures> {
    if config.who == LearnExposure::Never {
        return None;
    }
    let mut exposures = known
        .filter(|known| known.is_of(track))
        .unwrap_or_else(|| CaptureExposures::new(track, config.who));
    if config.who == LearnExposure::Always {
        exposures.heeded = Some(true);
    }
    Some(exposures)
}

/// `picture` `[H W, 4]` of colours over black and opacity in an exposure.
pub(in crate::train) fn apply_exposure(picture: Tensor<2>, exposure: &FrameExposure) -> Tensor<2> {
    if *exposure == FrameExposure::NEUTRAL {
        return picture;
    }
    let row = |[r, g, b]: [f32; 3], alpha: f32| {
        Tensor::<1>::from_floats([r, g, b, alpha], &picture.device()).unsqueeze::<2>()
    };
    let (gain, offset) = (row(exposure.gain, 1.0), row(exposure.offset, 0.0));
    let alpha = picture.clone().narrow(1, 3, 1);
    picture * gain + alpha * offset
}

/// The exposure to compare a frame in, and what was found of the film's, for people.
pub(in crate::train) struct FittedExposure {
    pub exposure: FrameExposure,
    pub note: Option<String>,
}

/// Fits the exposure of a `frame`, which shows `image`, to the model's `picture` of it, `[H W, 4]`, after the
/// completed fraction `schedule_progress` of the model's run.
pub(in crate::train) fn fit_exposure(
    model: &mut Model,
    subject: &TrainSubject,
    frame: &TrainFrame,
    schedule_progress: f64,
    image: &FrameImage,
    picture: &Tensor<2>,
) -> Result<FittedExposure, TrainError> {
    let config = &model.config.exposure;
    let Some(exposures) = &mut model.state.exposures[subject.slot] else {
        return Ok(FittedExposure {
            exposure: FrameExposure::NEUTRAL,
            note: None,
        });
    };
    let mut note = None;
    // A film whose exposures were found to be alike stays so.
    if schedule_progress >= config.start && exposures.heeded != Some(false) {
        let _span = trace_span!("exposure").entered();
        let picture = read(picture.clone().detach())?;
        if let Some(found) = fit::exposure(&picture, image, config) {
            exposures.take(frame.position, &found, config.share);
        }
        if let Some(spread) = exposures.decide(config, schedule_progress, subject.frames.len()) {
            let then = match exposures.heeded {
                Some(true) => "exposures are learned",
                _ => "all are taken to be exposed alike",
            };
            let (name, percent) = (&subject.name, 100.0 * spread);
            note = Some(format!(
                "{name}: the exposure of frames differs by {percent:.1} %: {then}"
            ));
        }
    }
    Ok(FittedExposure {
        exposure: exposures.of(frame.position),
        note,
    })
}

/// The exposure of the frame with this `index` of the film of the person in `slot`, as
/// [`CaptureExposures::near`] tells it; neutral where exposures are not learned.
pub(in crate::train) fn near(
    all: &[Option<CaptureExposures>],
    slot: usize,
    index: u32,
) -> FrameExposure {
    let exposures = all.get(slot).and_then(Option::as_ref);
    exposures.map_or(FrameExposure::NEUTRAL, |exposures| exposures.near(index))
}
