//! The measured settings, as data: an axis is a list of values, and every combination is measured.

use crate::config::Precision;
use crate::render::{RenderSettings, Renderer};

/// Samples per ray, relative to the model's.
const SAMPLES: &[f64] = &[1.0, 0.75, 0.5, 0.25];
/// Likelihoods below which samples are left out, in addition to the model's.
const EPSILONS: &[f32] = &[3e-2];
/// Transmittances below which rays end, in addition to the model's.
const TRANSMITTANCES: &[f32] = &[5e-2];
/// Scales of the resolution.
const SCALES: &[f32] = &[1.0, 0.75, 0.5];
/// Shares of the splats.
const SPLATS: &[f32] = &[1.0, 0.5, 0.25, 0.125];
/// Fewest samples per ray.
const FEWEST_SAMPLES: usize = 8;

/// Values to combine. The first value of each list is the model's.
#[derive(Clone, Debug, PartialEq)]
pub struct Axes {
    /// Samples per ray.
    pub samples: Vec<usize>,
    /// Smallest foreground likelihood.
    pub epsilon: Vec<f32>,
    /// Smallest transmittance at which a ray continues.
    pub min_transmittance: Vec<f32>,
    /// Precision of the factors in the networks.
    pub precision: Vec<Precision>,
    /// Scales of the resolution.
    pub scale: Vec<f32>,
    /// Shares of the splats.
    pub splats: Vec<f32>,
}

impl Axes {
    /// The settings that change what a model's frames cost. Without rays, those are the number of splats and the
    /// resolution.
    pub fn of(renderer: &Renderer) -> Self {
        let own = renderer.settings();
        let all = Self::around(&own, &renderer.precisions());
        if renderer.config().appearance.march().is_some() {
            return all;
        }
        Self {
            samples: vec![own.samples],
            epsilon: vec![own.epsilon],
            min_transmittance: vec![own.min_transmittance],
            precision: vec![own.precision],
            splats: match renderer.has_levels() {
                true => SPLATS.to_vec(),
                false => vec![own.splats],
            },
            ..all
        }
    }

    /// A model's settings and cheaper ones, with the `precisions` that its device supports
    /// ([`crate::render::Renderer::precisions`]).
    pub fn around(own: &RenderSettings, precisions: &[Precision]) -> Self {
        let samples = SAMPLES.iter().map(|share| {
            let fewer = (own.samples as f64 * share).round() as usize;
            fewer.max(FEWEST_SAMPLES).min(own.samples)
        });
        let bounds = |own: f32, others: &[f32]| {
            let coarser = others.iter().copied().filter(|value| *value > own);
            distinct(std::iter::once(own).chain(coarser))
        };
        let others = precisions.iter().copied();
        Self {
            samples: distinct(samples),
            epsilon: bounds(own.epsilon, EPSILONS),
            min_transmittance: bounds(own.min_transmittance, TRANSMITTANCES),
            precision: distinct(std::iter::once(own.precision).chain(others)),
            scale: distinct(SCALES.iter().copied()),
            splats: vec![own.splats],
        }
    }

    /// Every combination; the model's settings come first.
    pub fn settings(&self) -> Vec<RenderSettings> {
        let all = self.samples.iter().map(|&samples| RenderSettings {
            samples,
            epsilon: 0.0,
            min_transmittance: 0.0,
            precision: Precision::F32,
            scale: 1.0,
            splats: 1.0,
        });
        let all = each(all, &self.epsilon, |it, value| it.epsilon = value);
        let all = each(all, &self.min_transmittance, |it, value| {
            it.min_transmittance = value;
        });
        let all = each(all, &self.precision, |it, value| it.precision = value);
        let all = each(all, &self.scale, |it, value| it.scale = value);
        each(all, &self.splats, |it, value| it.splats = value)
    }
}

/// Combines all settings with each value of an axis.
fn each<T: Copy>(
    all: impl IntoIterator<Item = RenderSettings>,
    values: &[T],
    set: fn(&mut RenderSettings, T),
) -> Vec<RenderSettings> {
    let with = |mut settings: RenderSettings, value: T| {
        set(&mut settings, value);
        settings
    };
    all.into_iter()
        .flat_map(|it| values.iter().map(move |value| with(it, *value)))
        .collect()
}

fn distinct<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut kept = Vec::new();
    for value in values {
        if !kept.contains(&value) {
            kept.push(value);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn own(samples: usize) -> RenderSettings {
        RenderSettings {
            samples,
            epsilon: 1e-4,
            min_transmittance: 1e-3,
            precision: Precision::F32,
            scale: 1.0,
            splats: 1.0,
        }
    }

    #[test]
    fn every_combination_is_tried_once_and_the_model_s_own_first() {
        let both = [Precision::F32, Precision::Bf16];
        let settings = Axes::around(&own(64), &both).settings();
        assert_eq!(settings.len(), 4 * 2 * 2 * 2 * 3);
        assert_eq!(settings[0], own(64));
        for (i, one) in settings.iter().enumerate() {
            assert!(!settings[..i].contains(one), "{one:?} twice");
            assert_eq!(one.check(), Ok(()));
        }
    }

    #[test]
    fn nothing_dearer_than_the_model_itself_is_tried() {
        let few = Axes::around(&own(8), &[Precision::F32]);
        assert_eq!(few.precision, [Precision::F32]);
        assert_eq!(few.samples, [8]);
        let coarser = RenderSettings {
            epsilon: 0.02,
            min_transmittance: 0.1,
            ..own(4)
        };
        let coarse = Axes::around(&coarser, &[Precision::F32]);
        assert_eq!(coarse.min_transmittance, [0.1]);
        assert_eq!(
            (coarse.samples, coarse.epsilon),
            (vec![4], vec![0.02, 0.03])
        );
    }
}
