//! The choice of settings from a measured curve.

use super::curve::{Curve, Point};
use crate::render::RenderSettings;
use thiserror::Error;
use yoto_proto::tiers::{self, RenderGoal};

/// A request for time or fidelity.
#[derive(Clone, Debug, PartialEq)]
pub enum Want {
    /// The best fidelity within this many seconds per frame.
    MaxSeconds(f64),
    /// The fastest settings with at least this PSNR against the truth, dB.
    MinPsnr(f64),
    /// A named point of the curve: one of [`tiers::RENDER_TIERS`]. Whether the model is one of splats is not
    /// asked here.
    Tier(String),
}

/// Chosen settings, and the predicted time and fidelity.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The settings.
    pub settings: RenderSettings,
    /// Seconds per frame.
    pub predicted_seconds: f64,
    /// PSNR against the truth, dB; absent if the curve was measured without truth.
    pub predicted_psnr: Option<f64>,
    /// PSNR against the model's own settings, dB.
    pub predicted_psnr_to_full: f64,
}

/// Error of a choice.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ChooseError {
    /// No settings are fast enough.
    #[error(
        "no settings render a frame of this size in {wanted} s; the fastest take {seconds:.4} s, at {fidelity:.2} dB"
    )]
    TooFast {
        /// Requested seconds per frame.
        wanted: f64,
        /// Seconds per frame of the fastest settings.
        seconds: f64,
        /// Fidelity of the fastest settings, dB.
        fidelity: f64,
    },
    /// No settings reach the PSNR.
    #[error(
        "no settings reach {wanted} dB; the best reach {psnr:.2} dB, in {seconds:.4} s per frame"
    )]
    TooGood {
        /// Requested PSNR, dB.
        wanted: f64,
        /// PSNR of the best settings, dB.
        psnr: f64,
        /// Seconds per frame of the best settings.
        seconds: f64,
    },
    /// The curve has no PSNR against the truth.
    #[error(
        "this curve was measured without pictures to compare with, so it has no PSNR against the truth"
    )]
    NoTruth,
    /// Unknown render quality.
    #[error("there is no render quality '{0}'; qualities: {list}", list = tiers::render_tiers())]
    UnknownTier(String),
    /// A requested number is not positive and finite.
    #[error("{0} is not a number above 0")]
    NotPositive(f64),
    /// The curve has no points.
    #[error("the curve has no points")]
    Empty,
}

/// The settings of `curve` that satisfy the request, for views with `rays` rays through the body's
/// box (see [`crate::render::Renderer::rays`]).
///
/// # Errors
/// If none do; the error names the best ones.
pub fn choose(curve: &Curve, want: &Want, rays: f64) -> Result<Choice, ChooseError> {
    let full = curve.full().ok_or(ChooseError::Empty)?;
    let positive = |value: f64| match value.is_finite() && value > 0.0 {
        true => Ok(value),
        false => Err(ChooseError::NotPositive(value)),
    };
    let seconds = |point: &Point| curve.predict(point, rays);
    let fastest = |least: f64| {
        let good = curve.points.iter().filter(|it| it.fidelity() >= least);
        good.min_by(|a, b| seconds(a).total_cmp(&seconds(b)))
    };
    let best = |most: f64| {
        let quick = curve.points.iter().filter(|it| seconds(it) <= most);
        quick.max_by(|a, b| {
            let gain = a.fidelity().total_cmp(&b.fidelity());
            gain.then(seconds(b).total_cmp(&seconds(a)))
        })
    };
    let point = match want {
        Want::MaxSeconds(wanted) => {
            let wanted = positive(*wanted)?;
            best(wanted).ok_or_else(|| {
                let fastest = fastest(f64::NEG_INFINITY).unwrap_or(full);
                ChooseError::TooFast {
                    wanted,
                    seconds: seconds(fastest),
                    fidelity: fastest.fidelity(),
                }
            })?
        }
        Want::MinPsnr(wanted) => {
            let wanted = positive(*wanted)?;
            if full.psnr.is_none() {
                return Err(ChooseError::NoTruth);
            }
            fastest(wanted).ok_or_else(|| {
                let best = best(f64::INFINITY).unwrap_or(full);
                ChooseError::TooGood {
                    wanted,
                    psnr: best.fidelity(),
                    seconds: seconds(best),
                }
            })?
        }
        Want::Tier(name) => {
            let tier = tiers::render_tier(name);
            let tier = tier.ok_or_else(|| ChooseError::UnknownTier(name.clone()))?;
            match tier.goal {
                RenderGoal::Full | RenderGoal::Splats => full,
                RenderGoal::WithinDb(_) if full.psnr.is_none() => return Err(ChooseError::NoTruth),
                RenderGoal::WithinDb(loss) => fastest(full.fidelity() - loss).unwrap_or(full),
            }
        }
    };
    Ok(Choice {
        settings: point.settings,
        predicted_seconds: seconds(point),
        predicted_psnr: point.psnr,
        predicted_psnr_to_full: point.psnr_to_full,
    })
}

