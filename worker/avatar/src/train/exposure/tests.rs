use super::*;
use yoto_synthetic::SyntheticPerson;

fn film(frames: usize) -> CaptureExposures {
    let (track, _) = SyntheticPerson::cast(1, 7)[0].capture(frames, 16);
    CaptureExposures::new(&track, LearnExposure::Auto)
}

fn exposure_with(gain: f32) -> FrameExposure {
    FrameExposure {
        gain: [gain; 3],
        offset: [0.1 * gain; 3],
    }
}

#[test]
fn the_mean_of_all_exposures_stays_neutral() {
    let mut film = film(3);
    for (position, gain) in [1.1, 1.3, 1.7].into_iter().enumerate() {
        film.take(position, &exposure_with(gain), 1.0);
    }
    film.heeded = Some(true);
    let frames: Vec<FrameExposure> = (0..3).map(|position| film.of(position)).collect();
    let gains: f32 = frames.iter().map(|it| it.gain[0].ln()).sum();
    let offsets: f32 = frames.iter().map(|it| it.offset[0]).sum();
    assert!(gains.abs() < 1e-5 && offsets.abs() < 1e-5, "{frames:?}");
    let brighter = |a: &FrameExposure, b: &FrameExposure| a.gain[1] < b.gain[1];
    assert!(frames.is_sorted_by(brighter), "{frames:?}");
}

#[test]
fn a_frame_that_is_not_trained_on_lies_between_its_neighbours() {
    let mut film = film(5);
    film.heeded = Some(true);
    assert_eq!(film.near(2), FrameExposure::NEUTRAL);
    film.frames[1] = Some(exposure_with(1.0));
    film.frames[4] = Some(exposure_with(4.0));
    let gain = |index: u32| film.near(index).gain[2];
    let near = |a: f32, b: f32| (a - b).abs() < 1e-5;
    assert!(near(gain(2), 2.0) && near(gain(3), 3.0) && near(gain(4), 4.0));
    assert!(near(gain(0), 1.0) && near(gain(9), 4.0));
    film.heeded = Some(false);
    assert_eq!(film.near(2), FrameExposure::NEUTRAL);
}

#[test]
fn exposures_are_heeded_where_they_differ() {
    let config = ExposureConfig::default();
    for (spread, heeded) in [(0.5 * config.least, false), (2.0 * config.least, true)] {
        let mut film = film(4);
        let gains = [spread, -spread, spread, -spread];
        for (position, gain) in gains.into_iter().enumerate() {
            assert_eq!(film.decide(&config, 1.0, 4), None, "too few are fitted");
            film.frames[position] = Some(exposure_with(gain.exp() as f32));
        }
        assert_eq!(
            film.decide(&config, 0.5 * config.decide, 4),
            None,
            "too early"
        );
        let found = film.decide(&config, config.decide, 4).expect("due");
        assert!((found - spread).abs() < 1e-6, "{found}");
        assert_eq!(film.heeded, Some(heeded));
        assert_eq!(film.decide(&config, 1.0, 4), None, "decided once");
    }
}
