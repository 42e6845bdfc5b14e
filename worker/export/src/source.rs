//! Motions of captures and of files in requests, before they are transferred to a person's body.

use crate::clip::{Clip, UP};
use yoto_capture::ViewError;
use yoto_capture::camera::Camera;
use yoto_capture::skeleton::transform::{add, dot, length, normalised, rodrigues};
use yoto_capture::skeleton::{Pose, Skeleton, SkeletonError, Vec3, timing, transfer};
use yoto_proto::frame_steps::chosen_below;
use yoto_proto::pose_track::{self, Frame, PoseTrack};
use yoto_proto::v1::{CaptureMotion, MotionClip, Violation};

/// Why a motion can't be used.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// An invalid pose or camera.
    #[error("{location}")]
    View {
        /// The motion and the frame.
        location: String,
        /// What is wrong.
        source: ViewError,
    },
    /// A clip with an invalid skeleton.
    #[error("{location}: {}", pose_track::describe(violation))]
    Clip {
        /// The motion.
        location: String,
        /// What is wrong.
        violation: Box<Violation>,
    },
    /// An invalid skeleton, or one that differs too much from the body.
    #[error("{location}")]
    Body {
        /// The motion, and the frame if a single one is at fault.
        location: String,
        /// What is wrong.
        source: SkeletonError,
    },
    /// No such frame.
    #[error("{location}: no frame {number} among its {frames}")]
    NoFrame {
        /// The motion.
        location: String,
        /// Number of the frame.
        number: u32,
        /// Number of frames in the motion.
        frames: usize,
    },
    /// More frames than there are.
    #[error(
        "{location}: {wanted} frames, but it has {left} from frame {first} on in steps of {step}"
    )]
    TooFew {
        /// The motion.
        location: String,
        /// Number of wanted frames.
        wanted: usize,
        /// Number of frames in the motion.
        left: usize,
        /// Number of the first frame.
        first: u32,
        /// Frames from one to the next.
        step: usize,
    },
    /// No frame before the end.
    #[error("{location}: no frame from frame {first} on has a number below {end}")]
    NoneBelow {
        /// The motion.
        location: String,
        /// Number of the first frame.
        first: u32,
        /// Upper bound of the frame numbers, exclusive.
        end: u32,
    },
}

/// Largest angle between a camera's up and that of a person who stands before it, radians: cameras look down by 50° at most, in general.
const LEANS: f64 = 50.0 * DEGREE;
/// Largest angle between an axis of a world and a person who stands in it, radians: who leans farther does not tell.
const NEAR: f64 = 35.0 * DEGREE;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// A motion of any skeleton.
#[derive(Clone, Debug)]
pub struct Source {
    /// Name of the clip, also for messages.
    name: String,
    skeleton: pose_track::Skeleton,
    poses: Vec<Pose>,
    /// Frame number of each pose, which gives its time.
    numbers: Vec<u32>,
    /// Frames per second of the frame numbers.
    fps: f64,
    /// The up axis of its world.
    up: Vec3,
    /// Whether the world is the camera of a frame. Its up axis is only near to that of the scene.
    of_camera: bool,
}

impl Source {
    /// The motion of a capture's `track`.
    ///
    /// # Errors
    /// An invalid pose or first camera.
    pub fn track(name: &str, track: &PoseTrack) -> Result<Self, SourceError> {
        let fault = |number: u32| {
            move |source| SourceError::View {
                location: format!("{name}: frame {number}"),
                source,
            }
        };
        let frames = track.frames.iter();
        let poses = frames.map(|frame| Pose::from_frame(frame).map_err(fault(frame.index)));
        let poses: Vec<Pose> = poses.collect::<Result<_, _>>()?;
        let camera = track
            .frames
            .first()
            .map(|first| Camera::from_frame(first, track.image_size).map_err(fault(first.index)));
        let camera = camera.transpose()?;
        let of_first = camera.as_ref().map_or(UP, Camera::world_up);
        let up = stood(&poses).and_then(nearest_axis).unwrap_or(of_first);
        let is_the_world = |frame: &Frame| {
            let camera = Camera::from_frame(frame, track.image_size);
            camera.is_ok_and(|it| it.is_the_world())
        };
        // With a moving camera, the world is that of one frame.
        let of_camera = track.frames.iter().any(is_the_world);
        Ok(Self {
            name: name.to_owned(),
            poses,
            numbers: track.frames.iter().map(|it| it.index).collect(),
            skeleton: track.skeleton.clone(),
            fps: track.fps,
            up,
            of_camera,
        })
    }

