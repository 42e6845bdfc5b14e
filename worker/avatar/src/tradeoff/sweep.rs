//! Measurement of the same views with many settings.

use super::curve::{Curve, Machine, Point, SizeCheck, VERSION};
use super::pareto::front;
use crate::evaluate::psnr;
use crate::evaluate::score::{EQUAL, unit};
use crate::render::{RenderError, RenderSettings, RenderView, Rendered, Renderer};
use std::time::Instant;
use thiserror::Error;

/// Sizes at which predictions are checked, relative to the measured one.
const CHECKED_SIZES: &[f64] = &[0.5, 1.5];
/// Side of a frame that takes no time except for posing the body, pixels.
const TINY_SIDE: u32 = 4;
/// Number of settings of the front whose predictions are checked.
const CHECKED_SETTINGS: usize = 3;

/// A view of a sweep.
#[derive(Clone, Debug)]
pub struct SweepView {
    /// The view.
    pub view: RenderView,
    /// Picture of a camera with this view, `[H, W, 3]` 8-bit colours over the view's background.
    pub truth: Option<Vec<u8>>,
}

/// Options of a sweep.
#[derive(Clone, Debug)]
pub struct SweepOptions {
    /// Settings to measure; fidelity is relative to the first.
    pub settings: Vec<RenderSettings>,
    /// Timed frames per view and setting.
    pub repeats: usize,
    /// Machine of the measurement.
    pub machine: Machine,
    /// Current time, seconds since 1970.
    pub unix_seconds: u64,
}

impl SweepOptions {
    /// Number of frames that a sweep over `views` renders.
    pub fn frames(&self, views: usize) -> usize {
        // One round with the first settings, and one as a warm-up.
        views * (1 + self.settings.len() * (1 + self.repeats.max(1)))
    }
}

/// Error of a sweep.
#[derive(Debug, Error)]
pub enum SweepError {
    /// A view can't be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// Views or settings are missing.
    #[error("a sweep needs {0}")]
    Empty(&'static str),
    /// No view shows the body.
    #[error("no ray of any view meets the body: there is no time to measure")]
    NobodySeen,
    /// A picture does not have the size of its view.
    #[error("view {0}: the picture to compare with does not have the view's size")]
    Truth(usize),
}

/// Renders all `views` with all settings and measures time and fidelity. Rounds over all settings
/// are repeated, not single frames, so that other load of the machine affects all settings
/// equally. `progress` receives the numbers of finished and of all frames; its errors stop the
/// sweep.
///
/// # Errors
/// If a view can't be rendered, there is nothing to measure, or `progress` fails.
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
    let total = options.frames(views.len());
    let mut done = 0;
    let mut tick = |count: usize| {
        done += count;
        progress(done.min(total), total)
    };
    renderer.set(own).map_err(SweepError::from)?;
    let full = frames(renderer, &plain)?;
    tick(views.len())?;
    // The first round is a warm-up without timing, and measures fidelity.
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
        sum += renderer.rays(&(*view).clone().into())?;
    }
    Ok(sum as f64 / views.len() as f64)
}

/// Frames with 8-bit colours, as in files.
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

/// Median seconds of a tiny frame with the camera turned away from the body: the time of posing.
/// The frame is tiny because the search for rays takes time in proportion to pixels. 0 if the
/// camera is inside the body's box and still sees it.
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
    if renderer.rays(&away.clone().into())? > 0 {
        return Ok(0.0);
    }
    let times = (0..repeats).map(|_| timed(renderer, &away));
    Ok(median(times.collect::<Result<_, _>>()?))
}

/// Predictions for views of other sizes, with the measured times.
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

/// Mean fidelity to the truth; absent unless every view has one.
fn against_truth(views: &[SweepView], seen: &[Vec<u8>]) -> Option<f64> {
    let figures = views.iter().zip(seen);
    let figures: Option<Vec<f64>> = figures
        .map(|(view, seen)| Some(fidelity(view.truth.as_ref()?, seen)))
        .collect();
    Some(mean(figures?.into_iter()))
}

/// PSNR of 8-bit frames, dB, at most [`EQUAL`].
pub fn fidelity(truth: &[u8], seen: &[u8]) -> f64 {
    psnr(&unit(truth), &unit(seen)).min(EQUAL)
}

/// # Panics
/// If there are no values.
fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len();
    assert!(count > 0, "a mean of no values");
    values.sum::<f64>() / count as f64
}

/// # Panics
/// If there are no values.
fn median(mut values: Vec<f64>) -> f64 {
    assert!(!values.is_empty(), "a median of no values");
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
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
    }

    #[test]
    fn equal_frames_have_a_finite_figure() {
        assert_eq!(fidelity(&[3; 12], &[3; 12]), EQUAL);
        assert!(fidelity(&[0; 12], &[255; 12]).abs() < 1e-9);
    }
}
