//! Frames in waves against the plain form: every sample warped and evaluated at once,
//! composited by Burn's own tensor operations.

use super::*;
use crate::ops::composite::{RaySamples, reference};
use burn::tensor::Device;
use yoto_capture::synthetic::SyntheticPerson;

const SIDE: u32 = 40;
const BACKGROUND: [f32; 3] = [0.2, 0.5, 0.9];

fn config() -> ModelConfig {
    let mut config = ModelConfig::named("draft", "yoto").expect("a tier");
    // What a fresh model is made of is thin, and some rays should meet something opaque.
    config.canonical.density_scale = 5000.0;
    config.march.epsilon = 0.0;
    config.march.min_transmittance = 0.0;
    config.march.occupancy_cells = 0;
    config
}

/// A fresh model: fog wherever bones weigh.
fn renderer(config: ModelConfig) -> (Renderer, RenderView) {
    let device = Device::flex();
    let person = &SyntheticPerson::cast(1, 7)[0];
    let (track, _) = person.capture(1, SIDE);
    let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
    let avatar = Avatar::new(&config, 1, skeleton.parents.len(), 5, &device);
    let body = Body::new(skeleton, &config, &device);
    let occupancy = Occupancy::new(&body.grid, &config.march);
    let view = RenderView {
        slot: 0,
        pose: person.unseen_motion(4)[2].clone(),
        camera: SyntheticPerson::train_camera(SIDE),
        background: BACKGROUND,
    };
    let bodies = vec![Some(body)];
    let renderer = Renderer::new(config, avatar, bodies, vec![occupancy], 1.0);
    (renderer, view)
}

/// Colours, opacities and depths.
fn plain(renderer: &Renderer, view: &RenderView) -> [Vec<f32>; 3] {
    let config = &renderer.config;
    let body = renderer.bodies[0].as_ref().expect("a body");
    let posed = renderer.avatar.pose(config, body, 0, &view.pose, 1.0);
    let sight = BodyView::new(&body.skeleton, &view.pose, &view.camera);
    let side = SIDE as usize;
    let rays: Vec<Option<Ray>> = (0..side * side)
        .map(|i| sight.ray((i % side) as f64 + 0.5, (i / side) as f64 + 0.5))
        .collect();
    let (weights, transforms) = (
        read(posed.weights.clone()).expect("read"),
        read(posed.transforms.clone()).expect("read"),
    );
    let volume = Volume {
        weights: &weights,
        transforms: &transforms,
        grid: &body.grid,
        unposing: config.motion.unposing,
        occupancy: None,
        step: None,
    };
    let samples = march(&rays, &config.march, None::<&mut ChaCha8Rng>, &volume).all();
    let points = TensorData::new(samples.points.clone(), [samples.live(), 3]);
    let points = Tensor::from_data(points, &Device::flex());
    let (fields, _, likelihood) = renderer.avatar.evaluate(config, body, &posed, points, None);
    let along = RaySamples {
        starts: samples.starts().into(),
        steps: samples.steps.as_slice().into(),
        depths: samples.depths.as_slice().into(),
        min_transmittance: 0.0,
        subsampling: None,
    };
    let seen = reference::composite(fields.rgb, fields.density, likelihood, &along);
    let mut parts = [Vec::new(), Vec::new(), Vec::new()];
    for row in read(seen).expect("read").as_chunks::<5>().0 {
        parts[0].extend((0..3).map(|c| row[c] + (1.0 - row[3]) * BACKGROUND[c]));
        parts[1].push(row[3]);
        parts[2].push(row[4]);
    }
    parts
}

fn largest_difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f32::max)
}

#[test]
fn a_frame_with_nothing_left_out_is_the_plain_forms() {
    let (renderer, view) = renderer(config());
    let frame = renderer.render(&view).expect("renders");
    assert!(frame.counts.rays > 100);
    assert_eq!(frame.counts.evaluated, frame.counts.placed);
    assert!(frame.alpha.iter().any(|a| *a > 0.99), "somebody opaque");
    let [rgb, alpha, depth] = plain(&renderer, &view);
    for (ours, plain) in [
        (&frame.rgb, &rgb),
        (&frame.alpha, &alpha),
        (&frame.depth, &depth),
    ] {
        // Warped along rays and alone, points differ by a rounding, which a density that
        // reaches thousands per metre makes more of.
        let worst = largest_difference(ours, plain);
        assert!(worst < 5e-5, "{worst:e}");
    }
}

#[test]
fn a_stopped_frame_is_wrong_by_its_bound_at_most_and_evaluates_less() {
    let (whole, view) = renderer(config());
    let whole = whole.render(&view).expect("renders");
    let mut bounded = config();
    bounded.march.min_transmittance = 1e-2;
    let stopped = renderer(bounded).0.render(&view).expect("renders");
    assert!(
        stopped.counts.likely == whole.counts.likely
            && stopped.counts.evaluated < whole.counts.evaluated,
        "{:?}",
        stopped.counts
    );
    let worst = largest_difference(&stopped.rgb, &whole.rgb);
    assert!(worst > 1e-5, "something was behind the bound");
    assert!(worst <= 1e-2 + 1e-6, "{worst:e}");
}

#[test]
fn a_grid_that_knows_nothing_changes_nothing() {
    let (without, view) = renderer(config());
    let mut unknowing = config();
    unknowing.march.occupancy_cells = 32;
    let without = without.render(&view).expect("renders");
    let with = renderer(unknowing).0.render(&view).expect("renders");
    assert_eq!((without.rgb, without.counts), (with.rgb, with.counts));
}

#[test]
fn a_frame_that_nobody_wants_any_longer_is_left() {
    let (renderer, mut view) = renderer(config());
    // Several batches of rays.
    view.camera = SyntheticPerson::train_camera(160);
    let mut shares = Vec::new();
    let whole = renderer.render_while(&view, &mut |share| {
        shares.push(share);
        true
    });
    whole.expect("renders");
    assert!(shares.len() > 1 && shares[0] == 0.0 && shares.is_sorted());
    assert!(shares.iter().all(|share| *share < 1.0), "{shares:?}");
    let mut asked = 0;
    let left = renderer.render_while(&view, &mut |_| {
        asked += 1;
        asked < 2
    });
    assert!(matches!(left, Err(RenderError::Stopped)));
    assert_eq!(asked, 2);
}

#[test]
fn colours_of_a_transparent_frame_are_the_person_s_own() {
    let frame = Rendered {
        width: 3,
        height: 1,
        rgb: vec![0.4, 0.2, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5, 0.25],
        alpha: vec![0.5, 0.0, 1.0],
        depth: vec![0.0; 3],
        counts: SampleCounts::default(),
    };
    let expected = [204, 102, 0, 128, 0, 0, 0, 0, 255, 128, 64, 255];
    assert_eq!(frame.to_rgba8(), expected);
}
