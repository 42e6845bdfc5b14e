//! The people that a model is trained on: their bodies and frames.

mod known_parts;
pub(crate) mod learn;
pub mod leaving;

use crate::avatar::Avatar;
use crate::config::ModelConfig;
use crate::motion::body::CanonicalBody;
use crate::train::{TrainError, TrainOptions};
use burn::tensor::Device;
use std::sync::Arc;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::readings::Sides;
use yoto_capture::{CroppedFrames, FrameImage, Shard};
use yoto_proto::correction::other_sides;
use yoto_proto::pose_track::PoseTrack;
use yoto_proto::smpl;

/// One identity's training data.
#[derive(Clone)]
pub struct TrainPerson {
    /// Identity slot in the model.
    pub slot: usize,
    /// Name in messages.
    pub name: String,
    /// Frames and pose track.
    pub shard: Arc<Shard>,
}

/// A frame for training or validation.
pub(crate) struct TrainFrame {
    /// Place in the pose track.
    pub position: usize,
    pub pose: Pose,
    pub camera: Camera,
}

/// The picture of a frame.
pub(crate) struct Picture {
    pub image: FrameImage,
    /// Indices of the pixels that show the person.
    pub covered: Vec<u32>,
}

/// A person, prepared for training.
pub(crate) struct TrainSubject {
    pub slot: usize,
    /// The slot of the person's own parameters ([`Avatar::own_slot`]).
    pub own_slot: usize,
    pub body: CanonicalBody,
    /// Name of the person.
    pub name: String,
    /// The poses as given, with their cameras.
    pub track: PoseTrack,
    /// The joints' other sides, if the body is symmetric.
    pub sides: Option<Sides>,
    /// Pictures of all frames, in the order of the pose track.
    pictures: CroppedFrames,
    pub frames: Vec<TrainFrame>,
    /// Frames for validation.
    pub held_out: Vec<TrainFrame>,
}

impl TrainSubject {
    /// Prepares `person`: frames are resized and held out as `options` say.
    pub(super) fn new(
        person: &TrainPerson,
        config: &ModelConfig,
        options: &TrainOptions,
        device: &Device,
    ) -> Result<Self, TrainError> {
        let image_size = options.image_size;
        let skeleton_error = |source| TrainError::Skeleton {
            name: person.name.clone(),
            source,
        };
        let track = &person.shard.track;
        let skeleton = Skeleton::from_track(&track.skeleton).map_err(skeleton_error)?;
        let (mut frames, mut held_out) = (Vec::new(), Vec::new());
        for (i, frame) in track.frames.iter().enumerate() {
            let view = |error: yoto_capture::ViewError| {
                TrainError::People(format!("{} frame {}: {error}", person.name, frame.index))
            };
            let pose = Pose::from_frame(frame).map_err(view)?;
            skeleton.check_pose(&pose).map_err(skeleton_error)?;
            let camera = Camera::from_frame(frame, track.image_size)
                .map_err(view)?
                .scaled_to(image_size);
            let keep_out = options.validation.holds_out(i, frame.index);
            if keep_out { &mut held_out } else { &mut frames }.push(TrainFrame {
                position: i,
                pose,
                camera,
            });
        }
        if frames.is_empty() {
            return Err(TrainError::People(format!(
                "{}: no frames to train on",
                person.name
            )));
        }
        let pictures = person.shard.cropped();
        let pictures = pictures.resized(image_size, options.scratch.as_deref());
        let pictures = pictures.map_err(|source| TrainError::Capture {
            name: person.name.clone(),
            source,
        })?;
        let other = other_sides(&track.skeleton).ok();
        let sides = other.map(|other| Sides::new(other, &skeleton.parents));
        Ok(Self {
            slot: person.slot,
            own_slot: Avatar::own_slot(config, person.slot),
            name: person.name.clone(),
            sides,
            body: CanonicalBody::new(skeleton, config, device),
            track: track.clone(),
            pictures,
            frames,
            held_out,
        })
    }

    /// Width and height of the pictures, pixels.
    pub(super) fn size(&self) -> [usize; 2] {
        self.pictures.size().map(|side| side as usize)
    }

    /// The image of `frame`.
    pub(super) fn image(&self, frame: &TrainFrame) -> FrameImage {
        self.pictures.image(frame.position)
    }

    /// The image of `frame`, and the pixels that show the person: for callers that draw from those pixels.
    pub(super) fn picture(&self, frame: &TrainFrame) -> Picture {
        let image = self.image(frame);
        let covered = covered(&image);
        Picture { image, covered }
    }

    /// Whether any pixel of `frame` has at least `coverage`.
    pub(super) fn shows(&self, frame: &TrainFrame, coverage: u8) -> bool {
        let (_, _, mask) = self.pictures.crop(frame.position);
        mask.iter().any(|pixel| *pixel >= coverage)
    }
}

/// Indices of the pixels of `image` that show the person.
pub(crate) fn covered(image: &FrameImage) -> Vec<u32> {
    (0..)
        .zip(&image.mask)
        .filter_map(|(pixel, mask)| (*mask > 0).then_some(pixel))
        .collect()
}

/// The joint tree of a person, without fingers and face: people with and without them fit one model.
fn tree(person: &TrainPerson) -> (&[String], &[i32]) {
    let skeleton = &person.shard.track.skeleton;
    let count = match smpl::is_smpls(skeleton) {
        true => smpl::JOINTS.len(),
        false => skeleton.parents.len(),
    };
    (&skeleton.names[..count], &skeleton.parents[..count])
}

/// The first difference of two people's joint trees, in words.
fn difference(one: &TrainPerson, other: &TrainPerson) -> String {
    let trees = [one, other].map(|person| &person.shard.track.skeleton);
    let joints = trees.map(|tree| tree.names.len());
    let pairs = trees[0].names.iter().zip(&trees[1].names);
    let parents = trees[0].parents.iter().zip(&trees[1].parents);
    if let Some((at, (a, b))) = pairs.enumerate().find(|(_, (a, b))| a != b) {
        format!("joint {at} is '{a}' in one and '{b}' in the other")
    } else if let Some((at, (a, b))) = parents.enumerate().find(|(_, (a, b))| a != b) {
        format!("the parent of joint {at} is {a} in one and {b} in the other")
    } else {
        format!("{} and {} joints", joints[0], joints[1])
    }
}

/// Checks that the people fit one model: equal joint trees, but for fingers, and one slot each. Returns the number
/// of slots that they need and their number of joints, fingers not counted.
pub(crate) fn check_people(people: &[TrainPerson]) -> Result<(usize, usize), TrainError> {
    let first = people
        .first()
        .ok_or_else(|| TrainError::People("no people to train on".into()))?;
    let mut slots: Vec<usize> = people.iter().map(|p| p.slot).collect();
    slots.sort_unstable();
    if slots.windows(2).any(|pair| pair[0] == pair[1]) {
        return Err(TrainError::People("two people in one slot".into()));
    }
    if let Some(other) = people.iter().find(|p| tree(p) != tree(first)) {
        return Err(TrainError::People(format!(
            "{} and {} have different joint trees ({}): one model has one tree",
            first.name,
            other.name,
            difference(first, other)
        )));
    }
    let joints = tree(first).0.len();
    if joints < 2 {
        return Err(TrainError::People(format!(
            "{}: a body needs at least 2 joints",
            first.name
        )));
    }
    Ok((slots.last().map_or(0, |s| s + 1), joints))
}
