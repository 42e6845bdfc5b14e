//! Which settings are tried, as data: an axis is a list of values, and every combination is
//! measured.

use crate::render::RenderSettings;

/// Shares of a model's own samples a ray.
const SAMPLES: &[f64] = &[1.0, 0.75, 0.5, 0.25];
/// Likelihoods beside the model's own under which a sample is left out (model.md §11).
const EPSILONS: &[f32] = &[1e-2, 5e-2];
/// Shares of the resolution.
const SCALES: &[f32] = &[1.0, 0.75, 0.5];
/// Fewest samples a ray worth trying.
const FEWEST_SAMPLES: usize = 8;

/// Values to combine, each list's first the model's own.
#[derive(Clone, Debug, PartialEq)]
pub struct Axes {
    /// Samples a ray.
    pub samples: Vec<usize>,
    /// Least foreground likelihood.
    pub epsilon: Vec<f32>,
    /// Shares of the resolution.
    pub scale: Vec<f32>,
}

impl Axes {
    /// The values worth trying around a model's own settings: cheaper ones only.
    pub fn around(own: &RenderSettings) -> Self {
        let samples = SAMPLES.iter().map(|share| {
            let fewer = (own.samples as f64 * share).round() as usize;
            fewer.max(FEWEST_SAMPLES).min(own.samples)
        });
        let coarser = EPSILONS
            .iter()
            .copied()
            .filter(|value| *value > own.epsilon);
        Self {
            samples: distinct(samples),
            epsilon: distinct(std::iter::once(own.epsilon).chain(coarser)),
            scale: distinct(SCALES.iter().copied()),
        }
    }

    /// Every combination; the model's own settings come first.
    pub fn settings(&self) -> Vec<RenderSettings> {
        let mut all = Vec::new();
        for &samples in &self.samples {
            for &epsilon in &self.epsilon {
                for &scale in &self.scale {
                    all.push(RenderSettings {
                        samples,
                        epsilon,
                        scale,
                    });
                }
            }
        }
        all
    }
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
            scale: 1.0,
        }
    }

    #[test]
    fn every_combination_is_tried_once_and_the_model_s_own_first() {
        let settings = Axes::around(&own(64)).settings();
        assert_eq!(settings.len(), 4 * 3 * 3);
        assert_eq!(settings[0], own(64));
        for (i, one) in settings.iter().enumerate() {
            assert!(!settings[..i].contains(one), "{one:?} twice");
            assert_eq!(one.check(), Ok(()));
        }
    }

    #[test]
    fn nothing_dearer_than_the_model_itself_is_tried() {
        let few = Axes::around(&own(8));
        assert_eq!(few.samples, [8]);
        let coarse = Axes::around(&RenderSettings {
            epsilon: 0.02,
            ..own(4)
        });
        assert_eq!(
            (coarse.samples, coarse.epsilon),
            (vec![4], vec![0.02, 0.05])
        );
    }
}
