//! One complete training step of the small model: the colours of its rays, the loss, the gradients
//! of all parameters, and the parameters after Adam.

use crate::parity::case::Case;
use crate::parity::check::{Check, by_path, relative_error};
use crate::parity::small;
use burn::optim::GradientsParams;
use rand_chacha::ChaCha8Rng;
use yoto_avatar::config::{Encoding, OptimiseConfig};
use yoto_avatar::loss::PatchObjective;
use yoto_avatar::motion::body::CanonicalBody;
use yoto_avatar::train::batch::{Batch, Scene, outcome};
use yoto_avatar::train::optimiser;
use yoto_capture::body_box::BodyView;
use yoto_capture::camera::Camera;

/// Bound on values of a complete step, in which rounding errors pass through all parts.
const STEP_VALUES: f64 = 1e-5;
/// Bound on its gradients.
const STEP_GRADIENTS: f64 = 1e-4;
/// Adam's first step is nearly the rate times the sign of the gradient, so rounding decides where
/// the gradient is tiny. After the step, parameters are compared where the gradient is at least
/// this share of the largest of its tensor.
const DECIDED: f64 = 1e-3;

#[test]
fn a_training_step() {
    step(Case::read("step-fourier"), small::FOURIER);
    step(Case::read("step-hash"), small::HASH);
}

fn camera(case: &Case) -> Camera {
    let (k, e) = (case.numbers("intrinsics"), case.numbers("extrinsics"));
    let size = case.numbers("width")[0] as u32;
    Camera {
        width: size,
        height: size,
        k: std::array::from_fn(|i| std::array::from_fn(|j| k[3 * i + j])),
        e: std::array::from_fn(|i| std::array::from_fn(|j| e[4 * i + j])),
    }
}

fn step(case: Case, encoding: Encoding) {
    let device = small::device();
    let config = small::config(encoding);
    let avatar = small::avatar(&config);
    let body = CanonicalBody::new(case.skeleton(), &config, &device);
    let pose = case.pose();
    let body_view = BodyView::new(&body.skeleton, &pose, &camera(&case));
    let pixels = case.numbers("pixels").chunks_exact(2);
    let batch = Batch {
        rays: pixels.map(|p| body_view.ray(p[0], p[1])).collect(),
        patch_size: case.shape("truth")[1].isqrt(),
        truth: case.singles("truth"),
        coverage: vec![1.0; case.numbers("pixels").len() / 2],
        background: case.vector("background"),
    };
    assert!(batch.rays.contains(&None), "rays that miss are part of it");
    let scene = Scene {
        config: &config,
        body: &body,
        slot: 0,
        pose: &pose,
        schedule_progress: small::PROGRESS,
        step: 0,
        occupancy: None,
    };
    let objective =
        PatchObjective::without_lpips(config.optimise.ssim_weight, batch.patch_size, &device);
    let outcome = outcome(&avatar, &scene, &batch, &objective, None::<&mut ChaCha8Rng>)
        .expect("a device that works")
        .expect("rays that meet the body");

    let mut check = Check::new(&case);
    let grads = GradientsParams::from_grads(outcome.loss.backward(), &avatar);
    check.value("loss", outcome.loss);
    check.value("rgb", outcome.seen.rgb);
    check.value("alpha", outcome.seen.alpha);
    check.value("depth", outcome.seen.depth);
    check.parameters(&avatar, &grads);

    let before = by_path(&avatar, None);
    let mut after = by_path(&optimiser(&config).step(1.0, avatar, grads), None);
    after.remove(small::SHARED_TABLE);
    assert_eq!(case.names("after.").len(), after.len());
    for (path, ours) in &after {
        let rate = rate(path, &config.optimise);
        let error = moved(&case, path, &before[path], ours, rate);
        check.measured(&format!("after.{path}"), error);
    }
    check.within(STEP_VALUES, STEP_GRADIENTS);
}

/// The error of a parameter after Adam's step, where the gradient is large enough; elsewhere, it
/// may have moved by the rate at most.
fn moved(case: &Case, path: &str, before: &[f32], after: &[f32], rate: f64) -> f64 {
    let gradient = case.numbers(&format!("gradient.{path}"));
    let expected = case.numbers(&format!("after.{path}"));
    let largest = gradient.iter().fold(0f64, |m, g| m.max(g.abs()));
    if largest == 0.0 {
        assert_eq!(before, after, "{path} took no part and moved");
        return 0.0;
    }
    let (mut ours, mut wanted) = (Vec::new(), Vec::new());
    for (i, g) in gradient.iter().enumerate() {
        if g.abs() >= DECIDED * largest {
            ours.push(after[i]);
            wanted.push(expected[i]);
        } else {
            let by = f64::from(after[i]) - f64::from(before[i]);
            assert!(by.abs() <= rate * 1.01 + 1e-6, "{path} moved by {by}");
        }
    }
    relative_error(path, &ours, &wanted)
}

/// The learning rate of a parameter's group.
fn rate(path: &str, config: &OptimiseConfig) -> f64 {
    let group = path.split('.').next().unwrap_or_default();
    match group {
        _ if path.starts_with("canonical.tables") => config.table_rate,
        "motion" => config.motion_rate,
        "correction" | "condition" | "non_rigid" => config.slow_rate,
        _ => config.rate,
    }
}
