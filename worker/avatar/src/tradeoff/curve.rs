//! What a sweep found, as it is kept beside a checkpoint.

use crate::render::RenderSettings;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Version of the format written by this program.
pub const VERSION: u32 = 1;

/// Where and on what figures were measured; seconds mean nothing without it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Model of the CPU.
    pub cpu: String,
    /// Threads that the process may use.
    pub cores: usize,
    /// What was computed on: the CPU again, or a GPU.
    pub device: String,
}

/// One setting's place: time against fidelity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// What was rendered with.
    pub settings: RenderSettings,
    /// Seconds a frame, at the curve's size: the mean over views of each view's median.
    pub seconds: f64,
    /// PSNR against the model's own settings at full size, dB; 100 for equal frames.
    pub psnr_to_full: f64,
    /// PSNR against what a camera saw, dB; absent without truth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psnr: Option<f64>,
}

impl Point {
    /// What points are ranked by: fidelity to the truth, or to the full render without it.
    pub fn fidelity(&self) -> f64 {
        self.psnr.unwrap_or(self.psnr_to_full)
    }
}

/// How a prediction for another size than the curve's came out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizeCheck {
    /// What was rendered with.
    pub settings: RenderSettings,
    /// Mean rays through the body's box in the views of the other size.
    pub rays: f64,
    /// By [`Curve::predict`], seconds a frame.
    pub predicted: f64,
    /// Seconds a frame.
    pub measured: f64,
}

/// A model's measured trade of seconds for fidelity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// [`VERSION`].
    pub version: u32,
    /// When it was measured, seconds since 1970.
    pub unix_seconds: u64,
    /// Where.
    pub machine: Machine,
    /// The model's tier.
    pub tier: String,
    /// Longest side of the measured views, pixels.
    pub size: u32,
    /// Views that each figure is a mean over.
    pub views: usize,
    /// Timed frames of each view and setting.
    pub repeats: usize,
    /// Mean rays through the body's box in a view.
    pub rays: f64,
    /// Seconds of a frame of next to no pixels: posing the body.
    pub fixed_seconds: f64,
    /// The first is the model's own settings at full size.
    pub points: Vec<Point>,
    /// Predictions for other sizes, put to the test.
    #[serde(default)]
    pub checks: Vec<SizeCheck>,
}

/// A curve that can't be used.
#[derive(Debug, Error)]
pub enum CurveError {
    /// Not JSON of this form.
    #[error("the curve can't be read: {0}")]
    Json(#[from] serde_json::Error),
    /// Written by another version of this program.
    #[error("the curve is of version {0}, and this program reads {VERSION}: measure it again")]
    Version(u32),
    /// A figure that can't be.
    #[error("the curve's {0}")]
    Figure(String),
}

impl Curve {
    /// Seconds a frame of `point`, for views with `rays` rays through the body's box.
    ///
    /// A frame's time is a fixed part (posing the body) and one that grows with the rays
    /// through the body's box, of which each costs the same on average: how much of the body a
    /// ray meets depends on pose and view, hardly on resolution. Pixels beside the box cost
    /// little, and grow with those inside when only the size changes.
    pub fn predict(&self, point: &Point, rays: f64) -> f64 {
        let fixed = self.fixed_seconds.min(point.seconds);
        fixed + (point.seconds - fixed) * rays / self.rays
    }

    /// The model's own settings at full size.
    pub fn full(&self) -> Option<&Point> {
        self.points.first()
    }

    /// Pretty JSON.
    ///
    /// # Errors
    /// When a figure has no JSON form.
    pub fn to_json(&self) -> Result<Vec<u8>, CurveError> {
        Ok(serde_json::to_vec_pretty(self)?)
    }