    /// The motion of a `clip`, with frame numbers from 0. `up` is the up axis of its world; it is y unless `up`
    /// has three numbers.
    ///
    /// # Errors
    /// An invalid skeleton or pose.
    pub fn clip(name: &str, clip: &MotionClip, up: &[f64]) -> Result<Self, SourceError> {
        let skeleton = clip.skeleton.clone().unwrap_or_default();
        let skeleton = pose_track::Skeleton::from_proto(skeleton);
        let skeleton = skeleton.map_err(|violation| SourceError::Clip {
            location: name.to_owned(),
            violation,
        })?;
        let poses = clip.poses.iter().enumerate().map(|(at, pose)| {
            Pose::from_proto(pose).map_err(|source| SourceError::View {
                location: format!("{name}: frame {at}"),
                source,
            })
        });
        let poses: Vec<Pose> = poses.collect::<Result<_, _>>()?;
        Ok(Self {
            name: name.to_owned(),
            skeleton,
            fps: clip.fps,
            numbers: (0..poses.len() as u32).collect(),
            poses,
            up: up.try_into().unwrap_or(UP),
            of_camera: false,
        })
    }

    /// The frames of a capture's motion that `part` selects.
    ///
    /// # Errors
    /// If there is no such frame, there are too few, or none before the end.
    pub fn part(mut self, part: &CaptureMotion) -> Result<Self, SourceError> {
        let first = match part.first_frame {
            Some(number) => self.find(number)?,
            None => 0,
        };
        let (step, count, end) = (part.frame_step, part.frame_count, part.end_frame);
        let chosen = chosen_below(self.numbers.iter().copied(), first, step, count, end);
        let chosen = chosen.map_err(|left| {
            let first = self.numbers.get(first).copied().unwrap_or_default();
            let location = self.name.clone();
            match end {
                Some(end) => SourceError::NoneBelow {
                    location,
                    first,
                    end,
                },
                None => SourceError::TooFew {
                    location,
                    wanted: count as usize,
                    left,
                    first,
                    step: step.max(1) as usize,
                },
            }
        })?;
        self.poses = chosen.iter().map(|at| self.poses[*at].clone()).collect();
        self.numbers = chosen.iter().map(|at| self.numbers[*at]).collect();
        Ok(self)
    }

    /// The same motion with another name.
    pub fn called(mut self, name: &str) -> Self {
        name.clone_into(&mut self.name);
        self
    }

    /// The whole motion on the body of `target`, at its original speed, with poses at equal intervals.
    ///
    /// # Errors
    /// If the skeletons are too different.
    pub fn on(&self, target: &Skeleton) -> Result<Clip, SourceError> {
        let (poses, fps) = timing::even(self.poses.clone(), &self.numbers, self.fps);
        let seconds: Vec<f64> = (0..poses.len()).map(|at| at as f64 / fps).collect();
        let poses = transfer(&self.driver(target)?, target, &poses, &seconds, self.up);
        let poses = poses.map_err(|(at, source)| self.at_fault(at, source))?;
        Ok(Clip {
            name: self.name.clone(),
            fps,
            poses,
            up: self.level_up(),
        })
    }

    /// The pose of each frame on the body of `target`.
    ///
    /// # Errors
    /// If the skeletons are too different.
    pub fn poses(&self, target: &Skeleton) -> Result<Vec<Pose>, SourceError> {
        let driver = self.driver(target)?;
        let seconds = timing::seconds(&self.numbers, self.fps);
        let poses = transfer(&driver, target, &self.poses, &seconds, self.up);
        poses.map_err(|(at, source)| self.at_fault(at, source))
    }

