//! People to film: their truth is known in every pose, unless they come with a film.

pub(crate) mod gestures;
mod mesh;

use crate::captures::Recording;
use anyhow::{Context, ensure};
use std::sync::Arc;
use yoto_avatar::train::TrainPerson;
use yoto_body::learn::BodyMesh;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::smpl::{all_joints, has_joints};
use yoto_capture::{FrameImage, ShardBuilder};
use yoto_proto::pose_track::PoseTrack;
use yoto_synthetic::{SyntheticPerson, calm_motion};

/// Frames of a film.
const FRAMES: usize = 60;
/// Frames per second of a film.
const FPS: f64 = 15.0;

/// Somebody to film.
pub(crate) struct Actor {
    pub name: String,
    pub skeleton: Skeleton,
    look: Look,
}

enum Look {
    Synthetic(Box<SyntheticPerson>),
    Mesh(Box<BodyMesh>),
    /// A real person, whose film there is.
    Filmed(Box<Recording>),
}

impl Actor {
    /// A synthetic person, in clothes that move.
    pub(crate) fn synthetic(person: SyntheticPerson) -> anyhow::Result<Self> {
        Ok(Self {
            name: person.name().to_owned(),
            skeleton: Skeleton::from_track(&person.skeleton())
                .context("the skeleton of a synthetic person")?,
            look: Look::Synthetic(Box::new(person)),
        })
    }

    /// A body, whose clothes its bones carry, with SMPL's joints alone, or with fingers and a face too.
    pub(crate) fn mesh(mesh: BodyMesh) -> Self {
        let rest: Vec<_> = mesh.joints.iter().map(|it| it.map(f64::from)).collect();
        let tree = || all_joints().take(rest.len());
        Self {
            name: mesh.name.clone(),
            skeleton: Skeleton {
                names: tree().map(|(name, _)| name.to_owned()).collect(),
                parents: tree().map(|(_, parent)| parent).collect(),
                rest,
            },
            look: Look::Mesh(Box::new(mesh)),
        }
    }

    /// The person of a capture.
    pub(crate) fn filmed(recording: Recording) -> anyhow::Result<Self> {
        let name = recording.name.clone();
        let skeleton = Skeleton::from_track(&recording.shard.track.skeleton)
            .with_context(|| format!("the skeleton of {name}"))?;
        ensure!(
            has_joints(&skeleton),
            "{name}: the poses are for the 24 joints of SMPL, which the capture's skeleton does not have"
        );
        Ok(Self {
            name,
            skeleton,
            look: Look::Filmed(Box::new(recording)),
        })
    }

    /// The person in `pose`, over black; `None` if nobody knows how they look then.
    pub(crate) fn render(&self, pose: &Pose, camera: &Camera) -> Option<FrameImage> {
        match &self.look {
            Look::Synthetic(person) => Some(person.render(pose, camera)),
            Look::Mesh(mesh) => Some(mesh::render(mesh, &self.skeleton, pose, camera)),
            Look::Filmed(_) => None,
        }
    }

    /// The film of the person: their own, or a calm one, `size` pixels wide, in a whole turn or within `sector` radians to either side.
    /// Fingers open and close, and the face speaks and blinks, if the skeleton has them.
    pub(crate) fn film(
        &self,
        slot: usize,
        size: u32,
        sector: Option<f64>,
    ) -> anyhow::Result<TrainPerson> {
        if let Look::Filmed(recording) = &self.look {
            return Ok(recording.person(slot));
        }
        let camera = SyntheticPerson::train_camera(size);
        let mut poses = calm_motion(&self.skeleton, FRAMES, sector);
        for (frame, pose) in poses.iter_mut().enumerate() {
            gestures::wave(pose, frame as f64 / FPS);
            gestures::speak(pose, frame as f64 / FPS);
        }
        let track = PoseTrack {
            skeleton: self.skeleton.to_track(),
            image_size: [size, size],
            fps: FPS,
            distortion: [0.0; 5],
            frames: (0..)
                .zip(&poses)
                .map(|(index, pose)| camera.to_frame(index, pose))
                .collect(),
        };
        let mut shard = ShardBuilder::new(track);
        for pose in &poses {
            shard.push(
                &self
                    .render(pose, &camera)
                    .context("a person without a film")?,
            )?;
        }
        let shard = shard.finish();
        Ok(TrainPerson {
            slot,
            name: self.name.clone(),
            shard: Arc::new(shard.with_context(|| format!("packing the film of {}", self.name))?),
        })
    }
}
