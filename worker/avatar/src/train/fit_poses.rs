//! Fits of poses: of a frame's before the frame is trained on, and of other pictures'.

use super::frame_order::FramePlace;
use super::people::{TrainSubject, covered};
use super::{TrainError, Trainer};
use crate::avatar::Avatar;
use crate::fit::{Picture, PoseChange, PoseFitter};
use burn::module::Module;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use tracing::trace_span;
use yoto_capture::FrameImage;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::readings::{Reading, between};
use yoto_proto::pose_track::PoseTrack;

/// Misfit of another reading, relative to the one so far, below which it replaces it.
const CLEARLY: f64 = 0.6;
/// Frames listed by number.
const LISTED: usize = 20;
/// Steps of the fit of a picture that is not trained on.
const FIT_STEPS: u32 = 10;

impl Trainer {
    /// Refines the pose of the frame at `place`, if poses are refined now.
    pub(super) fn fit_pose(
        &mut self,
        place: FramePlace,
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
        let picture = Picture {
            image: &frame.image,
            camera: &frame.camera,
            covered: &frame.covered,
        };
        let pose = poses.refined(frame.place, &frame.pose);
        let config = &self.config.refinement;
        let wishes = poses.wishes(config, frame.place);
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
            poses.take(at, &fit.step, &stage);
        }
        Ok(())
    }

    /// The reading of the training frame `frame` of `subject` that fits its `picture` clearly better
    /// than its refined pose; `None` if none does.
    fn other_reading(
        &self,
        subject: &TrainSubject,
        frame: usize,
        fitter: &PoseFitter,
        picture: &Picture,
        blur: f64,
    ) -> Result<Option<(Reading, Pose, PoseChange)>, TrainError> {
        let frame = &subject.frames[frame];
        let Some(poses) = &self.state.poses[subject.slot] else {
            return Ok(None);
        };
        let misfit = |pose: &Pose| fitter.misfit(pose, picture, blur, [0.5; 2]);
        let now = misfit(&poses.refined(frame.place, &frame.pose))?;
        let mut readings = vec![(Reading::Given, frame.pose.clone())];
        if let Some(sides) = &subject.sides {
            readings.extend(sides.readings(&frame.pose, &frame.camera));
        }
        let none = PoseChange::none(self.joints);
        let mut readings: Vec<(Reading, Pose, PoseChange)> = (readings.into_iter())
            .map(|(reading, pose)| (reading, pose, none.clone()))
            .collect();
        let frames = &subject.frames;
        let read = |place: usize| {
            let found = frames.iter().find(|it| it.place == place);
            found.map(|it| poses.read(place, &it.pose))
        };
        if let Some([before, after]) = poses.fitting_around(frame.place)
            && let (Some(a), Some(b)) = (read(before), read(after))
        {
            let at = (frame.place - before) as f64 / (after - before) as f64;
            let change = poses.change_between([before, after], at);
            readings.push((Reading::Between, between(&a, &b, at), change));
        }
        let mut best: Option<((Reading, Pose, PoseChange), f64)> = None;
        for (reading, pose, change) in readings {
            let least = best.as_ref().map(|(_, least)| *least);
            let enough = least
                .or(now.map(|now| CLEARLY * now))
                .unwrap_or(f64::INFINITY);
            if let Some(found) = misfit(&change.of(&pose))?.filter(|found| *found < enough) {
                best = Some(((reading, pose, change), found));
            }
        }
        Ok(best.map(|(found, _)| found))
    }

    /// How much the frame at `place` counts in training, 0 to 1.
    pub(super) fn weight(&self, place: FramePlace) -> f64 {
        let subject = &self.subjects[place.subject];
        let frame = subject.frames[place.frame].place;
        let poses = self.state.poses[subject.slot].as_ref();
        poses.map_or(1.0, |poses| poses.weight(frame))
    }

    /// Frames that are not trained on as they were given, for people.
    pub(super) fn doubts(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for subject in &self.subjects {
            let Some(poses) = &self.state.poses[subject.slot] else {
                continue;
            };
            let (mut readings, hardly) = poses.doubts();
            readings.retain(|(place, _)| !hardly.contains(place));
            let mut by_reading: BTreeMap<Reading, Vec<u32>> = BTreeMap::new();
            let index = |place: usize| subject.track.frames[place].index;
            for (place, reading) in readings {
                by_reading.entry(reading).or_default().push(index(place));
            }
            for (reading, frames) in by_reading {
                notes.push(format!(
                    "{}: read {reading}: {}",
                    subject.name,
                    listed(&frames)
                ));
            }
            if !hardly.is_empty() {
                let frames: Vec<u32> = hardly.into_iter().map(index).collect();
                let name = &subject.name;
                let frames = listed(&frames);
                notes.push(format!(
                    "{name}: hardly counted, as no reading fits: {frames}"
                ));
            }
        }
        notes
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
            let (wishes, blur) = (change.wishes(config), config.blur(passed));
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
    pub(super) fn pose(&self, place: FramePlace) -> Pose {
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

/// `frames 3, 4, 12`, a few of them by number.
fn listed(frames: &[u32]) -> String {
    let shown = frames.iter().take(LISTED).map(u32::to_string);
    let shown: Vec<String> = shown.collect();
    let more = frames.len().saturating_sub(LISTED);
    let more = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    let noun = if frames.len() == 1 { "frame" } else { "frames" };
    format!("{noun} {}{more}", shown.join(", "))
}
