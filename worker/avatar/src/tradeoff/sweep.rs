//! Measuring: the same views with each of many settings.

use super::curve::{Curve, Machine, Point, SizeCheck, VERSION};
use super::pareto::front;
use crate::evaluate::psnr;
use crate::evaluate::score::{EQUAL, unit};
use crate::render::{RenderError, RenderSettings, RenderView, Rendered, Renderer};
use std::time::Instant;
use thiserror::Error;

/// Other sizes that predictions are checked at, as shares of the measured one.
const CHECKED_SIZES: &[f64] = &[0.5, 1.5];
/// Side of a frame that costs nothing but its posing, pixels.
const TINY_SIDE: u32 = 4;
/// Settings of the front whose predictions are checked.
const CHECKED_SETTINGS: usize = 3;

/// A view to measure with.
#[derive(Clone, Debug)]
pub struct SweepView {
    /// What is rendered.
    pub view: RenderView,
    /// What a camera saw there, `[H, W, 3]` 8-bit colours over the view's background.
    pub truth: Option<Vec<u8>>,
}

/// How to measure.
#[derive(Clone, Debug)]
pub struct SweepOptions {
    /// The first must be the reference of "against the full-quality render".
    pub settings: Vec<RenderSettings>,
    /// Timed frames of each view and setting.
    pub repeats: usize,
    /// Where this runs.
    pub machine: Machine,
    /// Now, seconds since 1970.
    pub unix_seconds: u64,
}

