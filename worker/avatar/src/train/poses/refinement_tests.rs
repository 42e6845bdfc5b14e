use super::*;
use crate::config::SplatConfig;
use yoto_synthetic::SyntheticPerson;

fn track() -> PoseTrack {
    SyntheticPerson::cast(1, 7)[0].capture(8, 32).0
}

#[test]
fn neighbours_follow_and_the_mean_stays() {
    let mut poses = PoseRefinement::new(&track(), Extent::Wide, false);
    let mut step = vec![0.0; 3 * (track().joints() + 1)];
    step[4] = 0.1;
    let stage = RefinementStage {
        blur: 0.02,
        reach: 1.0,
        share: 0.5,
        passed: 0.0,
    };
    poses.take(2, &step, &stage);
    let changes: Vec<f64> = (poses.changes.iter())
        .map(|it| f64::from(it.0[4]))
        .collect();
    assert!(changes.iter().sum::<f64>().abs() < 1e-7);
    assert!((changes[2] - changes[7] - 0.05).abs() < 1e-7, "{changes:?}");
    let (near, far) = (changes[1] - changes[7], changes[4] - changes[7]);
    assert!((near - 0.05 * (-0.5_f64).exp()).abs() < 1e-7, "{changes:?}");
    assert!((far - 0.05 * (-2.0_f64).exp()).abs() < 1e-7, "{changes:?}");
}

#[test]
fn wishes_lead_to_the_given_pose_and_the_neighbours() {
    let config = RefinementConfig {
        rotation: 1.0,
        rotation_jitter: 0.5,
        ..RefinementConfig::default()
    };
    let mut poses = PoseRefinement::new(&track(), Extent::Wide, false);
    poses.changes[3].0[0] = 0.4;
    poses.changes[5].0[0] = 0.2;
    poses.changes[4].0[0] = 0.1;
    // Neighbours pull to 0.3 four times as strongly as the given pose to 0.
    let prior = poses.priors(&config, 4)[0];
    assert!((prior.mean - (0.24 - 0.1)).abs() < 1e-7 && (prior.precision - 5.0).abs() < 1e-12);
    let frame = Pose::rest(track().joints());
    let mean = f64::from(poses.as_neighbours(4, &frame).rotations[0][0]);
    assert!((mean - 0.3).abs() < 1e-6, "{mean}");
    poses.changes.truncate(1);
    assert_eq!(poses.as_neighbours(0, &frame), frame);
    assert_eq!(poses.priors(&config, 0)[0].precision, 1.0, "no neighbours");
}

#[test]
fn files_without_expected_errors_are_read() {
    let poses = PoseRefinement::new(&track(), Extent::Wide, false);
    let mut file = serde_json::to_value(&poses).expect("JSON");
    let removed = file.as_object_mut().and_then(|it| it.remove("errors"));
    assert!(removed.is_some());
    let read: PoseRefinement = serde_json::from_value(file).expect("an earlier version's file");
    assert_eq!(read, poses);
    assert_eq!(read.errors(&RefinementConfig::default()), None);
}

#[test]
fn another_film_of_the_same_length_starts_anew() {
    let track = track();
    let mut other = track.clone();
    other.frames[3].translation[1] += 1e-9;
    let poses = PoseRefinement::new(&track, Extent::Wide, false);
    assert!(poses.is_of(&track) && !poses.is_of(&other));
}

#[test]
fn a_frame_that_fits_far_worse_than_others_hardly_counts() {
    let mut poses = PoseRefinement::new(&track(), Extent::Wide, false);
    assert_eq!(poses.fitting_around(3), None, "nothing is known");
    // Misfits fall over a run, and are told from those of their time.
    for visit in 0..40 {
        let usual = 0.1 * 0.95_f64.powi(visit);
        for position in 0..8 {
            poses.note(position, if position == 3 { 12.0 * usual } else { usual });
        }
    }
    assert!(
        poses.weight(3) < 0.1 && poses.weight(4) > 0.95,
        "{}",
        poses.weight(3)
    );
    assert!(poses.suspects(3, 0.5) && !poses.suspects(3, 0.0) && !poses.suspects(4, 0.5));
    assert_eq!(poses.fitting_around(3), Some([2, 4]));
    assert_eq!(poses.doubts(), (vec![], vec![]), "no reading was tried");
    poses.tried(3, 0.5, None);
    assert_eq!(poses.doubts(), (vec![], vec![3]));
    assert!(!poses.suspects(3, 0.5) && poses.suspects(3, 0.7));
    poses.note(4, f64::NAN);
    assert!(poses.weight(4) > 0.95, "nothing is learned from no number");
}

#[test]
fn frames_with_exchanged_sides_keep_to_themselves() {
    let track = track();
    let mut poses = PoseRefinement::new(&track, Extent::Wide, false);
    let (pose, none) = (Pose::rest(track.joints()), PoseChange::none(track.joints()));
    poses.tried(4, 0.5, Some((Reading::Limbs, pose.clone(), none)));
    let mut step = vec![0.0; 3 * (track.joints() + 1)];
    step[0] = 0.1;
    let stage = RefinementStage {
        blur: 0.02,
        reach: 1.0,
        share: 1.0,
        passed: 0.5,
    };
    poses.take(3, &step, &stage);
    assert_eq!(poses.changes[4].0[0], 0.0);
    assert!(poses.beside(4).is_empty() && poses.beside(3).len() == 1);
    assert_eq!(poses.read(4, &pose), pose);
    assert_eq!(poses.doubts().0, [(4, Reading::Limbs)]);
}

