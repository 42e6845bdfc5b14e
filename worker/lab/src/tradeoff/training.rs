//! Training and measurement of one tier with one budget.

use super::TradeoffOptions;
use crate::captures::Recording;
use crate::display::Screen;
use crate::training::{self, checkpoint_bytes, lpips};
use crate::{measure, memory};
use yoto_avatar::config::ModelConfig;
use yoto_avatar::evaluate::{Examiner, Protocol, SplitScores};
use yoto_avatar::render::Renderer;
use yoto_avatar::tradeoff::Trained;
use yoto_avatar::train::{Budget, Trainer};
use yoto_device::PickedDevice;

/// The variant for comparisons of tiers.
const VARIANT: &str = "yoto";

/// State shared by all trainings.
pub(super) struct Session<'a> {
    pub options: &'a TradeoffOptions,
    pub screen: &'a dyn Screen,
    pub protocol: &'static Protocol,
    pub picked: &'a PickedDevice,
}

impl Session<'_> {
    /// Trains `tier` for `seconds` on `recordings`, and sets poses and exposures of their held-out frames to the learned
    /// ones of neighbouring frames. Returns the results and the model.
    pub(super) fn train(
        &self,
        tier: &str,
        seconds: f64,
        recordings: &mut [Recording],
    ) -> anyhow::Result<(Trained, Renderer)> {
        let config = ModelConfig::named(tier, VARIANT)?;
        let counted = memory::reset_peak();
        if let Err(error) = &counted {
            self.screen.note(&format!(
                "peak memory is not measured: /proc/self/clear_refs: {error}"
            ));
        }
        let people = recordings.iter().enumerate();
        let people = people.map(|(slot, recording)| recording.person(slot));
        let budget = Budget::Seconds(seconds);
        let weights = self.options.lpips.as_ref();
        let options = training::options(budget, self.options.size, self.options.seed, weights);
        let mut trainer = Trainer::new(config, options, people.collect(), &self.picked.device)?;
        let mut display = self.screen.begin(&format!("training, {tier}, {seconds} s"));
        training::train_to_the_end(&mut trainer, &mut *display)?;
        let peak_memory_bytes = counted.ok().and_then(|()| memory::peak());
        let progress = trainer.progress();
        for (slot, recording) in recordings.iter_mut().enumerate() {
            recording.follow(&trainer, slot);
        }
        let examiner = Examiner::new(
            trainer.renderer(),
            self.protocol,
            lpips(weights, self.picked)?,
        );
        let mut subjects = Vec::new();
        for (slot, recording) in recordings.iter().enumerate() {
            let pictures = self.options.pictures;
            let subject =
                measure::subject(&examiner, slot, recording, pictures, None, &mut *display)?;
            subjects.push(subject);
        }
        let scores = SplitScores::mean(&subjects);
        let psnr = scores.novel_view.psnr;
        display.finish(&format!("{} steps, {psnr:.2} dB", progress.step));
        let trained = Trained {
            tier: tier.to_owned(),
            budget_seconds: seconds,
            train_seconds: progress.train_seconds,
            steps: progress.step,
            parameters: trainer.parameters(),
            checkpoint_bytes: checkpoint_bytes(&trainer)?,
            peak_memory_bytes,
            objective: progress.objective.to_owned(),
            scores,
        };
        Ok((trained, examiner.into_renderer()))
    }
}