/// Why nothing was measured.
#[derive(Debug, Error)]
pub enum SweepError {
    /// The model can't render a view.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// There is nothing to measure with.
    #[error("a sweep needs {0}")]
    Empty(&'static str),
    /// No view shows the body.
    #[error("no ray of any view meets the body: there is no time to measure")]
    NobodySeen,
    /// A picture of another size than its view.
    #[error("view {0}: the picture to compare with is not of the view's size")]
    Truth(usize),
}

/// Renders all `views` with all settings, and says how long and how good. Rounds over the
/// settings are repeated, not single frames: what else the machine does meanwhile then falls
/// on all settings alike. `progress` hears (frames done, frames in all) and may stop it.
///
/// # Errors
/// When a view can't be rendered, there is nothing to measure, or `progress` says stop.
pub fn sweep<E: From<SweepError>>(
    renderer: &mut Renderer,
    views: &[SweepView],
    options: &SweepOptions,
    mut progress: impl FnMut(usize, usize) -> Result<(), E>,
) -> Result<Curve, E> {
    let before = renderer.settings();
    let curve = measure(renderer, views, options, &mut progress);
    renderer.set(&before).map_err(SweepError::from)?;
    curve
}

fn measure<E: From<SweepError>>(
    renderer: &mut Renderer,
    views: &[SweepView],
    options: &SweepOptions,
    progress: &mut impl FnMut(usize, usize) -> Result<(), E>,
) -> Result<Curve, E> {
    let first = views.first().ok_or(SweepError::Empty("a view"))?;
    let own = options.settings.first();
    let own = own.ok_or(SweepError::Empty("settings"))?;
    check_truths(views)?;
    let plain: Vec<&RenderView> = views.iter().map(|it| &it.view).collect();
    let rays = mean_rays(renderer, &plain)?;
    if rays == 0.0 {
        return Err(SweepError::NobodySeen.into());
    }
    let repeats = options.repeats.max(1);
    let total = views.len() * (1 + options.settings.len() * (1 + repeats));
    let mut done = 0;
    let mut tick = |count: usize| {
        done += count;
        progress(done.min(total), total)
    };
    renderer.set(own).map_err(SweepError::from)?;
    let full = frames(renderer, &plain)?;
    tick(views.len())?;
    // The first round warms up and is not timed; fidelity needs no second one.
    let mut points = Vec::new();
    for settings in &options.settings {
        renderer.set(settings).map_err(SweepError::from)?;
        let seen = frames(renderer, &plain)?;
        points.push(Point {
            settings: *settings,
            seconds: 0.0,
            psnr_to_full: mean(full.iter().zip(&seen).map(|(a, b)| fidelity(a, b))),
            psnr: against_truth(views, &seen),
        });
        tick(views.len())?;
    }
    let mut times = vec![vec![Vec::new(); views.len()]; points.len()];
    for _ in 0..repeats {
        for (point, times) in points.iter().zip(&mut times) {
            renderer.set(&point.settings).map_err(SweepError::from)?;
            for (view, times) in plain.iter().zip(times) {
                times.push(timed(renderer, view)?);
            }
            tick(views.len())?;
        }
    }
    for (point, times) in points.iter_mut().zip(times) {
        point.seconds = mean(times.into_iter().map(median));
    }
    renderer.set(own).map_err(SweepError::from)?;
    let mut curve = Curve {
        version: VERSION,
        unix_seconds: options.unix_seconds,
        machine: options.machine.clone(),
        tier: renderer.config().tier.clone(),
        size: first.view.camera.width.max(first.view.camera.height),
        views: views.len(),
        repeats,
        rays,
        fixed_seconds: fixed_seconds(renderer, &first.view, repeats)?,
        points,
        checks: Vec::new(),
    };
    curve.checks = checks(renderer, &curve, &plain, repeats)?;
    progress(total, total)?;
    Ok(curve)
}

fn check_truths(views: &[SweepView]) -> Result<(), SweepError> {
    let wrong = |it: &SweepView| {
        let camera = &it.view.camera;
        let bytes = 3 * camera.width as usize * camera.height as usize;
        it.truth.as_ref().is_some_and(|truth| truth.len() != bytes)
    };
    match views.iter().position(wrong) {
        Some(view) => Err(SweepError::Truth(view)),
        None => Ok(()),
    }
}

fn mean_rays(renderer: &Renderer, views: &[&RenderView]) -> Result<f64, SweepError> {
    let mut sum = 0;
    for view in views {
        sum += renderer.rays(view)?;
    }
    Ok(sum as f64 / views.len() as f64)
}

/// 8-bit frames, as files would hold them.
fn frames(renderer: &Renderer, views: &[&RenderView]) -> Result<Vec<Vec<u8>>, SweepError> {
    let frame = |view: &&RenderView| Ok(renderer.render(view)?.to_rgb8());
    views.iter().map(frame).collect()
}

fn timed(renderer: &Renderer, view: &RenderView) -> Result<f64, SweepError> {
    let began = Instant::now();
    let frame: Rendered = renderer.render(view)?;
    let seconds = began.elapsed().as_secs_f64();
    drop(frame);
    Ok(seconds)
}

/// Median seconds of a tiny frame whose camera has turned its back on the body: what is left is
/// posing. Looking for rays is no part of it, since that grows with the pixels as all else does.
/// 0 when the camera still sees the body, being inside of it.
fn fixed_seconds(
    renderer: &Renderer,
    view: &RenderView,
    repeats: usize,
) -> Result<f64, SweepError> {
    let mut away = RenderView {
        camera: view.camera.resized(TINY_SIDE, TINY_SIDE),
        ..view.clone()
    };
    for row in [0, 2] {
        away.camera.e[row] = away.camera.e[row].map(|value| -value);
    }
    if renderer.rays(&away)? > 0 {
        return Ok(0.0);
    }
    let times = (0..repeats).map(|_| timed(renderer, &away));
    Ok(median(times.collect::<Result<_, _>>()?))
}

/// Predictions for views of other sizes beside what they take.
fn checks(
    renderer: &mut Renderer,
    curve: &Curve,
    views: &[&RenderView],
    repeats: usize,
) -> Result<Vec<SizeCheck>, SweepError> {
    let front = front(&curve.points, |it| (it.seconds, it.fidelity()));
    let mut chosen: Vec<usize> = (0..CHECKED_SETTINGS)
        .filter_map(|i| front.get(i * front.len().saturating_sub(1) / (CHECKED_SETTINGS - 1)))
        .copied()
        .collect();
    chosen.dedup();
    let mut found = Vec::new();
    for share in CHECKED_SIZES {
        let side = |full: u32| ((f64::from(full) * share).round() as u32).max(1);
        let resized = |view: &&RenderView| RenderView {
            camera: view
                .camera
                .resized(side(view.camera.width), side(view.camera.height)),
            ..(*view).clone()
        };
        let views: Vec<RenderView> = views.iter().map(resized).collect();
        let plain: Vec<&RenderView> = views.iter().collect();
        let rays = mean_rays(renderer, &plain)?;
        for &index in &chosen {
            let point = &curve.points[index];
            renderer.set(&point.settings)?;
            let mut seconds = Vec::new();
            for view in &views {
                let times = (0..repeats).map(|_| timed(renderer, view));
                seconds.push(median(times.collect::<Result<_, _>>()?));
            }
            found.push(SizeCheck {
                settings: point.settings,
                rays,
                predicted: curve.predict(point, rays),
                measured: mean(seconds.into_iter()),
            });
        }
    }
    Ok(found)
}

/// The mean over views with a truth; absent unless each has one.
fn against_truth(views: &[SweepView], seen: &[Vec<u8>]) -> Option<f64> {
    let figures = views.iter().zip(seen);
    let figures: Option<Vec<f64>> = figures
        .map(|(view, seen)| Some(fidelity(view.truth.as_ref()?, seen)))
        .collect();
    Some(mean(figures?.into_iter()))
}

/// PSNR of 8-bit frames, dB, at most what equal ones count as.
pub fn fidelity(truth: &[u8], seen: &[u8]) -> f64 {
    psnr(&unit(truth), &unit(seen)).min(EQUAL)
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1);
    values.sum::<f64>() / count as f64
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => 0.0,
        count if count.is_multiple_of(2) => (values[middle - 1] + values[middle]) / 2.0,
        _ => values[middle],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_median_is_not_moved_by_one_slow_frame() {
        assert_eq!(median(vec![1.0, 99.0, 2.0]), 2.0);
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(median(Vec::new()), 0.0);
    }

    #[test]
    fn equal_frames_have_a_finite_figure() {
        assert_eq!(fidelity(&[3; 12], &[3; 12]), EQUAL);
        assert!(fidelity(&[0; 12], &[255; 12]).abs() < 1e-9);
    }
}
