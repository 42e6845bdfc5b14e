//! Measurement of the same views with many settings.

use super::curve::{Curve, Machine, Point, SizeCheck, VERSION};
use super::pareto::front;
use crate::evaluate::score::{EQUAL, unit};
use crate::evaluate::{psnr, psnr_in_box};
use crate::render::{FrameExposure, RenderError, RenderSettings, RenderView, Rendered, Renderer};
use std::time::Instant;
use thiserror::Error;
use yoto_capture::{FrameImage, mask_box};

/// Sizes at which predictions are checked, relative to the measured one.
const CHECKED_SIZES: &[f64] = &[0.5, 1.5];
/// Side of a frame that takes no time except for posing the body, pixels.
const TINY_SIDE: u32 = 4;
/// Number of settings of the front whose predictions are checked.
const CHECKED_SETTINGS: usize = 3;
/// Size at which frames without rays are measured a second time, relative to the views: their time is a fixed part, which
/// grows with the splats, and one in proportion to the rays.
const SECOND_SIZE: f64 = 0.5;

/// A view of a sweep.
#[derive(Clone, Debug)]
pub struct SweepView {
    /// The view.
    pub view: RenderView,
    /// Picture of a camera with this view, over the view's background.
    pub truth: Option<FrameImage>,
    /// Exposure of that picture relative to others of the person's capture.
    pub exposure: FrameExposure,
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
        // One round with the first settings, and one as a warm-up. Frames of a second size are not counted.
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
    let full = rendered(renderer, &plain)?;
    let full: Vec<Vec<u8>> = full.iter().map(Rendered::to_rgb8).collect();
    tick(views.len())?;
    // The first round is a warm-up without timing, and measures fidelity.
    let mut points = Vec::new();
    for settings in &options.settings {
        renderer.set(settings).map_err(SweepError::from)?;
        let seen = rendered(renderer, &plain)?;
        let plainly: Vec<Vec<u8>> = seen.iter().map(Rendered::to_rgb8).collect();
        let exposed = exposed(views, seen);
        points.push(Point {
            settings: *settings,
            seconds: 0.0,
            fixed_seconds: None,
            psnr_to_full: mean(full.iter().zip(&plainly).map(|(a, b)| fidelity(a, b))),
            psnr: against_truth(views, &exposed, |truth, seen| {
                Some(fidelity(&truth.rgb, seen))
            }),
            psnr_mask_box: against_truth(views, &exposed, fidelity_in_box),
        });
        tick(views.len())?;
    }
    let smaller = match renderer.config().appearance.march() {
        Some(_) => Vec::new(),
        None => resized(&plain, SECOND_SIZE),
    };
    let mut times = vec![vec![Vec::new(); views.len()]; points.len()];
    let mut times_smaller = vec![vec![Vec::new(); smaller.len()]; points.len()];
    for _ in 0..repeats {
        for (i, point) in points.iter().enumerate() {
            renderer.set(&point.settings).map_err(SweepError::from)?;
            for (view, times) in plain.iter().zip(&mut times[i]) {
                times.push(timed(renderer, view)?);
            }
            for (view, times) in smaller.iter().zip(&mut times_smaller[i]) {
                times.push(timed(renderer, view)?);
            }
            tick(views.len())?;
        }
    }
    for (point, times) in points.iter_mut().zip(times) {
        point.seconds = mean(times.into_iter().map(median));
    }
    if !smaller.is_empty() {
        let fewer = mean_rays(renderer, &smaller.iter().collect::<Vec<_>>())?;
        for (point, times) in points.iter_mut().zip(times_smaller) {
            let less = mean(times.into_iter().map(median));
            point.fixed_seconds = Some(fixed_part([fewer, less], [rays, point.seconds]));
        }
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
        let size = (camera.width as usize, camera.height as usize);
        let truth = it.truth.as_ref();
        truth.is_some_and(|truth| (truth.width, truth.height) != size)
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

fn rendered(renderer: &Renderer, views: &[&RenderView]) -> Result<Vec<Rendered>, SweepError> {
    let frame = |view: &&RenderView| Ok(renderer.render(view)?);
    views.iter().map(frame).collect()
}

/// The frames as the films of `views` are exposed, with 8-bit colours as in files.
fn exposed(views: &[SweepView], frames: Vec<Rendered>) -> Vec<Vec<u8>> {
    let pairs = views.iter().zip(frames);
    let exposed = pairs.map(|(view, mut frame)| {
        view.exposure.expose(&mut frame);
        frame.to_rgb8()
    });
    exposed.collect()
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

/// The views at `share` of their size.
fn resized(views: &[&RenderView], share: f64) -> Vec<RenderView> {
    let side = |full: u32| ((f64::from(full) * share).round() as u32).max(1);
    let resized = |view: &&RenderView| RenderView {
        camera: view
            .camera
            .resized(side(view.camera.width), side(view.camera.height)),
        ..(*view).clone()
    };
    views.iter().map(resized).collect()
}

/// Mean over `views` of the median seconds of each.
fn mean_seconds(
    renderer: &Renderer,
    views: &[RenderView],
    repeats: usize,
) -> Result<f64, SweepError> {
    let mut seconds = Vec::new();
    for view in views {
        let times = (0..repeats).map(|_| timed(renderer, view));
        seconds.push(median(times.collect::<Result<_, _>>()?));
    }
    Ok(mean(seconds.into_iter()))
}

/// The part of a time that does not depend on the rays, from the rays and seconds of smaller and of larger views: where
/// the line through them meets 0 rays.
fn fixed_part([fewer, less]: [f64; 2], [rays, seconds]: [f64; 2]) -> f64 {
    if fewer >= rays {
        return 0.0;
    }
    let slope = (seconds - less) / (rays - fewer);
    (seconds - slope * rays).clamp(0.0, seconds)
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
        let views = resized(views, *share);
        let plain: Vec<&RenderView> = views.iter().collect();
        let rays = mean_rays(renderer, &plain)?;
        for &index in &chosen {
            let point = &curve.points[index];
            renderer.set(&point.settings)?;
            found.push(SizeCheck {
                settings: point.settings,
                rays,
                predicted: curve.predict(point, rays),
                measured: mean_seconds(renderer, &views, repeats)?,
            });
        }
    }
    Ok(found)
}

/// Mean over views of the `measure` of their truth and frame; absent unless every view has one.
fn against_truth(
    views: &[SweepView],
    seen: &[Vec<u8>],
    measure: impl Fn(&FrameImage, &[u8]) -> Option<f64>,
) -> Option<f64> {
    let figures = views.iter().zip(seen);
    let figures: Option<Vec<f64>> = figures
        .map(|(view, seen)| measure(view.truth.as_ref()?, seen))
        .collect();
    Some(mean(figures?.into_iter()))
}

/// PSNR inside the box of the mask, dB; `None` without a mask.
fn fidelity_in_box(truth: &FrameImage, seen: &[u8]) -> Option<f64> {
    let region = mask_box(&truth.mask, truth.width, truth.height)?;
    let found = psnr_in_box(&unit(&truth.rgb), &unit(seen), truth.width, &region);
    Some(found.min(EQUAL))
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
    fn the_fixed_part_is_what_is_left_without_rays() {
        assert_eq!(fixed_part([100.0, 3.0], [400.0, 6.0]), 2.0);
        // Noise: neither below nothing nor above the whole.
        assert_eq!(fixed_part([100.0, 1.0], [400.0, 6.0]), 0.0);
        assert_eq!(fixed_part([100.0, 7.0], [400.0, 6.0]), 6.0);
        assert_eq!(fixed_part([400.0, 6.0], [400.0, 6.0]), 0.0);
    }

    #[test]
    fn equal_frames_have_a_finite_figure() {
        assert_eq!(fidelity(&[3; 12], &[3; 12]), EQUAL);
        assert!(fidelity(&[0; 12], &[255; 12]).abs() < 1e-9);
    }
}
