//! Options of imports and renders: numerics, iteration, schedule, samples.

use super::{Archive, case, changed, checkpoint, load, model, render};
use yoto_avatar::config::Numerics;
use yoto_avatar::import::HumanNerfOptions;
use yoto_avatar::render::{RenderSettings, Rendered, Renderer};

const BOTH: [Numerics; 2] = [Numerics::Reference, Numerics::Sound];

fn train(renderer: &Renderer) -> Rendered {
    render(renderer, &case(), "train")
}

#[test]
fn numerics_are_a_choice_at_rendering() {
    let model = model(&checkpoint(), &HumanNerfOptions::default());
    let [reference, sound] = BOTH.map(|numerics| {
        let frame = train(&load(model.path()).with_numerics(numerics));
        assert!(frame.rgb.iter().all(|v| v.is_finite()));
        frame
    });
    assert_ne!(reference.rgb, sound.rgb);
    // Other sample positions, the same person.
    let mean = |frame: &Rendered| frame.alpha.iter().sum::<f32>() / frame.alpha.len() as f32;
    assert!((mean(&reference) - mean(&sound)).abs() < 0.2 * mean(&reference));
}

#[test]
fn the_iteration_counts_with_either_numerics() {
    let model = model(&checkpoint(), &HumanNerfOptions::default());
    for numerics in BOTH {
        let at = |iteration: u64| {
            let renderer = load(model.path()).with_numerics(numerics);
            train(&renderer.at_iteration(iteration)).rgb
        };
        let [closed, half, open] = [0, 30_000, 50_000].map(at);
        assert_ne!(closed, half, "{numerics:?}");
        assert_ne!(half, open, "{numerics:?}");
        assert_eq!(open, at(400_000), "{numerics:?}");
        let own = train(&load(model.path()).with_numerics(numerics)).rgb;
        assert_eq!(own, open, "{numerics:?}");
    }
}

#[test]
fn imported_models_are_open_whatever_their_iteration() {
    let options = HumanNerfOptions::default();
    let whole = model(&checkpoint(), &options);
    // Pickles have 60,000 as M, 60, ea.
    let early =
        |archive: &mut Archive| archive.edit_pickle(b"iterq\x01M\x60\xea", b"iterq\x01M\0\0");
    let (_dir, early) = changed(early);
    let early = model(&early, &options);
    let late = HumanNerfOptions {
        kick_in: 500_000,
        full_band: 600_000,
        ..options
    };
    let late = model(&checkpoint(), &late);
    for numerics in BOTH {
        let frame =
            |model: &tempfile::TempDir| train(&load(model.path()).with_numerics(numerics)).rgb;
        assert_eq!(frame(&whole), frame(&early), "{numerics:?}");
        assert_eq!(frame(&whole), frame(&late), "{numerics:?}");
    }
}

#[test]
fn iterations_count_by_the_training_s_own_schedule() {
    let zju = model(&checkpoint(), &HumanNerfOptions::default());
    let wild = HumanNerfOptions {
        kick_in: 100_000,
        full_band: 200_000,
        ..HumanNerfOptions::default()
    };
    let wild = model(&checkpoint(), &wild);
    let at = |model: &tempfile::TempDir, iteration: u64| {
        train(&load(model.path()).at_iteration(iteration)).rgb
    };
    // Before the kick-in, and three of six bands open.
    assert_eq!(at(&zju, 9_999), at(&wild, 99_999));
    assert_eq!(at(&zju, 30_000), at(&wild, 150_000));
    assert_ne!(at(&zju, 30_000), at(&wild, 30_000));
}

#[test]
fn samples_are_a_choice_at_importing_and_at_rendering() {
    let few = HumanNerfOptions {
        samples: 48,
        ..HumanNerfOptions::default()
    };
    let usual = model(&checkpoint(), &HumanNerfOptions::default());
    let few = model(&checkpoint(), &few);
    assert_eq!(load(usual.path()).settings().samples, 128);
    let settings = RenderSettings {
        samples: 48,
        ..load(usual.path()).settings()
    };
    let set = load(usual.path())
        .with_settings(&settings)
        .expect("renders");
    let few = train(&load(few.path()));
    assert_eq!(few.counts.placed, 48 * few.counts.rays);
    assert_eq!(train(&set).rgb, few.rgb);
    assert_ne!(train(&load(usual.path())).rgb, few.rgb);
}