#[test]
fn a_person_who_comes_late_is_refined_over_that_run() {
    let config = RefinementConfig::default();
    let stage = |late, schedule_progress, fraction| {
        PoseRefinement::new(&track(), Extent::Wide, late).stage(
            &config,
            schedule_progress,
            fraction,
        )
    };
    assert!(stage(false, 0.5, 0.5).is_some() && stage(false, 1.0, 0.5).is_none());
    assert!(stage(true, 1.0, 0.5).is_some() && stage(true, 1.0, 0.95).is_none());
    let mut poses = PoseRefinement::new(&track(), Extent::Wide, true);
    assert!(poses.stage(&config, 1.0, 1.0).is_none());
    assert!(
        poses.stage(&config, 1.0, 0.5).is_none(),
        "the next run leaves them"
    );
}

#[test]
fn splats_grow_twice_and_those_of_an_earlier_training_stay() {
    let config = SplatConfig::default();
    let mut poses = PoseRefinement::new(&track(), Extent::Wide, false);
    assert_eq!(poses.due_splat_count(&config, 1.0, 0.5), None, "not placed");
    assert!(!poses.has_placed());
    assert_eq!(poses.initial_splat_count(&config, 0.0, 0.0), config.coarse);
    assert_eq!(
        poses.due_splat_count(&config, config.grow, 0.0),
        None,
        "as given"
    );
    poses.fits = 20;
    assert_eq!(
        poses.due_splat_count(&config, config.grow, 0.61),
        None,
        "too late"
    );
    let mut at = |schedule_progress| poses.due_splat_count(&config, schedule_progress, 0.0);
    assert_eq!(at(config.grow - 0.01), None);
    assert_eq!(at(config.grow), Some(8944));
    assert_eq!(at(config.grow), None, "once");
    assert_eq!(at(config.grow_all), Some(config.count));
    assert_eq!(at(1.0), None, "once");
    let mut late = PoseRefinement::new(&track(), Extent::Wide, true);
    late.initial_splat_count(&config, 1.0, 0.0);
    late.fits = 20;
    assert_eq!(late.due_splat_count(&config, 1.0, 0.1), None);
    assert!(late.due_splat_count(&config, 1.0, 0.4).is_some());
    // In the middle of a run, by what is left of it.
    let mut joined = PoseRefinement::new(&track(), Extent::Wide, false);
    joined.initial_splat_count(&config, 0.5, 0.0);
    joined.fits = 20;
    assert_eq!(joined.due_splat_count(&config, 0.6, 0.2), None);
    assert!(joined.due_splat_count(&config, 0.66, 0.32).is_some());
    assert!(joined.has_placed());
}

#[test]
fn fine_fits_observe_until_poses_are_judged_and_exact_ones_stay_as_given() {
    let settings = RefinementConfig::default();
    let judged = |factor: f64, fits: u32| {
        let mut poses = PoseRefinement::new(&track(), Extent::Fine, false);
        poses.fits = fits;
        poses.errors = ExpectedErrors::of([factor, 1.0]);
        let before = settings.judged - 0.01;
        let observing = poses.stage(&settings, before, before).expect("fits");
        assert_eq!(observing.share, 0.0, "no step is taken");
        poses.stage(&settings, settings.judged, settings.judged)
    };
    let limit = settings.exact / settings.rotation;
    assert_eq!(judged(0.9 * limit, 30), None);
    assert!(judged(1.1 * limit, 30).is_some_and(|stage| stage.share > 0.0));
    let waiting = judged(1.1 * limit, 3).expect("too few fits tell, so that it waits");
    assert_eq!(waiting.share, 0.0, "no step is taken");
    let mut few = PoseRefinement::new(&track(), Extent::Fine, false);
    few.fits = 3;
    few.errors = ExpectedErrors::of([1.1 * limit, 1.0]);
    let last = settings.judged_last;
    assert_eq!(few.stage(&settings, last, last), None, "too few fits tell");
}

#[test]
fn a_fine_refinement_has_all_splats_fewer_fits_and_less_blur() {
    let (config, settings) = (SplatConfig::default(), RefinementConfig::default());
    let mut fine = PoseRefinement::new(&track(), Extent::Fine, false);
    let mut wide = PoseRefinement::new(&track(), Extent::Wide, false);
    assert_eq!(fine.initial_splat_count(&config, 0.0, 0.0), config.count);
    assert_eq!(wide.initial_splat_count(&config, 0.0, 0.0), config.coarse);
    fine.fits = 20;
    assert_eq!(
        fine.due_splat_count(&config, 0.5, 0.5),
        None,
        "there are all of them"
    );
    let fits = |poses: &PoseRefinement| {
        (0..100)
            .filter(|step| poses.fits_before(&settings, *step))
            .count()
    };
    assert_eq!((fits(&fine), fits(&wide)), (50, 100));
    let blur = |poses: &mut PoseRefinement| poses.stage(&settings, 0.3, 0.3).map(|it| it.blur);
    assert!(blur(&mut fine) < blur(&mut wide));
}
