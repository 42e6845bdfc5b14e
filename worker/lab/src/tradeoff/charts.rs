//! The figures as plots.

use super::rows::{render_front, settings, training_front};
use super::{Tradeoff, Trained};
use crate::plot::{Mark, Plot, Series};
use std::collections::HashSet;
use yoto_avatar::tradeoff::{Curve, Point};

/// Smallest gain of a labelled point, dB.
const GAIN: f64 = 0.15;

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
            "Large points: no other point is better in less time. Labels: budget, size of a checkpoint. {}",
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
            "Labels: samples per ray · resolution, and what differs from the model's own: likelihood bound ε, \
             least light T, precision. {}",
            tradeoff.machine.device
        ),
        cost: "seconds per frame".into(),
        gain: format!("PSNR against {against}, dB"),
        series: tradeoff.rendering.iter().map(curve).collect(),
    }
}

fn curve(curve: &Curve) -> Series {
    let best = render_front(curve);
    let told = told(&curve.points, &best);
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

/// The labelled points of `best`: from the cheapest on, each with a visible gain over the previous
/// one.
fn told(points: &[Point], best: &HashSet<usize>) -> HashSet<usize> {
    let mut order: Vec<usize> = best.iter().copied().collect();
    order.sort_by(|&a, &b| points[a].seconds.total_cmp(&points[b].seconds));
    let mut reached = f64::NEG_INFINITY;
    order.retain(|&i| {
        let fidelity = points[i].fidelity();
        let gains = fidelity >= reached + GAIN;
        if gains {
            reached = fidelity;
        }
        gains
    });
    order.into_iter().collect()
}

fn people(tradeoff: &Tradeoff) -> String {
    tradeoff.people.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_avatar::config::Precision;
    use yoto_avatar::render::RenderSettings;

    #[test]
    fn points_that_gain_nothing_to_the_eye_have_no_label() {
        let point = |seconds, psnr| Point {
            settings: RenderSettings {
                samples: 64,
                epsilon: 1e-3,
                min_transmittance: 1e-3,
                precision: Precision::F32,
                scale: 1.0,
            },
            seconds,
            psnr_to_full: 40.0,
            psnr: Some(psnr),
        };
        let points = [
            point(0.4, 32.0),
            point(0.1, 30.0),
            point(0.2, 30.1),
            point(0.3, 30.2),
        ];
        let told = told(&points, &(0..4).collect());
        assert_eq!(told, [0, 1, 3].into_iter().collect());
    }
}
