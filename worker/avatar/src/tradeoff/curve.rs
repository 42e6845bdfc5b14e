//! The result of a sweep, which is stored beside a checkpoint.

use crate::render::RenderSettings;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Version of the format that this program writes. It also reads version 1, which knows neither shares of splats nor
/// a fixed part of the time for each setting.
pub(super) const VERSION: u32 = 2;
/// Oldest version that this program reads.
const OLDEST: u32 = 1;

/// The machine of a measurement.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Model of the CPU.
    pub cpu: String,
    /// Threads that the process may use.
    pub cores: usize,
    /// Device of the computation: the CPU or a GPU.
    pub device: String,
}

/// Time and fidelity of one setting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// The settings.
    pub settings: RenderSettings,
    /// Seconds per frame at the curve's size: the mean over views of each view's median.
    pub seconds: f64,
    /// The part of `seconds` that does not depend on the number of rays, by a measurement at another size; absent where
    /// that of the curve stands for all settings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fixed_seconds: Option<f64>,
    /// PSNR against the model's own settings at full size, dB; 100 for equal frames.
    pub psnr_to_full: f64,
    /// PSNR against pictures of a camera, dB; absent without them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psnr: Option<f64>,
    /// PSNR against pictures of a camera inside the box of the person's mask, dB.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psnr_mask_box: Option<f64>,
}

impl Point {
    /// PSNR by which points are ranked: against the truth if there is one, else against the
    /// model's own settings.
    pub fn fidelity(&self) -> f64 {
        self.psnr.unwrap_or(self.psnr_to_full)
    }
}

/// Test of a prediction for another size than the curve's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizeCheck {
    /// The settings.
    pub settings: RenderSettings,
    /// Mean rays through the body's box in the views of the other size.
    pub rays: f64,
    /// Prediction of [`Curve::predict`], seconds per frame.
    pub predicted: f64,
    /// Measured seconds per frame.
    pub measured: f64,
}

/// A model's measured trade-off between time and fidelity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Version of the format, from 1 on.
    pub version: u32,
    /// Time of the measurement, seconds since 1970.
    pub unix_seconds: u64,
    /// Machine of the measurement.
    pub machine: Machine,
    /// The model's tier.
    pub tier: String,
    /// Longest side of the measured views, pixels.
    pub size: u32,
    /// Number of views; each figure is a mean over them.
    pub views: usize,
    /// Timed frames per view and setting.
    pub repeats: usize,
    /// Mean number of rays per view through the body's box.
    pub rays: f64,
    /// Seconds of a frame without rays through the body's box: posing the body.
    pub fixed_seconds: f64,
    /// The first point has the model's own settings at full size.
    pub points: Vec<Point>,
    /// Tests of predictions for other sizes.
    #[serde(default)]
    pub checks: Vec<SizeCheck>,
}

/// Invalid curve.
#[derive(Debug, Error)]
pub enum CurveError {
    /// The JSON can't be read or written.
    #[error("the curve can't be read: {0}")]
    Json(#[from] serde_json::Error),
    /// The format has another version.
    #[error(
        "the curve is of version {0}, and this program reads {OLDEST} to {VERSION}: measure it again"
    )]
    Version(u32),
    /// A figure is invalid.
    #[error("the curve's {0}")]
    Figure(String),
}

impl Curve {
    /// Predicted seconds per frame of `point` for views with `rays` rays through the body's box.
    ///
    /// The time of a frame has a fixed part, posing the body, and a part proportional to the
    /// number of rays through the body's box: the samples of a ray in the body depend on pose and
    /// view, but hardly on resolution. Pixels outside the box take little time, in proportion to
    /// those inside if only the size changes.
    pub fn predict(&self, point: &Point, rays: f64) -> f64 {
        let fixed = point.fixed_seconds.unwrap_or(self.fixed_seconds);
        let fixed = fixed.min(point.seconds);
        fixed + (point.seconds - fixed) * rays / self.rays
    }

    /// Whether this program would measure the same settings.
    pub fn is_current(&self) -> bool {
        self.version == VERSION
    }

    /// The model's own settings at full size.
    pub fn full(&self) -> Option<&Point> {
        self.points.first()
    }

    /// Pretty JSON.
    ///
    /// # Errors
    /// If a figure has no JSON form.
    pub fn to_json(&self) -> Result<Vec<u8>, CurveError> {
        Ok(serde_json::to_vec_pretty(self)?)
    }

    /// Reads a curve.
    ///
    /// # Errors
    /// If `json` is not a curve of this version, or a figure is invalid.
    pub fn from_json(json: &[u8]) -> Result<Self, CurveError> {
        #[derive(Deserialize)]
        struct Header {
            version: u32,
        }
        let header: Header = serde_json::from_slice(json)?;
        if !(OLDEST..=VERSION).contains(&header.version) {
            return Err(CurveError::Version(header.version));
        }
        let curve: Self = serde_json::from_slice(json)?;
        curve.check()?;
        Ok(curve)
    }

    fn check(&self) -> Result<(), CurveError> {
        let fail = |what: String| Err(CurveError::Figure(what));
        if self.points.is_empty() {
            return fail("points: the list is empty".into());
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
            let fixed = point.fixed_seconds.unwrap_or(0.0);
            if !finite || point.seconds <= 0.0 || !(fixed.is_finite() && fixed >= 0.0) {
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

    /// A point with `samples` per ray.
    pub(crate) fn point(samples: usize, seconds: f64, psnr: Option<f64>) -> Point {
        Point {
            settings: RenderSettings {
                samples,
                epsilon: 1e-4,
                min_transmittance: 1e-3,
                precision: Precision::F32,
                scale: 1.0,
                splats: 1.0,
            },
            seconds,
            fixed_seconds: None,
            psnr_to_full: samples as f64,
            psnr,
            psnr_mask_box: None,
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
    fn settings_with_a_fixed_part_of_their_own_are_predicted_by_it() {
        let mut curve = curve(vec![point(64, 0.11, None)]);
        curve.points[0].fixed_seconds = Some(0.1);
        let seconds = curve.predict(&curve.points[0], 4000.0);
        assert!((seconds - 0.14).abs() < 1e-12, "{seconds}");
    }

    #[test]
    fn curves_of_the_first_version_have_all_splats() {
        let mut old =
            serde_json::to_value(curve(vec![point(64, 0.11, Some(30.0))])).expect("writes");
        old["version"] = 1.into();
        let settings = old["points"][0]["settings"]
            .as_object_mut()
            .expect("settings");
        settings.remove("splats").expect("is new");
        let read = Curve::from_json(old.to_string().as_bytes()).expect("reads");
        assert_eq!(read.points[0].settings.splats, 1.0);
        assert!(!read.is_current(), "it is measured anew");
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
        assert!(refused(|it| it.points[1].settings.splats = 0.0).contains("settings.splats"));
        assert!(refused(|it| it.points[1].fixed_seconds = Some(-1.0)).contains("points[1]"));
        assert!(Curve::from_json(b"{}").is_err());
    }
}
