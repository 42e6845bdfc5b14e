//! Results of a training run, as `report.json` and as a table.
//!
//! `yoto demo` writes the same fields, so that one reader works for both.

use crate::pose_error::PoseErrors;
use crate::split_regions::SplitRegions;
use serde::{Deserialize, Serialize};
use std::path::Path;
use yoto_avatar::evaluate::{SplitScores, SubjectScore, split_table};

/// `report.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct QualityReport {
    /// One entry per person.
    pub subjects: Vec<SubjectScore>,
    /// The subjects' figures, averaged.
    pub mean: SplitScores,
    /// The averages after a fit of the held-out pictures' poses, with the model as it is; absent if it
    /// was not requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fitted: Option<SplitScores>,
    /// The averages with the held-out poses moved by the mean change from exact training poses to those
    /// that the model was learned from; absent where it was learned from exact ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aligned: Option<SplitScores>,
    /// Training steps taken.
    pub steps: u64,
    /// Seconds of training, without evaluation.
    pub train_seconds: f64,
    /// `steps / train_seconds`.
    pub steps_per_second: f64,
    /// Samples of the field that a training step evaluated, mean per ray; absent if it was not
    /// measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples_per_ray: Option<f64>,
    /// Number of parameters.
    pub parameters: u64,
    /// Size of a checkpoint with optimiser state, bytes.
    pub checkpoint_bytes: u64,
    /// Growth of the weights per further person, bytes (three times as much with optimiser state);
    /// absent if it was not requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub person_bytes: Option<u64>,
    /// The device that trained.
    pub device: String,
    /// The objective, e.g. "lpips+mse", or the fallback without LPIPS weights.
    pub objective: String,
    /// Parts of the model that become active during a run, and were at its end.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub active_parts: Vec<String>,
    /// The people whose poses are refined and why, and what became of single frames.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Errors of training poses that are not the exact ones, as means over the people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_errors: Option<PoseErrors>,
    /// Seconds to render a frame at the evaluated size.
    pub render_seconds_per_frame: f64,
    /// The settings of the run.
    pub settings: Settings,
    /// Quality over training time, if measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<Curve>,
    /// Error by region, over all measured pictures, if measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub regions: Option<SplitRegions>,
}

/// The settings behind a report's figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Quality tier.
    pub tier: String,
    /// Model variant.
    pub variant: String,
    /// Longest image side trained and evaluated at, pixels.
    pub size: u32,
    /// Random seed.
    pub seed: u64,
    /// Settings that are not the tier's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub changed: Vec<String>,
}

/// Quality over training time.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Curve {
    /// Measured pictures per capture and split for each point.
    pub pictures_per_capture: usize,
    /// Points of the novel views, over time.
    pub novel_view: Vec<CurvePoint>,
    /// Points of the novel poses, over time.
    pub novel_pose: Vec<CurvePoint>,
}

/// One measurement while training.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Seconds of training so far.
    pub seconds: f64,
    /// Steps so far.
    pub step: u64,
    /// As [`yoto_avatar::evaluate::Score::psnr`].
    pub psnr: f64,
    /// As [`yoto_avatar::evaluate::Score::psnr_mask_box`].
    pub psnr_mask_box: f64,
    /// As [`yoto_avatar::evaluate::Score::ssim`].
    pub ssim: f64,
}

impl Curve {
    /// PSNR of the newest point: of the views, or of the poses without any view.
    pub(crate) fn newest_psnr(&self) -> Option<f64> {
        let newest = self.novel_view.last().or(self.novel_pose.last());
        newest.map(|point| point.psnr)
    }
}

