//! Motions, of captures and of files, on the body of an exported person.

use crate::api::ClientError;
use crate::import::motion::Motion;
use anyhow::Context;
use std::path::Path;
use yoto_capture::camera::Camera;
use yoto_capture::skeleton::{Pose, Skeleton, Vec3, retarget, transfer};
use yoto_export::clip::Clip;
use yoto_proto::pose_track::{self, PoseTrack};

/// The pose track of a capture's folder.
pub(crate) fn read_track(dir: &Path) -> anyhow::Result<PoseTrack> {
    let path = dir.join(pose_track::FILE);
    let bytes = std::fs::read(&path).with_context(|| format!("reading {}", path.display()))?;
    PoseTrack::from_json(&bytes).map_err(|violations| {
        let place = dir.display().to_string();
        ClientError::BadCapture { place, violations }.into()
    })
}

/// A motion before anybody's body takes it.
pub(crate) struct Source {
    /// Name of its clip: that of the capture's folder, or of the file without its extension.
    name: String,
    /// The folder or file, for messages.
    place: String,
    skeleton: pose_track::Skeleton,
    poses: Vec<Pose>,
    /// Number of each pose's frame in the capture or file.
    numbers: Vec<u32>,
    fps: f64,
    /// The up axis of its world.
    up: Vec3,
}

impl Source {
    /// The motion of the capture in `dir`.
    pub fn capture(dir: &Path) -> anyhow::Result<Self> {
        Self::track(dir, &read_track(dir)?)
    }

    /// The motion of a capture's `track`, of the folder `dir`.
    pub fn track(dir: &Path, track: &PoseTrack) -> anyhow::Result<Self> {
        let place = dir.display().to_string();
        let frame = |number: u32| format!("{place}: frame {number}");
        let poses = track
            .frames
            .iter()
            .map(|it| Pose::from_frame(it).with_context(|| frame(it.index)));
        let up = match track.frames.first() {
            Some(first) => Camera::from_frame(first, track.image_size)
                .with_context(|| frame(first.index))?
                .world_up(),
            None => [0.0, 1.0, 0.0],
        };
        Ok(Self {
            name: named(dir.file_name().unwrap_or(dir.as_os_str())),
            poses: poses.collect::<anyhow::Result<_>>()?,
            numbers: track.frames.iter().map(|it| it.index).collect(),
            skeleton: track.skeleton.clone(),
            fps: track.fps,
            place,
            up,
        })
    }

    /// Frames first, first + step, … before end of the `motion` in `file`.
    pub fn file(
        file: &Path,
        motion: &Motion,
        [first, end, step]: [usize; 3],
    ) -> anyhow::Result<Self> {
        let place = file.display().to_string();
        let chosen = motion.clip(first, end, step, 0);
        let numbers: Vec<u32> = (first..)
            .step_by(step)
            .map(|it| it as u32)
            .take(chosen.poses.len())
            .collect();
        let poses = chosen.poses.iter().zip(&numbers).map(|(pose, number)| {
            Pose::from_proto(pose).with_context(|| format!("{place}: frame {number}"))
        });
        let poses: Vec<Pose> = poses.collect::<anyhow::Result<_>>()?;
        anyhow::ensure!(
            !poses.is_empty(),
            "{place} has {} frames, none of them chosen by --range",
            motion.frames.len()
        );
        Ok(Self {
            name: named(file.file_stem().unwrap_or(file.as_os_str())),
            skeleton: motion.skeleton.clone(),
            fps: chosen.fps,
            up: [0.0, 1.0, 0.0],
            poses,
            numbers,
            place,
        })
    }

    /// The whole motion on the body of `target`.
    pub fn on(&self, target: &Skeleton) -> anyhow::Result<Clip> {
        let seconds: Vec<f64> = (0..self.poses.len())
            .map(|at| at as f64 / self.fps)
            .collect();
        let poses = transfer(
            &self.driver(target)?,
            target,
            &self.poses,
            &seconds,
            self.up,
        )
        .map_err(|(at, error)| anyhow::Error::new(error).context(self.frame(at)))?;
        Ok(Clip {
            name: self.name.clone(),
            fps: self.fps,
            poses,
        })
    }

