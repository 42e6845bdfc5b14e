//! Synthetic people: textured, clothed, moving, and rendered from any camera.
//!
//! Their captures are free to copy, and the truth is known for every view and for unseen poses. Bodies are
//! smoothly blended capsules on the 24 SMPL joints. Colours and shading belong to the body in the rest pose,
//! so they depend on neither light nor view, as the model assumes. Hems and sleeves also move beyond the
//! bones' motion, by a rule that [`SyntheticPerson::offset`] returns.

mod body;
mod build;
mod cast;
mod cloth;
mod drape;
mod estimator;
mod motion;
mod outfit;
mod raycast;
mod stress;

pub use estimator::{Estimate, Estimator, Mistake};
pub use stress::{NamedPose, calm_motion, stress_poses};

use body::PosedBody;
use build::Capsule;
use drape::Drape;
use outfit::Outfit;
use yoto_capture::FrameImage;
use yoto_capture::camera::Camera;
use yoto_capture::skeleton::{Pose, Skeleton, Vec3};
use yoto_proto::pose_track::{self, PoseTrack};

/// Frames per second of a synthetic capture.
const FPS: f64 = 15.0;
/// The point that cameras look at: the middle of a standing person with raised arms, metres.
const TARGET: Vec3 = [0.0, 0.98, 0.0];
/// Height of the view at the target, metres.
const VIEW_HEIGHT: f64 = 2.3;
const UP: Vec3 = [0.0, 1.0, 0.0];

/// One synthetic person.
#[derive(Clone, Debug)]
pub struct SyntheticPerson {
    name: String,
    skeleton: Skeleton,
    capsules: Vec<Capsule>,
    outfit: Outfit,
    drape: Drape,
    gait: motion::Gait,
}

impl SyntheticPerson {
    /// `n` people with different builds, clothes, colours and gaits. The same seed gives the same people,
    /// and a larger `n` only adds to them.
    pub fn cast(n: usize, seed: u64) -> Vec<Self> {
        cast::cast(n, seed)
    }

    /// A name that is unique in the cast.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The 24 SMPL joints in this person's proportions: y up, metres, T-pose on the floor
    /// (y = 0), facing +z, left hand at +x.
    pub fn skeleton(&self) -> pose_track::Skeleton {
        self.skeleton.to_track()
    }

    /// The image of the person in `pose` by `camera`: colours premultiplied by coverage, over black.
    pub fn render(&self, pose: &Pose, camera: &Camera) -> FrameImage {
        raycast::render(&self.posed(pose, &self.drape), camera)
    }

    fn posed<'a>(&'a self, pose: &Pose, drape: &'a Drape) -> PosedBody<'a> {
        PosedBody::new(&self.skeleton, &self.capsules, &self.outfit, drape, pose)
    }

    /// `frames` poses for a film: walking on the spot through two whole turns, waving and raising the arms,
    /// so that one camera sees every side.
    pub fn motion(&self, frames: usize) -> Vec<Pose> {
        self.gait.filmed(&self.skeleton, frames)
    }

    /// `frames` poses that are not in [`SyntheticPerson::motion`]: jumping jacks, then squats.
    pub fn unseen_motion(&self, frames: usize) -> Vec<Pose> {
        self.gait.unseen(&self.skeleton, frames)
    }

    /// The training camera: 3.2 m in front, with images of `size` x `size` pixels.
    pub fn train_camera(size: u32) -> Camera {
        camera_at(0.0, 1.15, size)
    }

    /// Four cameras around the person, slightly raised, none at the training camera's position.
    pub fn held_out_cameras(size: u32) -> Vec<Camera> {
        [60.0, 150.0, 240.0, 330.0]
            .into_iter()
            .map(|degrees: f64| camera_at(degrees.to_radians(), 1.5, size))
            .collect()
    }

    /// A film of [`SyntheticPerson::motion`] by [`SyntheticPerson::train_camera`].
    pub fn capture(&self, frames: usize, size: u32) -> (PoseTrack, Vec<FrameImage>) {
        self.film(&self.motion(frames), size)
    }

    /// A film of `poses` by [`SyntheticPerson::train_camera`].
    pub fn film(&self, poses: &[Pose], size: u32) -> (PoseTrack, Vec<FrameImage>) {
        let camera = Self::train_camera(size);
        let images = poses
            .iter()
            .map(|pose| self.render(pose, &camera))
            .collect();
        let track = PoseTrack {
            skeleton: self.skeleton(),
            image_size: [size, size],
            fps: FPS,
            distortion: [0.0; 5],
            frames: (0..)
                .zip(poses)
                .map(|(index, pose)| camera.to_frame(index, pose))
                .collect(),
        };
        (track, images)
    }
}

/// A camera 3.2 m from the target's axis, `angle` radians to the left of the person's front.
fn camera_at(angle: f64, height: f64, size: u32) -> Camera {
    const DISTANCE: f64 = 3.2;
    let eye = [DISTANCE * angle.sin(), height, DISTANCE * angle.cos()];
    let focal = f64::from(size) * DISTANCE / VIEW_HEIGHT;
    Camera::look_at(eye, TARGET, UP, focal, size, size)
}

#[cfg(test)]
mod tests;
