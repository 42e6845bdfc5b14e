//! Pictures of what a model knows about one person, from which another model learns. Their poses are those of motions,
//! and their cameras surround the person. Frames of the person's capture may follow: they have detail that the field has
//! lost.

use super::DistillError;
use crate::render::{RenderError, RenderView, Rendered, Renderer};
use std::f64::consts::TAU;
use yoto_capture::camera::{Camera, Pose, fitted_size};
use yoto_capture::skeleton::transform::{
    Vec3, add, apply, cross, length, normalised, rigid, rodrigues, scale, sub,
};
use yoto_capture::{FrameImage, Shard, ShardBuilder};
use yoto_proto::pose_track::PoseTrack;

/// Distance of the cameras, metres.
const DISTANCE: f64 = 3.5;
/// Reach of a person beyond their joints, metres.
const REACH: f64 = 0.25;
/// Most frames of a capture, and most bytes of their pictures.
const MOST_FILMED: usize = 200;
const FILMED_BYTES: usize = 200 << 20;
/// Bytes of a pixel: colour and mask.
const PIXEL: usize = 4;
/// Elevations of the cameras, degrees, one after the other. Few captures show crowns and soles.
const ELEVATIONS: [f64; 4] = [0.0, 25.0, -10.0, 45.0];
/// Steps through motions and around the person: the most even sequence in two dimensions, however long it is
/// (Roberts' R2).
const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// A model as it shows a person, from which another learns.
pub struct Teacher<'a> {
    /// The model that knows them.
    pub renderer: &'a Renderer,
    /// Their slot in it.
    pub slot: usize,
    /// Poses of their body.
    pub poses: &'a [Pose],
    /// The up axis of the poses' world.
    pub up: Vec3,
    /// Width and height of the pictures, pixels.
    pub size: [u32; 2],
    /// Frames of the person's capture, which follow the rendered pictures.
    pub capture_frames: &'a [CaptureFrame],
}

/// A frame of a capture, of the size of the rendered pictures.
pub struct CaptureFrame {
    /// The pose of the person's body.
    pub pose: Pose,
    /// The camera that saw it, in the poses' world.
    pub camera: Camera,
    /// The picture that it took.
    pub image: FrameImage,
}

impl CaptureFrame {
    /// Frames of a `shard` with at most `size` pixels along their shorter side, as the field's pictures have, with the `poses`
    /// of the person's body in all frames of the shard: evenly, at most [`MOST_FILMED`] and [`FILMED_BYTES`].
    ///
    /// # Errors
    /// An invalid camera.
    pub fn of(shard: &Shard, poses: &[Pose], size: u32) -> Result<Vec<Self>, DistillError> {
        let [short, long] = {
            let [width, height] = shard.track.image_size;
            [width.min(height), width.max(height)].map(|side| side.max(1))
        };
        let size = (f64::from(size.min(short)) * f64::from(long) / f64::from(short)).round() as u32;
        let (width, height) = fitted_size(long, short, size);
        let bytes = PIXEL * width as usize * height as usize;
        let most = (FILMED_BYTES / bytes).clamp(1, MOST_FILMED);
        let step = shard.frames().div_ceil(most).max(1);
        let frames = shard.track.frames.iter().zip(poses).enumerate();
        let capture_frames = frames.step_by(step).map(|(index, (frame, pose))| {
            let camera = Camera::from_frame(frame, shard.track.image_size);
            let camera = camera.map_err(|source| DistillError::View {
                frame: frame.index,
                source,
            })?;
            Ok(Self {
                pose: pose.clone(),
                camera: camera.scaled_to(size),
                image: shard.image(index).resized(size),
            })
        });
        capture_frames.collect()
    }

    /// Width and height of the `capture_frames`, which are alike; `None` without any.
    pub fn size(capture_frames: &[Self]) -> Option<[u32; 2]> {
        let first = capture_frames.first()?;
        Some([first.camera.width, first.camera.height])
    }
}

