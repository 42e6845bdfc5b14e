//! Motions of this disk, in the form of requests: those of captures and of files.

use crate::args::frame_range::FrameRange;
use anyhow::{Context, ensure};
use std::path::Path;
use yoto_capture::camera::Camera;
use yoto_capture::skeleton::{Pose, timing};
use yoto_import::capture_dir::{named, read_track};
use yoto_import::motion::Motion;
use yoto_proto::v1::{BodyPose, CaptureMotion, ExportMotion, MotionClip, export_motion};

/// A motion whose frames have numbers.
pub(crate) struct Numbered {
    /// All of it, with poses at equal times.
    pub motion: ExportMotion,
    /// The folder or file, for messages.
    source: String,
    /// Number and pose of each frame; none of a capture of the service, which alone knows them.
    frames: Option<Vec<(u32, BodyPose)>>,
}

impl Numbered {
    /// The motion of the capture in `dir`, whose first camera gives the up direction of its world.
    pub(super) fn capture(dir: &Path) -> anyhow::Result<Self> {
        let source = dir.display().to_string();
        let track = read_track(dir)?;
        let frame = |number: u32| format!("{source}: frame {number}");
        let poses = track.frames.iter();
        let poses = poses.map(|it| Pose::from_frame(it).with_context(|| frame(it.index)));
        let poses: Vec<Pose> = poses.collect::<anyhow::Result<_>>()?;
        let numbers: Vec<u32> = track.frames.iter().map(|it| it.index).collect();
        let bodies = poses.iter().map(Pose::to_proto);
        let frames = numbers.iter().copied().zip(bodies).collect();
        let (poses, fps) = timing::even(poses, &numbers, track.fps);
        let clip = MotionClip {
            skeleton: Some(track.skeleton.to_proto()),
            poses: poses.iter().map(Pose::to_proto).collect(),
            fps,
            ..MotionClip::default()
        };
        let up = match track.frames.first() {
            Some(first) => {
                let camera = Camera::from_frame(first, track.image_size);
                camera
                    .with_context(|| frame(first.index))?
                    .world_up()
                    .into()
            }
            None => Vec::new(),
        };
        Ok(Self {
            motion: of_clip(named(dir), clip, up),
            source,
            frames: Some(frames),
        })
    }

    /// The frames in `range` of the `motion` in `file`.
    pub(super) fn file(file: &Path, motion: &Motion, range: FrameRange) -> anyhow::Result<Self> {
        let source = file.display().to_string();
        let [first, end, step] = [range.first, range.end, range.step].map(|it| it as usize);
        let clip = motion.clip(first, end, step, 0);
        ensure!(
            !clip.poses.is_empty(),
            "{source} has {} frames, none of them chosen by --range",
            motion.frames.len()
        );
        let numbers = (range.first..).step_by(step);
        let frames = numbers.zip(clip.poses.iter().cloned()).collect();
        let name = named(&file.with_extension(""));
        Ok(Self {
            motion: of_clip(name, clip, Vec::new()),
            source,
            frames: Some(frames),
        })
    }

    /// The frames in `range` of the capture of `driver`, a subject of the service called `name`.
    pub(super) fn driver(name: &str, driver: String, range: Option<FrameRange>) -> Self {
        let capture = CaptureMotion {
            driver,
            ..range.unwrap_or(FrameRange::ALL).of_capture()
        };
        Self {
            motion: ExportMotion {
                motion: Some(export_motion::Motion::Capture(capture)),
                ..ExportMotion::default()
            },
            source: name.to_owned(),
            frames: None,
        }
    }

    /// The motion with the pose of the frame with this `number`, and that frame's number in it: of a motion of
    /// this disk, the pose alone.
    pub(super) fn still(self, number: u32) -> anyhow::Result<(ExportMotion, u32)> {
        let Self {
            mut motion,
            source,
            frames,
        } = self;
        let (Some(frames), Some(export_motion::Motion::Clip(clip))) = (frames, &mut motion.motion)
        else {
            return Ok((motion, number));
        };
        let count = frames.len();
        let found = frames.into_iter().find(|(it, _)| *it == number);
        let (_, pose) =
            found.with_context(|| format!("{source}: no frame {number} among its {count}"))?;
        clip.poses = vec![pose];
        Ok((motion, 0))
    }
}