    /// # Errors
    /// When `json` is not a curve of this version with figures that can be.
    pub fn from_json(json: &[u8]) -> Result<Self, CurveError> {
        #[derive(Deserialize)]
        struct Header {
            version: u32,
        }
        let header: Header = serde_json::from_slice(json)?;
        if header.version != VERSION {
            return Err(CurveError::Version(header.version));
        }
        let curve: Self = serde_json::from_slice(json)?;
        curve.check()?;
        Ok(curve)
    }

    fn check(&self) -> Result<(), CurveError> {
        let fail = |what: String| Err(CurveError::Figure(what));
        if self.points.is_empty() {
            return fail("points: there is none".into());
        }
        if !(self.rays.is_finite() && self.rays > 0.0) {
            return fail(format!("rays: {} is not above 0", self.rays));
        }
        if !(self.fixed_seconds.is_finite() && self.fixed_seconds >= 0.0) {
            return fail(format!("fixed_seconds: {}", self.fixed_seconds));
        }
        for (i, point) in self.points.iter().enumerate() {
            let finite = [point.seconds, point.psnr_to_full, point.fidelity()]
                .iter()
                .all(|figure| figure.is_finite());
            if !finite || point.seconds <= 0.0 {
                return fail(format!("points[{i}]: {point:?}"));
            }
            if let Err(error) = point.settings.check() {
                return fail(format!("points[{i}].{error}"));
            }
            if point.psnr.is_some() != self.points[0].psnr.is_some() {
                return fail(format!("points[{i}].psnr: some points have one, some none"));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::config::Precision;

    /// A point with `samples` a ray.
    pub(crate) fn point(samples: usize, seconds: f64, psnr: Option<f64>) -> Point {
        Point {
            settings: RenderSettings {
                samples,
                epsilon: 1e-4,
                min_transmittance: 1e-3,
                precision: Precision::F32,
                scale: 1.0,
            },
            seconds,
            psnr_to_full: samples as f64,
            psnr,
        }
    }

    /// A curve at 1000 rays with 0.01 s of fixed cost.
    pub(crate) fn curve(points: Vec<Point>) -> Curve {
        Curve {
            version: VERSION,
            unix_seconds: 1_700_000_000,
            machine: Machine {
                cpu: "a CPU".into(),
                cores: 2,
                device: "the CPU".into(),
            },
            tier: "fast".into(),
            size: 128,
            views: 3,
            repeats: 3,
            rays: 1000.0,
            fixed_seconds: 0.01,
            points,
            checks: Vec::new(),
        }
    }

    #[test]
    fn time_grows_with_the_rays_and_the_fixed_part_stays() {
        let curve = curve(vec![point(64, 0.11, Some(30.0))]);
        let at = |rays| curve.predict(&curve.points[0], rays);
        assert!((at(1000.0) - 0.11).abs() < 1e-12);
        assert!((at(4000.0) - 0.41).abs() < 1e-12);
        assert!((at(0.0) - 0.01).abs() < 1e-12);
    }

    #[test]
    fn a_curve_survives_json_and_nothing_else_passes_for_one() {
        let good = curve(vec![
            point(64, 0.11, Some(30.0)),
            point(32, 0.06, Some(29.0)),
        ]);
        let json = good.to_json().expect("writes");
        assert_eq!(Curve::from_json(&json).expect("reads"), good);

        let refused = |change: fn(&mut Curve)| {
            let mut bad = good.clone();
            change(&mut bad);
            let json = bad.to_json().expect("writes");
            Curve::from_json(&json).expect_err("refused").to_string()
        };
        assert!(refused(|it| it.version = 9).contains("version 9"));
        assert!(refused(|it| it.points.clear()).contains("points"));
        assert!(refused(|it| it.rays = 0.0).contains("rays"));
        assert!(refused(|it| it.points[1].seconds = 0.0).contains("points[1]"));
        assert!(refused(|it| it.points[1].psnr = None).contains("points[1].psnr"));
        assert!(refused(|it| it.points[0].settings.scale = 2.0).contains("settings.scale"));
        assert!(Curve::from_json(b"{}").is_err());
    }
}
