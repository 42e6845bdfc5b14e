//! Time and fidelity of render settings with one checkpoint, measured on held-out frames.

use super::Pictures;
use crate::jobs::context::id;
use crate::jobs::{JobContext, JobFailure};
use std::time::{SystemTime, UNIX_EPOCH};
use yoto_avatar::render::{RenderView, Renderer};
use yoto_avatar::tradeoff::{Axes, Curve, SweepError, SweepOptions, SweepView, sweep};
use yoto_proto::keys;
use yoto_proto::names::Collection;
use yoto_proto::v1::{ObjectRef, TradeoffSpec};

/// Default number of held-out frames to render with each setting.
const VIEWS: usize = 4;
/// Default number of timed renders of each frame.
const REPEATS: usize = 3;

/// A sweep over the settings around the model's own.
pub(super) struct Sweep {
    options: SweepOptions,
    views: Vec<SweepView>,
}

impl Sweep {
    /// The `wanted` sweep with `renderer` over held-out frames of `people`.
    pub(super) fn new(
        context: &JobContext,
        renderer: &Renderer,
        wanted: &TradeoffSpec,
        people: &[Pictures],
    ) -> Self {
        let or = |asked: u32, default| match asked {
            0 => default,
            asked => asked as usize,
        };
        let options = SweepOptions {
            settings: Axes::of(renderer).settings(),
            repeats: or(wanted.repeats, REPEATS),
            machine: context.device.machine(),
            unix_seconds: SystemTime::now()
                .duration_since(UNIX_EPOCH)
                .map_or(0, |since| since.as_secs()),
        };
        Self {
            views: views(people, or(wanted.views, VIEWS)),
            options,
        }
    }

    /// Number of frames that it renders.
    pub(super) fn frames(&self) -> usize {
        self.options.frames(self.views.len())
    }

    /// Measures; the job has rendered `before` frames already.
    pub(super) fn measure(
        &self,
        context: &JobContext,
        mut renderer: Renderer,
        before: usize,
    ) -> Result<Curve, JobFailure> {
        sweep(&mut renderer, &self.views, &self.options, |done, total| {
            context.check()?;
            context.report_pieces("measuring the trade-off", before + done, before + total);
            Ok(())
        })
    }
}

/// `wanted` held-out frames: one of each person in turn, each person's spread out over their film.
fn views(people: &[Pictures], wanted: usize) -> Vec<SweepView> {
    let counts: Vec<usize> = people.iter().map(|person| person.frames.len()).collect();
    let chosen = chosen(&counts, wanted).into_iter();
    chosen
        .map(|(person, frame)| {
            let (person, picture) = (&people[person], &people[person].frames[frame]);
            SweepView {
                view: RenderView {
                    slot: person.slot,
                    pose: picture.pose.clone(),
                    camera: picture.camera.clone(),
                    background: [0.0; 3],
                },
                truth: Some(picture.image.clone()),
                exposure: picture.exposure,
            }
        })
        .collect()
}

/// Index of the person and of the frame of `wanted` frames, given how many frames each person has.
fn chosen(counts: &[usize], wanted: usize) -> Vec<(usize, usize)> {
    let mut shares = vec![0; counts.len()];
    let mut left = wanted.min(counts.iter().sum());
    while left > 0 {
        for (share, count) in shares.iter_mut().zip(counts) {
            if left > 0 && *share < *count {
                *share += 1;
                left -= 1;
            }
        }
    }
    let people = shares.into_iter().zip(counts).enumerate();
    people
        .flat_map(|(person, (share, count))| (0..share).map(move |i| (person, i * count / share)))
        .collect()
}

/// Stores the curve beside its checkpoint.
pub(super) fn keep(
    context: &JobContext,
    model: &str,
    step: u64,
    curve: &Curve,
) -> Result<ObjectRef, JobFailure> {
    let model_id = id(Collection::Models, model)?;
    let key = keys::tradeoff(model_id, context.job_id()?, context.claim.token, step);
    let json = curve
        .to_json()
        .map_err(|error| JobFailure::failed("INTERNAL", "storing the trade-off", &error))?;
    context.put(&key, json)
}

impl From<SweepError> for JobFailure {
    fn from(error: SweepError) -> Self {
        Self::failed("EVALUATION", "measuring the trade-off", &error)
    }
}

#[cfg(test)]
mod tests {
    use super::chosen;

    #[test]
    fn everybody_is_measured_whatever_the_length_of_their_films() {
        assert_eq!(chosen(&[60, 8], 4), [(0, 0), (0, 30), (1, 0), (1, 4)]);
        assert_eq!(chosen(&[60, 1], 4), [(0, 0), (0, 20), (0, 40), (1, 0)]);
        assert_eq!(chosen(&[2], 4), [(0, 0), (0, 1)]);
        assert_eq!(chosen(&[], 4), []);
    }
}
