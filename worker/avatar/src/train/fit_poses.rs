//! Fits of poses: of a frame's before the frame is trained on, and of other pictures'.

use super::frame_order::FrameIndex;
use super::people::{TrainSubject, covered};
use super::{TrainError, Trainer};
use crate::avatar::Avatar;
use crate::fit::{Picture, PoseChange, PoseFitter, Wishes};
use burn::module::Module;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tracing::trace_span;
use yoto_capture::FrameImage;
use yoto_capture::camera::{Camera, Pose};
use yoto_proto::pose_track::PoseTrack;

/// Steps of the fit of a picture that is not trained on.
const FIT_STEPS: u32 = 10;

impl Trainer {
    /// Refines the pose of the frame at `place`, if poses are refined now.
    pub(super) fn fit_pose(
        &mut self,
        place: FrameIndex,
        rng: &mut ChaCha8Rng,
    ) -> Result<(), TrainError> {
        let (opened, fraction) = (self.opened(), self.fraction());
        let config = &self.config.refinement;
        let poses = self.state.poses[self.subjects[place.subject].slot].as_mut();
        let stage = poses.and_then(|poses| poses.stage(config, opened, fraction));
        let Some(stage) = stage.filter(|_| config.fits_before(self.step)) else {
            return Ok(());
        };
        let subject = &self.subjects[place.subject];
        let frame = &subject.frames[place.frame];
        let Some(poses) = &self.state.poses[subject.slot] else {
            return Ok(());
        };
        let _span = trace_span!("refine").entered();
        let avatar = self.state.avatar().clone().no_grad();
        let fitter = self.fitter(subject, &avatar);
        let shown = subject.picture(frame);
        let picture = Picture {
            image: &shown.image,
            camera: &frame.camera,
            covered: &shown.covered,
        };
        let pose = poses.refined(frame.place, &frame.pose);
        let config = &self.config.refinement;
        let wishes = Wishes {
            given: poses.given_wishes(config, frame.place),
            all: poses.wishes(config, frame.place),
        };
        let fit = fitter.step(&pose, &picture, &wishes, stage.blur, config.noise, rng)?;
        let Some(fit) = fit else {
            return Ok(());
        };
        let (slot, at) = (subject.slot, frame.place);
        let suspect = poses.suspects(at, stage.passed);
        let other = match suspect {
            true => {
                Some(self.other_reading(subject, place.frame, &fitter, &picture, stage.blur)?)
            }
            false => None,
        };
        let Some(poses) = &mut self.state.poses[slot] else {
            return Ok(());
        };
        let reread = matches!(other, Some(Some(_)));
        if let Some(found) = other {
            poses.tried(at, stage.passed, found);
        }
        if !reread {
            poses.note(at, fit.misfit);
            poses.learn(at, &fit.evidence, stage.passed);
            poses.take(at, &fit.step, &stage);
        }
        Ok(())
    }

    /// `pose` of the person in `slot` after a fit to the picture `image` by `camera`, with the
    /// model as it is. The same number of steps for every picture: [`FIT_STEPS`].
    ///
    /// # Errors
    /// If training has nobody in `slot`, or the device fails.
    pub fn fitted_pose(
        &self,
        slot: usize,
        pose: &Pose,
        camera: &Camera,
        image: &FrameImage,
    ) -> Result<Pose, TrainError> {
        let subject = self.subjects.iter().find(|it| it.slot == slot);
        let subject =
            subject.ok_or_else(|| TrainError::People(format!("nobody in slot {slot}")))?;
        let avatar = self.state.avatar().clone().no_grad();
        let fitter = self.fitter(subject, &avatar);
        let covered = covered(image);
        let picture = Picture {
            image,
            camera,
            covered: &covered,
        };
        let config = &self.config.refinement;
        let mut rng = ChaCha8Rng::seed_from_u64(self.options.seed);
        let mut change = PoseChange::none(self.joints);
        for step in 0..FIT_STEPS {
            let passed = f64::from(step) / f64::from(FIT_STEPS - 1);
            let given = change.wishes(config, [1.0; 2]);
            let (all, blur) = (given.clone(), config.blur(passed));
            let wishes = Wishes { given, all };
            let pose = change.of(pose);
            let step = fitter.step(&pose, &picture, &wishes, blur, config.noise, &mut rng)?;
            let Some(fit) = step else {
                break;
            };
            change.take(&fit.step, 1.0);
        }
        Ok(change.of(pose))
    }

    /// The fit of poses of `subject` in `avatar`.
    fn fitter<'a>(&'a self, subject: &'a TrainSubject, avatar: &'a Avatar) -> PoseFitter<'a> {
        PoseFitter {
            avatar,
            config: &self.config,
            body: &subject.body,
            slot: subject.slot,
            progress: self.opened(),
            occupancy: self.state.occupancy[subject.slot].as_ref(),
            device: &self.device,
        }
    }

    /// The pose of the frame at `place`, refined where poses are.
    pub(super) fn pose(&self, place: FrameIndex) -> Pose {
        let subject = &self.subjects[place.subject];
        let frame = &subject.frames[place.frame];
        match &self.state.poses[subject.slot] {
            Some(poses) => poses.refined(frame.place, &frame.pose),
            None => frame.pose.clone(),
        }
    }

    /// The pose track of `subject` as training has refined it: poses of held-out frames change as
    /// their neighbours' do. `None` where poses stay as they are given.
    pub(super) fn refined_track(
        &self,
        subject: &TrainSubject,
    ) -> Result<Option<PoseTrack>, TrainError> {
        let Some(poses) = &self.state.poses[subject.slot] else {
            return Ok(None);
        };
        let mut track = subject.track.clone();
        let trained = subject.frames.iter().map(|it| (it, true));
        for (frame, trained) in trained.chain(subject.held_out.iter().map(|it| (it, false))) {
            let pose = match trained {
                true => poses.refined(frame.place, &frame.pose),
                false => poses.as_neighbours(frame.place, &frame.pose),
            };
            let to = &mut track.frames[frame.place];
            to.pose = pose
                .rotations
                .iter()
                .flatten()
                .map(|v| f64::from(*v))
                .collect();
            to.translation = pose.translation.map(f64::from);
        }
        Ok(Some(track))
    }

    /// The pose of each training frame of the person in `slot` as training has refined it, with the
    /// frame's place in the pose track; empty where poses stay as they are given.
    pub fn refined_poses(&self, slot: usize) -> Vec<(usize, Pose)> {
        let subject = self.subjects.iter().find(|it| it.slot == slot);
        let poses = self.state.poses.get(slot).and_then(Option::as_ref);
        let (Some(subject), Some(poses)) = (subject, poses) else {
            return Vec::new();
        };
        let frames = subject.frames.iter();
        frames
            .map(|frame| (frame.place, poses.refined(frame.place, &frame.pose)))
            .collect()
    }
}
