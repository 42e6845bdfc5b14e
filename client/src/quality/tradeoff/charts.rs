//! The figures as plots.

use super::rows::{render_front, settings, training_front};
use super::{Tradeoff, Trained};
use crate::plot::{Mark, Plot, Series};
use std::collections::HashSet;
use yoto_avatar::tradeoff::{Curve, Point};

/// Points nearer to each other than this, as a share of their seconds, and than so many dB are
/// one to the eye.
const NEAR_SECONDS: f64 = 0.15;
const NEAR_DECIBELS: f64 = 0.15;

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
            best: best.contains(&i),
            joined: true,
            label: Some(reached(it)),
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
            "Large points: nothing is better in less time. Labels: budget, size of a checkpoint. {}",
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
            "Labels: samples a ray · resolution, and what differs from the model's own: likelihood bound ε, \
             least light T, precision. {}",
            tradeoff.machine.device
        ),
        cost: "seconds a frame".into(),
        gain: format!("PSNR against {against}, dB"),
        series: tradeoff.rendering.iter().map(curve).collect(),
    }
}

fn curve(curve: &Curve) -> Series {
    let best = render_front(curve);
    let told = told(curve, &best);
    let own = curve.full().map(|full| full.settings);
    let label = |i: usize, point: &Point| match own {
        Some(_) if i == 0 => Some(format!(
            "own: {}",
            settings(&point.settings, &point.settings)
        )),
        Some(own) if told.contains(&i) => Some(settings(&point.settings, &own)),
        _ => None,
    };
    let points = curve.points.iter().enumerate();
    Series {
        name: curve.tier.clone(),
        marks: points
            .map(|(i, point)| Mark {
                cost: point.seconds,
                gain: point.fidelity(),
                best: i == 0 || best.contains(&i),
                joined: best.contains(&i),
                label: label(i, point),
            })
            .collect(),
    }
}

/// Those of the `best` that lie apart from each other; of points that differ by less than noise
/// the better is told.
fn told(curve: &Curve, best: &HashSet<usize>) -> HashSet<usize> {
    let mut order: Vec<usize> = best.iter().copied().collect();
    let point = |i: usize| &curve.points[i];
    order.sort_by(|&a, &b| point(b).fidelity().total_cmp(&point(a).fidelity()));
    let mut told: Vec<usize> = Vec::new();
    for i in order {
        let near = |&other: &usize| {
            let seconds = (point(i).seconds / point(other).seconds).ln().abs();
            let fidelity = (point(i).fidelity() - point(other).fidelity()).abs();
            seconds < NEAR_SECONDS && fidelity < NEAR_DECIBELS
        };
        if !told.iter().any(near) {
            told.push(i);
        }
    }
    told.into_iter().collect()
}

fn people(tradeoff: &Tradeoff) -> String {
    tradeoff.people.join(", ")
}