impl Teacher<'_> {
    /// A shard of pictures: they are rendered while `wanted`, called with the number of pictures so far, returns true, and at
    /// least one; then the frames of the capture follow. Rendering stops when `keep_going` returns false, which is asked
    /// before each batch of rays: a picture of the paper's tiers takes a minute.
    ///
    /// # Errors
    /// Without a person or a pose, or if a picture can't be rendered; [`DistillError::Stopped`].
    pub fn render_shard(
        &self,
        mut wanted: impl FnMut(usize) -> bool,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<Shard, DistillError> {
        let body = self.renderer.skeleton(self.slot);
        let body = body.ok_or(DistillError::NoSuchSlot(self.slot))?;
        let (mut frames, mut images) = (Vec::new(), Vec::new());
        while frames.is_empty() || wanted(frames.len()) {
            let index = frames.len();
            let [moment, around] = STEPS.map(|step| (index as f64 * step).fract());
            let pose = (moment * self.poses.len() as f64) as usize;
            let pose = self.poses.get(pose).ok_or(DistillError::NoPoses)?;
            let camera = self.camera(&body.posed_joints(pose), around, index);
            let view = RenderView {
                slot: self.slot,
                pose: pose.clone(),
                camera: camera.clone(),
                background: [0.0; 3],
            };
            let rendered = self
                .renderer
                .render_scene(&view.into(), &mut |_| keep_going())
                .map_err(|source| match source {
                    RenderError::Stopped => DistillError::Stopped,
                    source => DistillError::Render { index, source },
                })?;
            images.push(picture(&rendered));
            frames.push(camera.to_frame(index as u32, pose));
        }
        for CaptureFrame { pose, camera, .. } in self.capture_frames {
            frames.push(camera.to_frame(frames.len() as u32, pose));
        }
        let mut shard = ShardBuilder::new(PoseTrack {
            skeleton: body.to_track(),
            image_size: self.size,
            fps: 30.0,
            distortion: [0.0; 5],
            frames,
        });
        for image in images
            .iter()
            .chain(self.capture_frames.iter().map(|it| &it.image))
        {
            shard.push(image)?;
        }
        Ok(shard.finish()?)
    }

    /// A camera that sees all of `joints`, a share of the way `around` them.
    fn camera(&self, joints: &[Vec3], around: f64, index: usize) -> Camera {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for joint in joints {
            for axis in 0..3 {
                low[axis] = low[axis].min(joint[axis]);
                high[axis] = high[axis].max(joint[axis]);
            }
        }
        let middle = scale(add(low, high), 0.5);
        let far = |joint: &Vec3| length(sub(*joint, middle));
        let radius = joints.iter().map(far).fold(0.0, f64::max) + REACH;
        let elevation = ELEVATIONS[index % ELEVATIONS.len()].to_radians();
        let any = if self.up[0].abs() < 0.9 {
            [1.0, 0.0, 0.0]
        } else {
            [0.0, 0.0, 1.0]
        };
        let level = normalised(cross(self.up, any));
        let rotation = rigid(rodrigues(scale(self.up, TAU * around)), [0.0; 3]);
        let level = scale(apply(&rotation, level), elevation.cos());
        let direction = add(level, scale(self.up, elevation.sin()));
        let eye = add(middle, scale(direction, DISTANCE.max(2.0 * radius)));
        let distance = length(sub(eye, middle));
        // The sphere around the body touches the picture's nearer edges.
        let [width, height] = self.size;
        let focal = 0.5 * f64::from(width.min(height)) / (radius / distance).asin().tan();
        Camera::look_at(eye, middle, self.up, focal, width, height)
    }
}

/// A frame over black, as a capture has it.
fn picture(rendered: &Rendered) -> FrameImage {
    let byte = |alpha: &f32| (alpha.clamp(0.0, 1.0) * 255.0).round() as u8;
    FrameImage {
        width: rendered.width,
        height: rendered.height,
        rgb: rendered.to_rgb8(),
        mask: rendered.alpha.iter().map(byte).collect(),
    }
}
