//! The figures as `tradeoff.csv`, and their front as text.

use super::pareto::front;
use super::{Curve, Point, Tradeoff, Trained};
use crate::config::Precision;
use crate::render::RenderSettings;
use std::collections::HashSet;

/// Columns; a row fills those of its kind, the others are empty.
const COLUMNS: &str = "side,tier,front,seconds,psnr,ssim,psnr_novel_pose,ssim_novel_pose,\
psnr_to_full,budget_seconds,steps,parameters,checkpoint_bytes,peak_memory_bytes,samples,epsilon,\
min_transmittance,precision,scale,rays,splats,psnr_mask_box";

/// Every training and every render setting, one row each.
pub(super) fn csv(tradeoff: &Tradeoff) -> String {
    let mut text = format!("{COLUMNS}\n");
    let best = training_front(&tradeoff.training);
    for (i, it) in tradeoff.training.iter().enumerate() {
        let (view, pose) = (&it.scores.novel_view, &it.scores.novel_pose);
        let memory = it
            .peak_memory_bytes
            .map_or_else(String::new, |bytes| bytes.to_string());
        text += &format!(
            "training,{},{},{:.3},{:.4},{:.5},{:.4},{:.5},,{},{},{},{},{memory},,,,,,,,\n",
            it.tier,
            u8::from(best.contains(&i)),
            it.train_seconds,
            view.psnr,
            view.ssim,
            pose.psnr,
            pose.ssim,
            it.budget_seconds,
            it.steps,
            it.parameters,
            it.checkpoint_bytes,
        );
    }
    for curve in &tradeoff.rendering {
        let best = render_front(curve);
        for (i, point) in curve.points.iter().enumerate() {
            let cell = |psnr: Option<f64>| psnr.map_or_else(String::new, |it| format!("{it:.4}"));
            let (psnr, in_box) = (cell(point.psnr), cell(point.psnr_mask_box));
            text += &format!(
                "rendering,{},{},{:.6},{psnr},,,,{:.4},,,,,,{},{},{},{},{},{:.1},{},{in_box}\n",
                curve.tier,
                u8::from(best.contains(&i)),
                point.seconds,
                point.psnr_to_full,
                point.settings.samples,
                point.settings.epsilon,
                point.settings.min_transmittance,
                precision(point.settings.precision),
                point.settings.scale,
                curve.rays,
                point.settings.splats,
            );
        }
    }
    text
}

/// Indices of the trainings on the front of seconds and PSNR.
fn training_front(training: &[Trained]) -> HashSet<usize> {
    let cost_and_gain = |it: &Trained| (it.train_seconds, it.scores.novel_view.psnr);
    front(training, cost_and_gain).into_iter().collect()
}

/// Indices of the settings on the front of seconds and fidelity.
fn render_front(curve: &Curve) -> HashSet<usize> {
    let cost_and_gain = |it: &Point| (it.seconds, it.fidelity());
    front(&curve.points, cost_and_gain).into_iter().collect()
}

fn precision(precision: Precision) -> &'static str {
    match precision {
        Precision::F32 => "f32",
        Precision::Bf16 => "bf16",
    }
}

/// Label of settings: samples per ray, share of the resolution, and differences from the model's
/// `own`: share of the splats, likelihood bound (ε), least transmittance (T), precision.
fn settings(it: &RenderSettings, own: &RenderSettings) -> String {
    let mut text = format!("{} · {:.0}%", it.samples, 100.0 * it.scale);
    if it.splats != own.splats {
        text += &format!(" · {}% of the splats", 100.0 * it.splats);
    }
    if it.epsilon != own.epsilon {
        text += &format!(" · ε {}", it.epsilon);
    }
    if it.min_transmittance != own.min_transmittance {
        text += &format!(" · T {}", it.min_transmittance);
    }
    if it.precision != own.precision {
        text += &format!(" · {}", precision(it.precision));
    }
    text
}

/// The fronts of all curves and the accuracy of predictions for other sizes, as text.
pub(super) fn summary(tradeoff: &Tradeoff) -> String {
    let mut lines = Vec::new();
    for it in &tradeoff.training {
        let memory = it.peak_memory_bytes.map_or_else(
            || "memory not measured".to_owned(),
            |bytes| format!("{:.0} MB resident", bytes as f64 / 1e6),
        );
        lines.push(format!(
            "trained   {:<9} {:>7.1} s  {:>6.2} dB views, {:>6.2} dB poses  SSIM {:.4}  {} steps, \
             {:.1} MB per checkpoint, {memory}",
            it.tier,
            it.train_seconds,
            it.scores.novel_view.psnr,
            it.scores.novel_pose.psnr,
            it.scores.novel_view.ssim,
            it.steps,
            it.checkpoint_bytes as f64 / 1e6,
        ));
    }
    for curve in &tradeoff.rendering {
        let best = render_front(curve);
        let Some(own) = curve.full().map(|full| full.settings) else {
            continue;
        };
        let mut kept: Vec<&Point> = curve
            .points
            .iter()
            .enumerate()
            .filter_map(|(i, point)| (i == 0 || best.contains(&i)).then_some(point))
            .collect();
        kept.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
        for point in kept {
            let cell = |psnr: Option<f64>| {
                psnr.map_or_else(|| "-".into(), |it: f64| format!("{it:.2} dB"))
            };
            let (psnr, in_box) = (cell(point.psnr), cell(point.psnr_mask_box));
            lines.push(format!(
                "rendered  {:<9} {:>7.4} s  {psnr:>9}, {in_box:>9} in the box  {:>6.2} dB to full  {}",
                curve.tier,
                point.seconds,
                point.psnr_to_full,
                settings(&point.settings, &own)
            ));
        }
        for check in &curve.checks {
            lines.push(format!(
                "predicted {:<9} {:>7.4} s, measured {:.4} s ({:+.0} %) with {:.2} times the rays",
                curve.tier,
                check.predicted,
                check.measured,
                100.0 * (check.predicted / check.measured - 1.0),
                check.rays / curve.rays
            ));
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_told_by_what_differs() {
        let own = RenderSettings {
            samples: 64,
            epsilon: 1e-4,
            min_transmittance: 1e-3,
            precision: Precision::F32,
            scale: 1.0,
            splats: 1.0,
        };
        assert_eq!(settings(&own, &own), "64 · 100%");
        let other = RenderSettings {
            samples: 32,
            epsilon: 0.03,
            min_transmittance: 0.05,
            precision: Precision::Bf16,
            scale: 0.75,
            splats: 0.125,
        };
        assert_eq!(
            settings(&other, &own),
            "32 · 75% · 12.5% of the splats · ε 0.03 · T 0.05 · bf16"
        );
    }
}