fn of_clip(name: String, clip: MotionClip, up: Vec<f64>) -> ExportMotion {
    ExportMotion {
        name,
        motion: Some(export_motion::Motion::Clip(clip)),
        up,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_import::motion::MotionFrame;
    use yoto_proto::pose_track::Skeleton;
    use yoto_synthetic::SyntheticPerson;

    /// Ten frames at 60 per second whose knee turns by a tenth more each, of a body without a size.
    fn motion() -> Motion {
        let frame = |at: usize| MotionFrame {
            rotations: vec![[0.0; 3], [0.1 * at as f64, 0.0, 0.0]],
            root: [0.0, 0.0, at as f64],
        };
        Motion {
            skeleton: Skeleton {
                names: vec!["pelvis".into(), "l_knee".into()],
                parents: vec![-1, 0],
                rest_joints: Vec::new(),
            },
            frames: (0..10).map(frame).collect(),
            fps: 60.0,
            matched: Vec::new(),
            unmatched: Vec::new(),
            notes: Vec::new(),
        }
    }

    fn of_file(range: &str) -> anyhow::Result<Numbered> {
        let range = range.parse().expect("a range");
        Numbered::file(Path::new("moves/walk.bvh"), &motion(), range)
    }

    fn knees(motion: &ExportMotion) -> Vec<f32> {
        let Some(export_motion::Motion::Clip(clip)) = &motion.motion else {
            panic!("no clip");
        };
        clip.poses.iter().map(|pose| pose.rotations[3]).collect()
    }

    #[test]
    fn a_file_s_range_is_a_clip_by_the_file_s_name() {
        let chosen = of_file("2..9:3").expect("a motion").motion;
        assert_eq!(chosen.name, "walk");
        assert_eq!(knees(&chosen), [0.2, 0.5, 0.8]);
        let Some(export_motion::Motion::Clip(clip)) = chosen.motion else {
            panic!("no clip");
        };
        assert_eq!(clip.fps, 20.0);
    }

    #[test]
    fn a_still_has_one_pose_of_a_frame_that_was_chosen() {
        let (still, frame) = of_file("2..9:3").expect("a motion").still(8).expect("one");
        assert_eq!((knees(&still), frame), (vec![0.8], 0));
        let error = of_file("2..9:3").expect("a motion").still(3).err();
        let message = error.expect("is left out").to_string();
        assert_eq!(message, "moves/walk.bvh: no frame 3 among its 3");
        let driven = Numbered::driver("bob", "subjects/b".into(), None);
        let (whole, frame) = driven.still(30).expect("the service knows");
        assert_eq!(frame, 30);
        assert!(matches!(
            whole.motion,
            Some(export_motion::Motion::Capture(_))
        ));
    }

    #[test]
    fn a_capture_s_motion_keeps_the_time_of_frames_that_were_left_out() {
        let dir = tempfile::tempdir().expect("a folder");
        let (track, _) = SyntheticPerson::cast(1, 7)[0].capture(4, 32);
        let numbered = |numbers: [u32; 4]| {
            let mut track = track.clone();
            for (frame, number) in track.frames.iter_mut().zip(numbers) {
                frame.index = number;
            }
            let json = serde_json::to_string(&track).expect("writes");
            std::fs::write(dir.path().join("poses.json"), json).expect("writes");
            Numbered::capture(dir.path()).expect("reads")
        };
        let clip = |motion: ExportMotion| match motion.motion {
            Some(export_motion::Motion::Clip(clip)) => clip,
            other => panic!("no clip: {other:?}"),
        };
        for (numbers, poses, rate) in [([60, 62, 64, 66], 4, 0.5), ([60, 61, 64, 66], 7, 1.0)] {
            let whole = clip(numbered(numbers).motion);
            assert_eq!(whole.poses.len(), poses);
            assert!((whole.fps / track.fps - rate).abs() < 1e-9, "{}", whole.fps);
            let third = Pose::from_frame(&track.frames[2]).expect("a pose");
            let (still, _) = numbered(numbers).still(64).expect("is there");
            assert_eq!(clip(still).poses, [third.to_proto()]);
        }
    }

    #[test]
    fn a_range_beyond_the_end_is_refused() {
        let message = of_file("10..20").err().expect("no frame").to_string();
        assert!(
            message.contains("walk.bvh has 10 frames, none of them"),
            "{message}"
        );
    }

    #[test]
    fn a_range_of_a_capture_is_the_service_s_to_find() {
        let range = "0..60:2".parse().expect("a range");
        let driven = Numbered::driver("bob", "subjects/b".into(), Some(range)).motion;
        let Some(export_motion::Motion::Capture(part)) = driven.motion else {
            panic!("no capture");
        };
        assert_eq!(
            (part.first_frame, part.end_frame, part.frame_step),
            (None, Some(60), 2)
        );
    }
}
