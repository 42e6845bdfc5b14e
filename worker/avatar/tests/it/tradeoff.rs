//! Settings that replace a model's own, and sweeps over them.

use crate::support;
use burn::tensor::Device;
use yoto_avatar::config::{ModelConfig, Precision};
use yoto_avatar::render::{FrameExposure, RenderError, RenderSettings, RenderView, Renderer};
use yoto_avatar::tradeoff::{
    Axes, Curve, Machine, SweepError, SweepOptions, SweepView, Want, choose, sweep,
};
use yoto_avatar::train::Trainer;
use yoto_capture::FrameImage;
use yoto_capture::camera::{Camera, Pose};
use yoto_synthetic::SyntheticPerson;

const SIZE: u32 = 48;

/// A briefly trained person, and pictures of cameras that were not trained on.
fn trained() -> (Renderer, Vec<SweepView>) {
    let person = SyntheticPerson::cast(1, 7).remove(0);
    let pose = person.motion(8).remove(0);
    let people = vec![support::person(0, &person, 8, SIZE)];
    let config = ModelConfig::named("draft", "yoto").expect("named");
    let mut trainer =
        Trainer::new(config, support::options(80), people, &Device::flex()).expect("starts");
    while !trainer.finished() {
        trainer.step().expect("a step");
    }
    let views = SyntheticPerson::held_out_cameras(SIZE);
    let views = views.iter().take(2).map(|camera| SweepView {
        view: view(&pose, camera),
        truth: Some(person.render(&pose, camera)),
        exposure: FrameExposure::NEUTRAL,
    });
    (trainer.renderer(), views.collect())
}

fn view(pose: &Pose, camera: &Camera) -> RenderView {
    RenderView {
        slot: 0,
        pose: pose.clone(),
        camera: camera.clone(),
        background: [0.0; 3],
    }
}

fn options(settings: Vec<RenderSettings>) -> SweepOptions {
    SweepOptions {
        settings,
        repeats: 1,
        machine: Machine {
            cpu: "test".into(),
            cores: 1,
            device: "test".into(),
        },
        unix_seconds: 5,
    }
}

fn run(
    renderer: &mut Renderer,
    views: &[SweepView],
    settings: Vec<RenderSettings>,
) -> Result<Curve, SweepError> {
    sweep(renderer, views, &options(settings), |_, _| Ok(()))
}

#[test]
fn a_sweep_measures_what_settings_give_up() {
    let (mut renderer, views) = trained();
    let own = renderer.settings();
    let settings = Axes::of(&renderer).settings();
    let mut heard = Vec::new();
    let curve = sweep(
        &mut renderer,
        &views,
        &options(settings.clone()),
        |done, total| {
            heard.push((done, total));
            Ok::<_, SweepError>(())
        },
    )
    .expect("sweeps");
    assert_eq!(renderer.settings(), own, "the renderer is as it was");
    let (done, total) = *heard.last().expect("was heard");
    assert_eq!(done, total);
    assert!(heard.is_sorted());

    assert_eq!(curve.points.len(), settings.len());
    let find = |wanted: RenderSettings| {
        let found = curve.points.iter().find(|it| it.settings == wanted);
        found.expect("was measured")
    };
    let full = find(own);
    assert_eq!(full.psnr_to_full, 100.0, "it is the reference");
    assert!(full.psnr.expect("has truth") > 12.0);
    let half = find(RenderSettings { scale: 0.5, ..own });
    let few = find(RenderSettings {
        samples: own.samples / 4,
        ..own
    });
    for change in [
        RenderSettings {
            min_transmittance: 0.05,
            ..own
        },
        RenderSettings {
            precision: Precision::Bf16,
            ..own
        },
    ] {
        let near = find(change);
        assert!((30.0..100.0).contains(&near.psnr_to_full), "{near:?}");
    }
    for (name, point) in [("half the size", half), ("few samples", few)] {
        assert!(
            (15.0..60.0).contains(&point.psnr_to_full),
            "{name}: {} dB",
            point.psnr_to_full
        );
    }
    assert!(curve.points.iter().all(|it| it.seconds > 0.0));
    assert!(
        curve
            .checks
            .iter()
            .all(|it| it.measured > 0.0 && it.predicted > 0.0)
    );
    assert!(curve.checks.len() >= 2, "a smaller and a larger size");
    let json = curve.to_json().expect("writes");
    let read = Curve::from_json(&json).expect("reads");
    // JSON may change the last digit of a number.
    let same = |a: f64, b: f64| (a - b).abs() <= 1e-12 * b.abs();
    for (a, b) in read.points.iter().zip(&curve.points) {
        assert_eq!(a.settings, b.settings);
        assert!(same(a.seconds, b.seconds) && same(a.psnr_to_full, b.psnr_to_full));
    }
    assert_eq!(read.points.len(), curve.points.len());

    let choice = choose(&curve, &Want::Tier("full".into()), curve.rays).expect("is there");
    assert_eq!(choice.settings, own);
    assert_eq!(choice.predicted_psnr, full.psnr);
}

