//! Levels of detail: fewer splats look like the whole person, and a limit of seconds per frame chooses among them.

use super::splats::view_of;
use crate::support::{options, people, run};
use burn::tensor::Device;
use yoto_avatar::config::{ModelConfig, Refine};
use yoto_avatar::evaluate::metrics::psnr;
use yoto_avatar::render::{FrameExposure, RenderSettings, Renderer};
use yoto_avatar::tradeoff::{
    Axes, Machine, SweepError, SweepOptions, SweepView, Want, choose, sweep,
};
use yoto_avatar::train::{TrainPerson, Trainer};

const SIZE: u32 = 64;

fn trained(harmonics: usize) -> (Renderer, TrainPerson) {
    let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
    let splats = config.appearance.splats_mut().expect("splats");
    (splats.count, splats.harmonics) = (2000, harmonics);
    config.refinement.who = Refine::Never;
    let people = people(&[0], 12, SIZE);
    let film = people[0].clone();
    let mut trainer = Trainer::new(config, options(60), people, &Device::flex()).expect("starts");
    run(&mut trainer, 60);
    (trainer.renderer(), film)
}

#[test]
fn a_level_looks_like_the_whole_in_every_pose() {
    for harmonics in [0, 2] {
        let (mut renderer, film) = trained(harmonics);
        let own = renderer.settings();
        assert_eq!(own.splats, 1.0);
        let views = [0, 6].map(|place| view_of(&film, 0, place));
        let whole = views
            .each_ref()
            .map(|view| renderer.render(view).expect("renders"));
        let mut before = f64::INFINITY;
        for splats in [0.5, 0.25, 0.125] {
            renderer
                .set(&RenderSettings { splats, ..own })
                .expect("good");
            renderer.prepare([0]).expect("somebody");
            let pairs = views.iter().zip(&whole);
            let found = pairs.map(|(view, whole)| {
                psnr(&renderer.render(view).expect("renders").rgb, &whole.rgb)
            });
            let worst = found.fold(f64::INFINITY, f64::min);
            assert!(worst < before && worst > 20.0, "{splats}: {worst:.1} dB");
            before = worst;
        }
        renderer.set(&own).expect("good");
        let again = renderer.render(&views[0]).expect("renders");
        assert_eq!(again.rgb, whole[0].rgb, "levels leave the whole as it is");
        for splats in [0.0, -1.0, 1.5, f32::NAN] {
            let error = renderer
                .set(&RenderSettings { splats, ..own })
                .expect_err("bad");
            assert!(error.to_string().starts_with("settings.splats"), "{error}");
        }
    }
}

#[test]
fn models_of_fields_have_no_levels() {
    let config = ModelConfig::named("draft", "yoto").expect("a tier");
    let people = people(&[0], 4, 32);
    let trainer = Trainer::new(config, options(1), people, &Device::flex()).expect("starts");
    let mut renderer = trainer.renderer();
    let half = RenderSettings {
        splats: 0.5,
        ..renderer.settings()
    };
    let error = renderer.set(&half).expect_err("no splats");
    assert!(error.to_string().starts_with("settings.splats"), "{error}");
    assert_eq!(Axes::of(&renderer).splats, [1.0]);
}

#[test]
fn little_time_buys_fewer_splats() {
    let (mut renderer, film) = trained(0);
    let own = renderer.settings();
    let views = [0, 6].map(|place| SweepView {
        view: view_of(&film, 0, place),
        truth: Some(film.shard.image(place)),
        exposure: FrameExposure::NEUTRAL,
    });
    let axes = Axes::of(&renderer);
    assert_eq!(axes.splats, [1.0, 0.5, 0.25, 0.125]);
    let settings = Axes {
        scale: vec![1.0],
        ..axes
    };
    let options = SweepOptions {
        settings: settings.settings(),
        repeats: 1,
        machine: Machine {
            cpu: "test".into(),
            cores: 1,
            device: "test".into(),
        },
        unix_seconds: 5,
    };
    let mut curve = sweep(&mut renderer, &views, &options, |_, _| {
        Ok::<_, SweepError>(())
    })
    .expect("sweeps");
    assert_eq!(renderer.settings(), own);
    let shares: Vec<f32> = curve.points.iter().map(|it| it.settings.splats).collect();
    assert_eq!(shares, [1.0, 0.5, 0.25, 0.125]);
    assert!(
        curve
            .points
            .is_sorted_by(|a, b| a.psnr_to_full > b.psnr_to_full)
    );
    assert!(curve.points.iter().all(|it| it.psnr_mask_box.is_some()));
    assert!(curve.points.iter().all(|it| it.fixed_seconds.is_some()));
    // Times of a busy machine prove nothing, so these are made up.
    for (point, seconds) in curve.points.iter_mut().zip([0.010, 0.007, 0.005, 0.004]) {
        (point.seconds, point.fixed_seconds) = (seconds, Some(0.5 * seconds));
    }
    let chosen = |seconds| {
        choose(&curve, &Want::MaxSeconds(seconds), curve.rays).map(|it| it.settings.splats)
    };
    assert_eq!(chosen(0.004), Ok(0.125));
    assert!(chosen(0.0069).expect("fits") <= 0.25);
    assert!(chosen(0.0039).is_err());
}
