//! Fits of poses: of a frame's before the frame is trained on, and of other pictures'.

use crate::avatar::Avatar;
use crate::config::Extent;
use crate::fit::{Picture, PoseChange, PoseFitter, StepPriors};
use crate::train::TrainError;
use crate::train::model::Model;
use crate::train::people::{TrainFrame, TrainSubject, covered};
use crate::train::poses::wrong_frames::other_reading;
use crate::train::run::Moment;
use crate::train::run::guard::TrainState;
use burn::module::Module;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tracing::trace_span;
use yoto_capture::FrameImage;
use yoto_capture::camera::{Camera, Pose};
use yoto_proto::pose_track::PoseTrack;

/// Steps of the fit of a picture that is not trained on.
const FIT_STEPS: u32 = 10;

/// Refines the pose of a `frame` of the `subject`, if poses are refined now.
pub(crate) fn fit_pose(
    model: &mut Model,
    subject: &TrainSubject,
    frame: &TrainFrame,
    now: Moment,
    rng: &mut ChaCha8Rng,
) -> Result<(), TrainError> {
    let (slot, index) = (subject.slot, frame.position);
    let config = &model.config.refinement;
    let poses = model.state.poses[slot].as_mut();
    let stage = poses.and_then(|poses| poses.stage(config, now.schedule_progress, now.fraction));
    let Some((poses, stage)) = model.state.poses[slot].as_ref().zip(stage) else {
        return Ok(());
    };
    if !poses.fits_before(config, now.step) {
        return Ok(());
    }
    let _span = trace_span!("refine").entered();
    let avatar = model.state.avatar().clone().no_grad();
    let fitter = fitter(model, subject, &avatar, now.schedule_progress);
    let shown = subject.picture(frame);
    let picture = Picture {
        image: &shown.image,
        camera: &frame.camera,
        covered: &shown.covered,
    };
    let pose = poses.refined(index, &frame.pose);
    let priors = StepPriors {
        given: poses.given_priors(config, index),
        all: poses.priors(config, index),
    };
    let fit = fitter.step(&pose, &picture, &priors, stage.blur, config.noise, rng)?;
    let Some(fit) = fit else {
        return Ok(());
    };
    let suspect = poses.suspects(index, stage.passed);
    let other = match suspect {
        true => {
            let found = other_reading(poses, subject, frame, &fitter, &picture, stage.blur)?;
            Some(found)
        }
        false => None,
    };
    let Some(poses) = &mut model.state.poses[slot] else {
        return Ok(());
    };
    let reread = matches!(other, Some(Some(_)));
    if let Some(found) = other {
        poses.tried(index, stage.passed, found);
    }
    if !reread {
        poses.note(index, fit.misfit);
        poses.learn(index, &fit.evidence, stage.passed);
        poses.take(index, &fit.step, &stage);
    }
    Ok(())
}

/// `pose` of the `subject` after a fit to the picture `image` by `camera`, with the model as it is after
/// the completed fraction `schedule_progress` of its run. Every picture gets the same number of steps: [`FIT_STEPS`].
pub(crate) fn fitted_pose(
    model: &Model,
    subject: &TrainSubject,
    pose: &Pose,
    camera: &Camera,
    image: &FrameImage,
    (schedule_progress, seed): (f64, u64),
) -> Result<Pose, TrainError> {
    let avatar = model.state.avatar().clone().no_grad();
    let fitter = fitter(model, subject, &avatar, schedule_progress);
    let covered = covered(image);
    let picture = Picture {
        image,
        camera,
        covered: &covered,
    };
    let config = &model.config.refinement;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut change = PoseChange::none(pose.rotations.len());
    for step in 0..FIT_STEPS {
        let passed = f64::from(step) / f64::from(FIT_STEPS - 1);
        let given = change.priors(config, [1.0; 2]);
        let (all, blur) = (given.clone(), config.blur(Extent::Wide, passed));
        let priors = StepPriors { given, all };
        let pose = change.of(pose);
        let step = fitter.step(&pose, &picture, &priors, blur, config.noise, &mut rng)?;
        let Some(fit) = step else {
            break;
        };
        change.take(&fit.step, 1.0);
    }
    Ok(change.of(pose))
}

/// The fit of poses of `subject` in `avatar`.
fn fitter<'a>(
    model: &'a Model,
    subject: &'a TrainSubject,
    avatar: &'a Avatar,
    schedule_progress: f64,
) -> PoseFitter<'a> {
    PoseFitter {
        avatar,
        config: &model.config,
        body: &subject.body,
        slot: subject.slot,
        schedule_progress,
        occupancy: model.state.occupancy[subject.slot].as_ref(),
        device: &model.device,
    }
}

/// The pose of a `frame` of the `subject`, refined where poses are.
pub(crate) fn pose(state: &TrainState, subject: &TrainSubject, frame: &TrainFrame) -> Pose {
    match &state.poses[subject.slot] {
        Some(poses) => poses.refined(frame.position, &frame.pose),
        None => frame.pose.clone(),
    }
}

/// The pose track of `subject` as training has refined it: poses of held-out frames change as
/// their neighbours' do. `None` where poses stay as they are given.
pub(crate) fn refined_track(state: &TrainState, subject: &TrainSubject) -> Option<PoseTrack> {
    let poses = state.poses[subject.slot].as_ref()?;
    let mut track = subject.track.clone();
    let trained = subject.frames.iter().map(|it| (it, true));
    for (frame, trained) in trained.chain(subject.held_out.iter().map(|it| (it, false))) {
        let pose = match trained {
            true => poses.refined(frame.position, &frame.pose),
            false => poses.as_neighbours(frame.position, &frame.pose),
        };
        let to = &mut track.frames[frame.position];
        to.pose = pose
            .rotations
            .iter()
            .flatten()
            .map(|v| f64::from(*v))
            .collect();
        to.translation = pose.translation.map(f64::from);
    }
    Some(track)
}
