//! Motions of captures on the body of an exported person.

use crate::api::ClientError;
use anyhow::Context;
use std::path::Path;
use yoto_capture::skeleton::{Pose, Skeleton, retarget};
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
        moved(self.dir, &driver(self.dir, self.track)?, target, self.frame)
    }
}

/// The skeleton that moves in the capture in `dir`.
fn driver(dir: &Path, track: &PoseTrack) -> anyhow::Result<Skeleton> {
    Skeleton::from_track(&track.skeleton).with_context(|| format!("{}: skeleton", dir.display()))
}

/// The pose of a frame of the capture in `dir`, on the body of `target`.
fn moved(
    dir: &Path,
    driver: &Skeleton,
    target: &Skeleton,
    frame: &pose_track::Frame,
) -> anyhow::Result<Pose> {
    let place = || format!("{}: frame {}", dir.display(), frame.index);
    let pose = Pose::from_frame(frame).with_context(place)?;
    retarget(driver, target, &pose).with_context(place)
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
    let driver = driver(dir, track)?;
    let frames = track.frames.iter();
    let poses = frames.map(|frame| moved(dir, &driver, target, frame));
    let name = dir.file_name().unwrap_or(dir.as_os_str());
    Ok(Clip {
        name: name.to_string_lossy().into_owned(),
        fps: track.fps,
        poses: poses.collect::<anyhow::Result<_>>()?,
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