#[cfg(test)]
mod tests {
    use super::super::curve::tests::{curve, point};
    use super::*;

    /// Full, a good one, a cheap one, and one that both beat.
    fn measured() -> Curve {
        curve(vec![
            point(64, 0.41, Some(30.0)),
            point(32, 0.21, Some(29.8)),
            point(16, 0.11, Some(27.0)),
            point(24, 0.30, Some(26.0)),
        ])
    }

    fn samples(want: &Want, rays: f64) -> Result<usize, ChooseError> {
        choose(&measured(), want, rays).map(|choice| choice.settings.samples)
    }

    #[test]
    fn seconds_buy_the_best_that_fits() {
        assert_eq!(samples(&Want::MaxSeconds(1.0), 1000.0), Ok(64));
        assert_eq!(samples(&Want::MaxSeconds(0.35), 1000.0), Ok(32));
        assert_eq!(samples(&Want::MaxSeconds(0.11), 1000.0), Ok(16));
        // A quarter of the rays: 0.01 + 0.4 / 4.
        assert_eq!(samples(&Want::MaxSeconds(0.1101), 250.0), Ok(64));
        let choice = choose(&measured(), &Want::MaxSeconds(1.0), 250.0).expect("fits");
        assert!((choice.predicted_seconds - 0.11).abs() < 1e-12);
        assert_eq!(choice.predicted_psnr, Some(30.0));
    }

    #[test]
    fn what_can_t_be_had_names_the_best_there_is() {
        let error = samples(&Want::MaxSeconds(0.05), 1000.0).expect_err("too fast");
        assert!(
            error.to_string().contains("0.1100 s, at 27.00 dB"),
            "{error}"
        );
        let error = samples(&Want::MinPsnr(31.0), 1000.0).expect_err("too good");
        assert!(
            error.to_string().contains("30.00 dB, in 0.4100 s"),
            "{error}"
        );
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(samples(&Want::MaxSeconds(bad), 1000.0).is_err(), "{bad}");
            assert!(samples(&Want::MinPsnr(bad), 1000.0).is_err(), "{bad}");
        }
    }

    #[test]
    fn fidelity_is_had_as_fast_as_it_goes() {
        assert_eq!(samples(&Want::MinPsnr(26.5), 1000.0), Ok(16));
        assert_eq!(samples(&Want::MinPsnr(29.9), 1000.0), Ok(64));
    }

    #[test]
    fn tiers_are_places_on_the_curve() {
        let tier = |name: &str| samples(&Want::Tier(name.into()), 1000.0);
        assert_eq!(tier("full"), Ok(64));
        assert_eq!(tier("balanced"), Ok(64));
        assert_eq!(tier("fast"), Ok(32));
        assert_eq!(tier("draft"), Ok(32));
        assert_eq!(tier("realtime"), Ok(64));
        let error = tier("ultra").expect_err("unknown");
        assert!(error.to_string().contains("draft"), "{error}");
    }

    #[test]
    fn without_truth_only_what_needs_none_is_answered() {
        let blind = curve(vec![point(64, 0.41, None), point(32, 0.21, None)]);
        let choose = |want| choose(&blind, &want, 1000.0).map(|it| it.settings.samples);
        assert_eq!(choose(Want::MaxSeconds(0.3)), Ok(32));
        assert_eq!(choose(Want::Tier("full".into())), Ok(64));
        assert_eq!(choose(Want::Tier("fast".into())), Err(ChooseError::NoTruth));
        assert_eq!(choose(Want::MinPsnr(20.0)), Err(ChooseError::NoTruth));
    }
}