    /// The pose of the frame with this `number` on the body of `target`.
    ///
    /// # Errors
    /// If there is no such frame, or the skeletons are too different.
    pub fn pose(&self, number: u32, target: &Skeleton) -> Result<Pose, SourceError> {
        let at = self.find(number)?;
        // On the floor that the whole motion treads on.
        Ok(self.poses(target)?.swap_remove(at))
    }

    /// The up axis of the motion's world.
    pub fn up(&self) -> Vec3 {
        self.up
    }

    /// The same for a level floor: where the world is a camera's, whose tilt nobody knows, the mean of the body's own up axis, if that
    /// is at most [`LEANS`] away. Whoever lies or kneels does not tell.
    fn level_up(&self) -> Vec3 {
        let stood = stood(&self.poses).filter(|it| dot(*it, self.up) > LEANS.cos());
        stood.filter(|_| self.of_camera).unwrap_or(self.up)
    }

    /// Index of the pose with the frame `number`.
    fn find(&self, number: u32) -> Result<usize, SourceError> {
        let found = self.numbers.iter().position(|it| *it == number);
        found.ok_or_else(|| SourceError::NoFrame {
            location: self.name.clone(),
            number,
            frames: self.numbers.len(),
        })
    }

    /// The skeleton of the motion.
    fn driver(&self, target: &Skeleton) -> Result<Skeleton, SourceError> {
        Skeleton::of_motion(&self.skeleton, target).map_err(|source| SourceError::Body {
            location: format!("{}: skeleton", self.name),
            source,
        })
    }

    fn at_fault(&self, at: usize, source: SkeletonError) -> SourceError {
        let name = &self.name;
        let location = match self.numbers.get(at) {
            Some(number) => format!("{name}: frame {number}"),
            None => name.clone(),
        };
        SourceError::Body { location, source }
    }
}

/// The mean of the body's own up axis in the world, of length 1; `None` without one.
fn stood(poses: &[Pose]) -> Option<Vec3> {
    let axes = poses.iter().filter_map(|pose| {
        let turn = rodrigues(*pose.rotations_f64().first()?);
        Some(turn.map(|row| row[1]))
    });
    let sum = axes.fold([0.0; 3], add);
    (length(sum) > 1e-3).then(|| normalised(sum))
}

/// The axis of the world, or its opposite, that is within [`NEAR`] of `up`. A camera that looks down steeply is nearer to another one.
fn nearest_axis(up: Vec3) -> Option<Vec3> {
    let axis = (0..3).find(|axis| up[*axis].abs() > NEAR.cos())?;
    let mut nearest = [0.0; 3];
    nearest[axis] = up[axis].signum();
    Some(nearest)
}

/// All `sources` on the body of `target`, with unique names.
///
/// # Errors
/// As [`Source::on`].
pub fn clips<'a>(
    sources: impl IntoIterator<Item = &'a Source>,
    target: &Skeleton,
) -> Result<Vec<Clip>, SourceError> {
    let clips = sources.into_iter().map(|source| source.on(target));
    let mut clips = clips.collect::<Result<Vec<_>, _>>()?;
    tell_apart(&mut clips);
    Ok(clips)
}