#[test]
fn settings_change_the_frame_and_nothing_else() {
    let (renderer, views) = trained();
    let own = renderer.settings();
    let frame = renderer.render(&views[0].view).expect("renders");
    let rays = renderer
        .rays(&views[0].view.clone().into())
        .expect("counts");
    assert!((1..=frame.alpha.len()).contains(&rays), "{rays} rays");
    let half = RenderSettings { scale: 0.5, ..own };
    let renderer = renderer.with_settings(&half).expect("good settings");
    let small = renderer.render(&views[0].view).expect("renders");
    assert_eq!((small.width, small.height), (frame.width, frame.height));
    assert_ne!(small.rgb, frame.rgb);
    assert_eq!(
        renderer
            .rays(&views[0].view.clone().into())
            .expect("counts"),
        rays
    );
    let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len() as f32;
    for (name, a, b) in [
        ("alpha", &small.alpha, &frame.alpha),
        ("depth", &small.depth, &frame.depth),
    ] {
        let (a, b) = (mean(a), mean(b));
        assert!((a - b).abs() < 0.1 * b, "{name}: {a} for {b}");
    }

    let again = renderer.with_settings(&own).expect("good settings");
    assert_eq!(
        again.render(&views[0].view).expect("renders").rgb,
        frame.rgb
    );
    let bad = RenderSettings { samples: 0, ..own };
    let error = again.with_settings(&bad).err().expect("refused");
    assert!(matches!(&error, RenderError::Settings(text) if text.contains("settings.samples")));
}

#[test]
fn frames_are_compared_as_their_film_is_exposed() {
    let (mut renderer, views) = trained();
    let own = renderer.settings();
    let mut view = views[0].clone();
    view.exposure = FrameExposure {
        gain: [0.7, 0.8, 0.9],
        offset: [0.05; 3],
    };
    let mut frame = renderer.render(&view.view).expect("renders");
    view.exposure.expose(&mut frame);
    let mut truth = FrameImage::empty(frame.width, frame.height);
    truth.rgb = frame.to_rgb8();
    truth.mask.fill(255);
    view.truth = Some(truth);
    let curve = run(&mut renderer, &[view], vec![own]).expect("sweeps");
    let point = &curve.points[0];
    assert_eq!([point.psnr, point.psnr_mask_box], [Some(100.0); 2]);
}

#[test]
fn what_can_not_be_measured_is_named() {
    let (mut renderer, mut views) = trained();
    let own = renderer.settings();
    let refused = |renderer: &mut Renderer, views: &[SweepView], settings| {
        run(renderer, views, settings)
            .expect_err("refused")
            .to_string()
    };
    assert!(refused(&mut renderer, &[], vec![own]).contains("a view"));
    assert!(refused(&mut renderer, &views, Vec::new()).contains("settings"));
    let mut away = views[0].clone();
    for row in [0, 2] {
        away.view.camera.e[row] = away.view.camera.e[row].map(|value| -value);
    }
    assert!(refused(&mut renderer, &[away], vec![own]).contains("body"));
    let broken = RenderSettings { scale: 0.0, ..own };
    assert!(refused(&mut renderer, &views, vec![own, broken]).contains("settings.scale"));
    assert_eq!(renderer.settings(), own, "a failed sweep leaves no trace");
    views[1].truth = Some(FrameImage::empty(5, 1));
    assert!(refused(&mut renderer, &views, vec![own]).contains("view 1"));
    // One view without truth: no figure, rather than a mean over some views.
    views[1].truth = None;
    let curve = run(&mut renderer, &views, vec![own]).expect("sweeps");
    assert_eq!(curve.points[0].psnr, None);
}
