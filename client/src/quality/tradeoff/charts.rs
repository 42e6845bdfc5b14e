//! The figures as plots.

use super::rows::{render_front, settings, training_front};
use super::{Tradeoff, Trained};
use crate::plot::{Mark, Plot, Series};
use yoto_avatar::tradeoff::Curve;

/// Each plot with its file's name.
pub(super) fn all(tradeoff: &Tradeoff) -> Vec<(&'static str, Plot)> {
    let mut plots = Vec::new();
    if !tradeoff.training.is_empty() {
        plots.push(("training", training(tradeoff)));
    }
    if !tradeoff.rendering.is_empty() {
        plots.push(("rendering", rendering(tradeoff)));
    }
    plots
}

fn training(tradeoff: &Tradeoff) -> Plot {
    let best = training_front(&tradeoff.training);
    let mut series: Vec<Series> = Vec::new();
    for (i, it) in tradeoff.training.iter().enumerate() {
        let mark = Mark {
            cost: it.train_seconds,
            gain: it.scores.novel_view.psnr,
            label: best.contains(&i).then(|| reached(it)),
        };
        match series.iter_mut().find(|series| series.name == it.tier) {
            Some(series) => series.marks.push(mark),
            None => series.push(Series {
                name: it.tier.clone(),
                marks: vec![mark],
            }),
        }
    }
    Plot {
        title: format!("Training: {} at {} pixels", people(tradeoff), tradeoff.size),
        subtitle: format!(
            "Large points: nothing is better in less time. {}",
            tradeoff.machine.device
        ),
        cost: "seconds of training".into(),
        gain: "PSNR on held-out views, dB".into(),
        series,
    }
}

fn reached(it: &Trained) -> String {
    let megabytes = it.checkpoint_bytes as f64 / 1e6;
    format!("{}, {} s: {megabytes:.1} MB", it.tier, it.budget_seconds)
}

fn rendering(tradeoff: &Tradeoff) -> Plot {
    let with_truth = tradeoff
        .rendering
        .iter()
        .all(|curve| curve.full().is_some_and(|full| full.psnr.is_some()));
    let against = match with_truth {
        true => "the truth",
        false => "the model's own settings",
    };
    Plot {
        title: format!(
            "Rendering: {} at {} pixels",
            people(tradeoff),
            tradeoff.size
        ),
        subtitle: format!(
            "Labels: samples a ray · resolution · likelihood bound · least light · precision. {}",
            tradeoff.machine.device
        ),
        cost: "seconds a frame".into(),
        gain: format!("PSNR against {against}, dB"),
        series: tradeoff.rendering.iter().map(curve).collect(),
    }
}

fn curve(curve: &Curve) -> Series {
    let best = render_front(curve);
    let points = curve.points.iter().enumerate();
    Series {
        name: curve.tier.clone(),
        marks: points
            .map(|(i, point)| Mark {
                cost: point.seconds,
                gain: point.fidelity(),
                label: best.contains(&i).then(|| settings(point)),
            })
            .collect(),
    }
}

fn people(tradeoff: &Tradeoff) -> String {
    tradeoff.people.join(", ")
}