    /// The place among its poses of the frame with this `number`.
    pub fn find(&self, number: u32) -> anyhow::Result<usize> {
        let found = self.numbers.iter().position(|it| *it == number);
        found.with_context(|| {
            let count = self.numbers.len();
            format!("{}: no frame {number} among its {count}", self.place)
        })
    }

    /// Its pose number `at`, from 0, on the body of `target`.
    pub fn pose(&self, at: usize, target: &Skeleton) -> anyhow::Result<Pose> {
        let pose = self
            .poses
            .get(at)
            .with_context(|| format!("{}: no pose {at}", self.place))?;
        retarget(&self.driver(target)?, target, pose).with_context(|| self.frame(at))
    }

    /// The skeleton that moves.
    fn driver(&self, target: &Skeleton) -> anyhow::Result<Skeleton> {
        Skeleton::of_motion(&self.skeleton, target)
            .with_context(|| format!("{}: skeleton", self.place))
    }

    fn frame(&self, at: usize) -> String {
        match self.numbers.get(at) {
            Some(number) => format!("{}: frame {number}", self.place),
            None => self.place.clone(),
        }
    }
}

fn named(name: &std::ffi::OsStr) -> String {
    name.to_string_lossy().into_owned()
}

/// All `sources` on the body of `target`, each with a name of its own.
pub(crate) fn clips<'a>(
    sources: impl IntoIterator<Item = &'a Source>,
    target: &Skeleton,
) -> anyhow::Result<Vec<Clip>> {
    let clips = sources.into_iter().map(|source| source.on(target));
    let mut clips = clips.collect::<anyhow::Result<Vec<_>>>()?;
    tell_apart(&mut clips);
    Ok(clips)
}

/// Gives a number to each clip whose name an earlier one has.
fn tell_apart(clips: &mut [Clip]) {
    for place in 1..clips.len() {
        let (earlier, later) = clips.split_at_mut(place);
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
    use crate::import::motion::MotionFrame;

    #[test]
    fn clips_of_one_name_are_numbered() {
        let named = |name: &str| Clip {
            name: name.into(),
            fps: 30.0,
            poses: Vec::new(),
        };
        let mut clips = ["walk", "run", "walk", "walk (2)", "walk"].map(named);
        tell_apart(&mut clips);
        let names = clips.map(|clip| clip.name);
        assert_eq!(
            names,
            ["walk", "run", "walk (2)", "walk (2) (2)", "walk (3)"]
        );
    }

    /// Ten frames at 60 per second whose knee turns by a tenth more each, of a body without a size.
    fn motion() -> Motion {
        let frame = |at: usize| MotionFrame {
            rotations: vec![[0.0; 3], [0.1 * at as f64, 0.0, 0.0]],
            root: [0.0, 0.0, at as f64],
        };
        Motion {
            skeleton: pose_track::Skeleton {
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

    fn body() -> Skeleton {
        Skeleton {
            names: vec!["pelvis".into(), "l_knee".into()],
            parents: vec![None, Some(0)],
            rest: vec![[0.0, 0.9, 0.0], [0.1, 0.5, 0.0]],
        }
    }

    #[test]
    fn a_file_s_range_is_a_clip_by_the_file_s_name() {
        let file = Path::new("moves/walk.bvh");
        let source = Source::file(file, &motion(), [2, 9, 3]).expect("a motion");
        let clip = source.on(&body()).expect("a clip");
        assert_eq!((clip.name.as_str(), clip.fps), ("walk", 20.0));
        let knees = clip.poses.iter().map(|pose| pose.rotations[1][0]);
        assert_eq!(knees.collect::<Vec<_>>(), [0.2, 0.5, 0.8]);
        // As its size is the body's, so are its steps.
        assert_eq!(clip.poses[1].translation, [0.0, 0.0, 5.0]);
        let at = source.find(8).expect("is chosen");
        assert_eq!(
            source.pose(at, &body()).expect("a pose").rotations[1][0],
            0.8
        );
        let error = source.find(3).expect_err("is left out").to_string();
        assert_eq!(error, "moves/walk.bvh: no frame 3 among its 3");
    }

    #[test]
    fn a_range_beyond_the_end_is_refused() {
        let refused = Source::file(Path::new("walk.bvh"), &motion(), [10, 20, 1]).err();
        let message = refused.expect("no frame").to_string();
        assert!(
            message.contains("walk.bvh has 10 frames, none of them"),
            "{message}"
        );
    }
}
