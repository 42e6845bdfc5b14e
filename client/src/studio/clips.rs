//! Motions of captures on the body of an exported person.

use crate::api::ClientError;
use anyhow::Context;
use std::path::Path;
use yoto_capture::camera::Camera;
use yoto_capture::skeleton::{Pose, Skeleton, retarget, transfer};
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

/// The frame of a capture whose pose a file has.
pub(crate) struct ChosenFrame<'a> {
    pub dir: &'a Path,
    pub track: &'a PoseTrack,
    pub frame: &'a pose_track::Frame,
}

impl ChosenFrame<'_> {
    /// Its pose on the body of `target`.
    pub fn pose(&self, target: &Skeleton) -> anyhow::Result<Pose> {
        let place = || format!("{}: frame {}", self.dir.display(), self.frame.index);
        let pose = Pose::from_frame(self.frame).with_context(place)?;
        retarget(&driver(self.dir, self.track)?, target, &pose).with_context(place)
    }
}

/// The skeleton that moves in the capture in `dir`.
fn driver(dir: &Path, track: &PoseTrack) -> anyhow::Result<Skeleton> {
    Skeleton::from_track(&track.skeleton).with_context(|| format!("{}: skeleton", dir.display()))
}

/// Gives a number to each clip whose name an earlier one has.
pub(crate) fn tell_apart(clips: &mut [Clip]) {
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

/// The motion of the capture in `dir` on the body of `target`.
pub(crate) fn clip(dir: &Path, track: &PoseTrack, target: &Skeleton) -> anyhow::Result<Clip> {
    let place = |at: usize| format!("{}: frame {}", dir.display(), track.frames[at].index);
    let frames = track.frames.iter().enumerate();
    let poses = frames.map(|(at, frame)| Pose::from_frame(frame).with_context(|| place(at)));
    let poses = poses.collect::<anyhow::Result<Vec<_>>>()?;
    let camera = track.frames.first();
    let camera = camera.map(|frame| Camera::from_frame(frame, track.image_size));
    let up = match camera {
        Some(camera) => camera.with_context(|| place(0))?.world_up(),
        None => [0.0, 1.0, 0.0],
    };
    let seconds = (0..poses.len()).map(|at| at as f64 / track.fps);
    let seconds: Vec<f64> = seconds.collect();
    let poses = transfer(&driver(dir, track)?, target, &poses, &seconds, up)
        .map_err(|(at, error)| anyhow::Error::new(error).context(place(at)))?;
    let name = dir.file_name().unwrap_or(dir.as_os_str());
    Ok(Clip {
        name: name.to_string_lossy().into_owned(),
        fps: track.fps,
        poses,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