/// Adds a number to the name of each clip that has the name of an earlier one.
fn tell_apart(clips: &mut [Clip]) {
    for index in 1..clips.len() {
        let (earlier, later) = clips.split_at_mut(index);
        let taken = |name: &str| earlier.iter().any(|clip| clip.name == name);
        let plain = later[0].name.clone();
        let mut number = 2;
        while taken(&later[0].name) {
            later[0].name = format!("{plain} ({number})");
            number += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1;

    #[test]
    fn clips_of_one_name_are_numbered() {
        let named = |name: &str| Clip {
            name: name.into(),
            fps: 30.0,
            poses: Vec::new(),
            up: UP,
        };
        let mut clips = ["walk", "run", "walk", "walk (2)", "walk"].map(named);
        tell_apart(&mut clips);
        let names = clips.map(|clip| clip.name);
        assert_eq!(
            names,
            ["walk", "run", "walk (2)", "walk (2) (2)", "walk (3)"]
        );
    }

    /// Ten frames at 60 per second with a knee that rotates by 0.1 more in each, of a body without a size.
    fn motion() -> Source {
        let pose = |at: usize| v1::BodyPose {
            rotations: vec![0.0, 0.0, 0.0, 0.1 * at as f32, 0.0, 0.0],
            translation: vec![0.0, 0.0, at as f32],
        };
        let clip = MotionClip {
            skeleton: Some(v1::Skeleton {
                names: vec!["pelvis".into(), "l_knee".into()],
                parents: vec![-1, 0],
                rest_joints: Vec::new(),
            }),
            poses: (0..10).map(pose).collect(),
            fps: 60.0,
            ..MotionClip::default()
        };
        Source::clip("walk", &clip, &[]).expect("a motion")
    }

    fn body() -> Skeleton {
        Skeleton {
            names: vec!["pelvis".into(), "l_knee".into()],
            parents: vec![None, Some(0)],
            rest: vec![[0.0, 0.9, 0.0], [0.1, 0.5, 0.0]],
        }
    }

    fn part(first: Option<u32>, frame_count: u32, frame_step: u32) -> CaptureMotion {
        CaptureMotion {
            first_frame: first,
            frame_count,
            frame_step,
            ..CaptureMotion::default()
        }
    }

    #[test]
    fn a_part_has_the_frames_that_it_chooses_by_their_numbers() {
        let source = motion().part(&part(Some(2), 3, 3)).expect("is there");
        let clip = source.on(&body()).expect("a clip");
        assert_eq!(clip.name, "walk");
        assert!((clip.fps - 20.0).abs() < 1e-9, "{}", clip.fps);
        let knees = clip.poses.iter().map(|pose| pose.rotations[1][0]);
        assert_eq!(knees.collect::<Vec<_>>(), [0.2, 0.5, 0.8]);
        // The motion has the body's size, and so have its steps.
        assert_eq!(clip.poses[1].translation, [0.0, 0.0, 5.0]);
        let pose = source.pose(8, &body()).expect("is chosen");
        assert_eq!(pose.rotations[1][0], 0.8);
        let error = source.pose(3, &body()).expect_err("is left out");
        assert_eq!(error.to_string(), "walk: no frame 3 among its 3");
        let whole = motion().part(&part(None, 0, 0)).expect("is there");
        assert_eq!(whole.on(&body()).expect("a clip").poses.len(), 10);
    }

    #[test]
    fn a_world_is_as_level_as_its_file_tells_and_one_of_a_camera_as_who_stands_in_it() {
        let up = |lean: f32, of_camera: bool| {
            let mut source = motion();
            source.of_camera = of_camera;
            for pose in &mut source.poses {
                pose.rotations[0] = [lean, 0.0, 0.0];
            }
            source.on(&body()).expect("a clip").up
        };
        assert_eq!(up(0.2, false), UP);
        let leans = up(0.2, true);
        assert!((leans[2] - 0.2_f64.sin()).abs() < 1e-6, "{leans:?}");
        assert_eq!(up(1.4, true), UP, "whoever lies does not tell");
    }

    #[test]
    fn frames_that_are_not_there_are_refused() {
        let refused = |part| motion().part(&part).expect_err("refused").to_string();
        assert_eq!(
            refused(part(Some(10), 0, 0)),
            "walk: no frame 10 among its 10"
        );
        assert_eq!(
            refused(part(Some(4), 4, 2)),
            "walk: 4 frames, but it has 3 from frame 4 on in steps of 2"
        );
        let early = CaptureMotion {
            first_frame: Some(4),
            end_frame: Some(3),
            ..CaptureMotion::default()
        };
        assert_eq!(
            refused(early),
            "walk: no frame from frame 4 on has a number below 3"
        );
    }

    #[test]
    fn a_body_of_other_joints_is_refused_with_the_frame() {
        let mut other = body();
        other.names = vec!["root".into(), "tip".into()];
        let error = motion().on(&other).expect_err("nothing in common");
        assert_eq!(error.to_string(), "walk: frame 0");
    }
}