impl QualityReport {
    /// Writes `report.json`, and creates its folder.
    ///
    /// # Errors
    /// When the file can't be written.
    pub fn write(&self, path: &Path) -> std::io::Result<()> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let mut json = serde_json::to_string_pretty(self)?;
        json.push('\n');
        std::fs::write(path, json)
    }

    /// The figures as a readable table, with a line on steps, time and device.
    pub fn table(&self) -> String {
        let mut lines = split_table(&self.subjects, &self.mean);
        if let Some(fitted) = &self.fitted {
            lines.push(fitted.table_row("poses fitted"));
        }
        if let Some(aligned) = &self.aligned {
            lines.push(aligned.table_row("aligned"));
        }
        lines.push(format!(
            "{} steps in {:.0} s ({:.1} steps/s, objective {}) on {}; {:.2} M parameters, checkpoint {:.1} MB, {:.2} s per rendered frame",
            self.steps,
            self.train_seconds,
            self.steps_per_second,
            self.objective,
            self.device,
            self.parameters as f64 / 1e6,
            self.checkpoint_bytes as f64 / 1e6,
            self.render_seconds_per_frame
        ));
        if let Some(samples) = self.samples_per_ray {
            lines.push(format!(
                "{samples:.1} samples evaluated per ray of training"
            ));
        }
        if let Some(regions) = &self.regions {
            lines.extend(regions.lines());
        }
        if !self.active_parts.is_empty() {
            lines.push(format!(
                "active at the end: {}",
                self.active_parts.join(", ")
            ));
        }
        lines.extend(self.notes.iter().cloned());
        if let Some(errors) = &self.pose_errors {
            let refined = errors.refined_mm.map_or("not refined".into(), |refined| {
                format!("{refined:.1} mm after refinement")
            });
            lines.push(format!(
                "joints of the training poses off by {:.1} mm, {refined}",
                errors.given_mm
            ));
        }
        lines.join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_avatar::evaluate::Score;

    fn score(psnr: f64) -> Score {
        Score {
            psnr,
            psnr_mask_box: psnr - 5.0,
            ssim: 0.9,
            ssim_uniform: 0.91,
            ssim_inflated: 0.93,
            lpips: None,
            black_psnr: 18.0,
            pictures: 8,
        }
    }

    fn report() -> QualityReport {
        let subject = |name: &str, psnr: f64| SubjectScore {
            name: name.into(),
            scores: SplitScores {
                novel_view: score(psnr),
                novel_pose: score(psnr - 1.0),
            },
            black_image_psnr: 18.0,
        };
        let subjects = vec![subject("ada", 28.0), subject("bob", 26.0)];
        QualityReport {
            mean: SplitScores::mean(&subjects),
            fitted: None,
            aligned: None,
            subjects,
            steps: 1200,
            train_seconds: 150.0,
            steps_per_second: 8.0,
            samples_per_ray: None,
            parameters: 1_500_000,
            checkpoint_bytes: 18_000_000,
            person_bytes: None,
            device: "cpu".into(),
            objective: "mse+ssim".into(),
            active_parts: vec!["pose correction".into()],
            notes: Vec::new(),
            pose_errors: None,
            render_seconds_per_frame: 0.8,
            settings: Settings {
                tier: "fast".into(),
                variant: "yoto".into(),
                size: 128,
                seed: 7,
                changed: Vec::new(),
            },
            curve: None,
            regions: None,
        }
    }

    #[test]
    fn the_file_has_the_documented_fields() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let path = dir.path().join("new/report.json");
        report().write(&path).expect("writes");
        let json: serde_json::Value =
            serde_json::from_slice(&std::fs::read(&path).expect("reads")).expect("is JSON");
        for field in [
            "steps",
            "train_seconds",
            "steps_per_second",
            "parameters",
            "checkpoint_bytes",
        ] {
            assert!(json[field].is_number(), "{field}");
        }
        assert!(json["device"].is_string() && json["render_seconds_per_frame"].is_number());
        assert!(json.get("curve").is_none(), "no curve was measured");
        for split in ["novel_view", "novel_pose"] {
            for field in ["psnr", "psnr_mask_box", "ssim", "black_psnr"] {
                assert!(
                    json["subjects"][1][split][field].is_number(),
                    "{split}.{field}"
                );
            }
        }
        assert_eq!(json["subjects"][0]["name"], "ada");
        let read: QualityReport = serde_json::from_value(json).expect("reads back");
        assert_eq!(read, report());
    }

    #[test]
    fn the_table_names_everybody() {
        let table = report().table();
        for text in [
            "ada",
            "bob",
            "mean",
            "28.00",
            "23.00",
            "1200 steps in 150 s",
        ] {
            assert!(table.contains(text), "{text} in\n{table}");
        }
    }
}
