//! Frames in waves against the plain form: every sample warped and evaluated at once,
//! composited by Burn's own tensor operations.

use super::*;
use crate::host::read;
use crate::render::march::{Volume, march};
use crate::render::view::{Actor, Light};
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use yoto_capture::body_box::{BodyView, Ray};
use yoto_ops::composite::{RaySamples, reference};
use yoto_synthetic::SyntheticPerson;

const SIDE: u32 = 40;
const BACKGROUND: [f32; 3] = [0.2, 0.5, 0.9];

fn config() -> ModelConfig {
    let mut config = ModelConfig::named("draft", "yoto").expect("a tier");
    // What a fresh model is made of is thin, and some rays should meet something opaque.
    let field = config.appearance.field_mut().expect("a field");
    field.canonical.density_scale = 5000.0;
    field.march.epsilon = 0.0;
    field.march.min_transmittance = 0.0;
    field.march.occupancy_cells = 0;
    config
}

/// A fresh model: fog wherever bones weigh.
fn renderer(config: ModelConfig) -> (Renderer, RenderView) {
    let device = Device::flex();
    let person = &SyntheticPerson::cast(1, 7)[0];
    let (track, _) = person.capture(1, SIDE);
    let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
    let avatar = Avatar::new(&config, 1, skeleton.parents.len(), 5, &device);
    let body = CanonicalBody::new(skeleton, &config, &device);
    let occupancy = Occupancy::new(&body.grid, config.appearance.march().expect("rays"));
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
    let body_view = BodyView::new(&body.skeleton, &view.pose, &view.camera);
    let side = SIDE as usize;
    let rays: Vec<Option<Ray>> = (0..side * side)
        .map(|i| body_view.ray((i % side) as f64 + 0.5, (i / side) as f64 + 0.5))
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
    let samples = march(
        &rays,
        config.appearance.march().expect("rays"),
        None::<&mut ChaCha8Rng>,
        &volume,
    )
    .all();
    let points = TensorData::new(samples.points.clone(), [samples.live(), 3]);
    let points = Tensor::from_data(points, &Device::flex());
    let AvatarAppearance::Field(field) = renderer.avatar.appearance(config) else {
        panic!("the tier has a field");
    };
    let (fields, _, likelihood) = field.evaluate(body, &posed, points, None);
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
    bounded
        .appearance
        .field_mut()
        .expect("a field")
        .march
        .min_transmittance = 1e-2;
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
    unknowing
        .appearance
        .field_mut()
        .expect("a field")
        .march
        .occupancy_cells = 32;
    let without = without.render(&view).expect("renders");
    let with = renderer(unknowing).0.render(&view).expect("renders");
    assert_eq!((without.rgb, without.counts), (with.rgb, with.counts));
}

#[test]
fn a_frame_that_nobody_wants_any_longer_is_left() {
    let (renderer, mut view) = renderer(config());
    // Several batches of rays.
    view.camera = SyntheticPerson::train_camera(160);
    let view = view.into();
    let mut shares = Vec::new();
    let whole = renderer.render_scene(&view, &mut |share| {
        shares.push(share);
        true
    });
    whole.expect("renders");
    assert!(shares.len() > 1 && shares[0] == 0.0 && shares.is_sorted());
    assert!(shares.iter().all(|share| *share < 1.0), "{shares:?}");
    let mut asked = 0;
    let left = renderer.render_scene(&view, &mut |_| {
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

/// The view's person twice, the second time moved by `metres` towards the camera and 0.15 m aside.
fn pair(view: &RenderView, metres: f64) -> SceneView {
    let [aside, _, away] = [0, 1, 2].map(|row| view.camera.e[row]);
    let moved = |axis: usize| {
        let by = 0.15 * aside[axis] - metres * away[axis];
        (f64::from(view.pose.translation[axis]) + by) as f32
    };
    let mut nearer = view.pose.clone();
    nearer.translation = std::array::from_fn(moved);
    let actor = |pose: &Pose| Actor {
        model: 0,
        slot: view.slot,
        pose: pose.clone(),
        light: Light::Own,
    };
    SceneView {
        actors: vec![actor(&view.pose), actor(&nearer)],
        camera: view.camera.clone(),
        background: view.background,
    }
}

/// The picture of some of a scene's actors.
fn of(renderer: &Renderer, scene: &SceneView, places: &[usize]) -> Rendered {
    let mut part = scene.clone();
    part.actors = places.iter().map(|it| scene.actors[*it].clone()).collect();
    renderer
        .render_scene(&part, &mut |_| true)
        .expect("renders")
}

#[test]
fn a_person_in_front_hides_what_is_behind_by_their_opacity() {
    let (renderer, view) = renderer(config());
    let scene = pair(&view, 1.2);
    let both = of(&renderer, &scene, &[0, 1]);
    let mut black = scene.clone();
    black.background = [0.0; 3];
    let front = of(&renderer, &black, &[1]);
    let back = of(&renderer, &scene, &[0]);
    let mut hidden = 0;
    for i in 0..both.alpha.len() {
        let through = 1.0 - front.alpha[i];
        let alpha = front.alpha[i] + through * back.alpha[i];
        assert!((both.alpha[i] - alpha).abs() < 1e-5);
        let depth = front.depth[i] + through * back.depth[i];
        assert!((both.depth[i] - depth).abs() < 1e-4);
        for c in 0..3 {
            let rgb = front.rgb[3 * i + c] + through * back.rgb[3 * i + c];
            assert!((both.rgb[3 * i + c] - rgb).abs() < 1e-5);
        }
        hidden += usize::from(front.alpha[i] > 0.2 && back.alpha[i] > 0.2);
    }
    assert!(hidden > 20, "{hidden} pixels show both");
    assert_eq!(
        renderer.rays(&scene).expect("rays") as u64,
        both.counts.rays
    );
}

#[test]
fn people_whose_boxes_overlap_are_merged_whatever_their_order() {
    let (renderer, view) = renderer(config());
    let scene = pair(&view, 0.1);
    let one = of(&renderer, &scene, &[0, 1]);
    let other = of(&renderer, &scene, &[1, 0]);
    let apart = one.rgb.iter().zip(&other.rgb).map(|(a, b)| (a - b).abs());
    assert!(apart.fold(0.0, f32::max) < 1e-6);
    // Neither is in front of the other as a whole.
    let front = of(&renderer, &scene, &[1]);
    let back = of(&renderer, &scene, &[0]);
    let over = |i: usize| front.depth[i] + (1.0 - front.alpha[i]) * back.depth[i];
    let merged = (0..one.depth.len()).filter(|i| (one.depth[*i] - over(*i)).abs() > 1e-4);
    assert!(merged.count() > 20);
}

#[test]
fn nobody_is_a_picture_of_the_background() {
    let (renderer, view) = renderer(config());
    let nobody = of(&renderer, &view.into(), &[]);
    assert_eq!(nobody.rgb, BACKGROUND.repeat((SIDE * SIDE) as usize));
    assert!(nobody.alpha.iter().all(|alpha| *alpha == 0.0));
}

#[test]
fn a_field_in_another_light_is_refused() {
    let (renderer, view) = renderer(config());
    let mut scene = SceneView::from(view);
    scene.actors[0].light = Light::Neutral;
    let refused = renderer.render_scene(&scene, &mut |_| true);
    assert!(matches!(refused, Err(RenderError::NoLight)));
}
