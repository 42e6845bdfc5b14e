//! The errors of given poses, as fits to the pictures find them.
//!
//! Poses that are held too loosely follow the flaws of a model that is not learned yet, so that exact ones
//! are spoiled; those that are held too tightly keep their errors. What is expected is therefore
//! what was found: the squares of the changes that fits ask for, divided by the number of
//! parameters that the pictures determine (MacKay, Bayesian Interpolation, Neural Computation 4,
//! 1992; docs/research/refinement.md measures it).

use crate::fit::Evidence;
use serde::{Deserialize, Serialize};

/// Share of the refinement after which errors are learned: before it, the model shows too little.
const FROM: f64 = 0.1;
/// Weight of a fit in the moving sums.
const RATE: f32 = 0.02;
/// The sums before the first fit: about as much as three fits determine of rotations.
const BEFORE: f32 = 4.0;
/// Largest mean square that one fit counts with: frames that are wrong altogether say nothing of the
/// others' errors.
const LARGEST: f64 = 9.0;
/// Smallest and largest expected errors.
const RANGE: [f64; 2] = [0.05, 3.0];

/// Expected errors of rotations and of the root's place, as factors of those in the configuration.
/// Numbers are in single precision, which a file of JSON gives back exactly.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ExpectedErrors([Expected; 2]);

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Expected {
    /// Moving sum of squared changes, in units of the configured errors.
    squares: f32,
    /// Moving sum of the numbers of parameters that pictures determine.
    determined: f32,
}

impl ExpectedErrors {
    /// The errors that the configuration expects.
    pub(super) fn configured() -> Self {
        let configured = Expected {
            squares: BEFORE,
            determined: BEFORE,
        };
        Self([configured; 2])
    }

    /// The configured errors times these `factors`.
    pub(super) fn of(factors: [f64; 2]) -> Self {
        Self(factors.map(|factor| Expected {
            squares: BEFORE * factor.powi(2) as f32,
            determined: BEFORE,
        }))
    }

    /// Factors of the configured errors: of rotations, and of the place.
    pub(super) fn factors(&self) -> [f64; 2] {
        let [least, most] = RANGE;
        self.0.map(|it| {
            let ratio = f64::from(it.squares / it.determined);
            // Nothing determined yet, or nothing left of it.
            let ratio = if ratio.is_finite() { ratio } else { 1.0 };
            ratio.sqrt().clamp(least, most)
        })
    }

    /// Learns from a fit of a frame that counts by `weight`, after the share `passed` of the
    /// refinement.
    pub(super) fn learn(&mut self, evidence: &[Evidence; 2], weight: f64, passed: f64) {
        if passed >= FROM {
            self.average(evidence, weight, RATE);
        }
    }

    /// Learns from a fit of a frame that counts by `weight`, where poses are only observed and `before` other
    /// fits were made: all count alike.
    pub(super) fn observe(&mut self, evidence: &[Evidence; 2], weight: f64, before: u32) {
        self.average(evidence, weight, RATE.max(1.0 / (before as f32 + 2.0)));
    }

    /// Moves the sums by the share `rate` towards the `evidence` of a fit that counts by `weight`.
    fn average(&mut self, evidence: &[Evidence; 2], weight: f64, rate: f32) {
        let factors = self.factors();
        for ((expected, found), factor) in self.0.iter_mut().zip(evidence).zip(factors) {
            // Rounding may leave a little less than nothing.
            let determined = found.determined.max(0.0);
            let squares = found.squares.max(0.0) * factor.powi(2);
            let squares = squares.min(LARGEST * determined);
            if !(squares.is_finite() && determined.is_finite()) {
                continue;
            }
            let [squares, determined] = [squares, determined].map(|it| (weight * it) as f32);
            expected.squares += rate * (squares - expected.squares);
            expected.determined += rate * (determined - expected.determined);
        }
    }

    /// Whether all are numbers that a training has found.
    pub(super) fn are_valid(&self) -> bool {
        let numbers = self.0.iter().flat_map(|it| [it.squares, it.determined]);
        numbers.into_iter().all(|it| it.is_finite() && it >= 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fit that determines `determined` rotations, each off by `off` configured errors.
    fn fit(now: &ExpectedErrors, determined: f64, off: f64) -> [Evidence; 2] {
        let [rotation, _] = now.factors();
        let rotations = Evidence {
            squares: determined * (off / rotation).powi(2),
            determined,
        };
        [rotations, Evidence::default()]
    }

    #[test]
    fn what_is_found_is_expected() {
        let mut errors = ExpectedErrors::configured();
        for _ in 0..400 {
            errors.learn(&fit(&errors, 6.0, 0.3), 1.0, 0.5);
        }
        let [rotation, _] = errors.factors();
        assert!((rotation - 0.3).abs() < 0.01, "{rotation}");
        for _ in 0..400 {
            errors.learn(&fit(&errors, 6.0, 0.0), 1.0, 0.5);
        }
        assert_eq!(errors.factors()[0], RANGE[0]);
        assert!(errors.are_valid());
    }

    #[test]
    fn early_wrong_and_empty_fits_say_little() {
        let mut errors = ExpectedErrors::configured();
        errors.learn(&fit(&errors, 6.0, 0.1), 1.0, 0.05);
        assert_eq!(errors, ExpectedErrors::configured(), "too early");
        for _ in 0..400 {
            errors.learn(&fit(&errors, 6.0, 100.0), 1.0, 0.5);
        }
        assert!((errors.factors()[0] - LARGEST.sqrt()).abs() < 0.01);
        let nothing = Evidence {
            squares: 0.0,
            determined: -1e-16,
        };
        for _ in 0..10_000 {
            errors.learn(&[nothing; 2], 1.0, 0.5);
        }
        assert!(errors.are_valid() && errors.factors().iter().all(|it| it.is_finite()));
    }
}
