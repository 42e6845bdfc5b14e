//! A filmed person whose pose is fitted, for tests.

use super::{Picture, PoseFitter};
use crate::avatar::Avatar;
use crate::config::ModelConfig;
use crate::motion::body::CanonicalBody;
use burn::tensor::Device;
use yoto_capture::FrameImage;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_synthetic::SyntheticPerson;

/// One frame of a synthetic person, and all that a fit to it needs but the model.
pub(super) struct TestScene {
    pub config: ModelConfig,
    pub device: Device,
    pub body: CanonicalBody,
    pub pose: Pose,
    pub camera: Camera,
    pub image: FrameImage,
    /// Indices of the pixels that show the person.
    pub covered: Vec<u32>,
}

impl TestScene {
    /// A frame of `size` x `size` pixels.
    pub(crate) fn new(config: ModelConfig, size: u32) -> Self {
        let device = Device::flex().autodiff();
        let (track, mut frames) = SyntheticPerson::cast(1, 7)[0].capture(4, size);
        let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
        let image = frames.swap_remove(2);
        let pixels = (0..).zip(&image.mask);
        let covered = pixels.filter(|(_, mask)| **mask > 0).map(|(p, _)| p);
        Self {
            body: CanonicalBody::new(skeleton, &config, &device),
            pose: Pose::from_frame(&track.frames[2]).expect("a pose"),
            camera: Camera::from_frame(&track.frames[2], track.image_size).expect("a camera"),
            covered: covered.collect(),
            image,
            config,
            device,
        }
    }

    /// The picture to fit to.
    pub(crate) fn picture(&self) -> Picture<'_> {
        Picture {
            image: &self.image,
            camera: &self.camera,
            covered: &self.covered,
        }
    }

    /// The fit of the person in slot 0 of `avatar`.
    pub(crate) fn fitter<'a>(&'a self, avatar: &'a Avatar) -> PoseFitter<'a> {
        PoseFitter {
            avatar,
            config: &self.config,
            body: &self.body,
            slot: 0,
            schedule_progress: 0.0,
            occupancy: None,
            device: &self.device,
        }
    }
}
