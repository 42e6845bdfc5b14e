//! Captures for quality measurements: training frames and held-out pictures.

use crate::alignment::Alignment;
use crate::display::Screen;
use crate::one_camera::{self, HeldOut, OneCamera};
use crate::pose_error::{PoseErrors, joints_apart};
use anyhow::{Context, ensure};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use yoto_avatar::evaluate::Protocol;
use yoto_avatar::evaluate::protocol::Pictures;
use yoto_avatar::render::FrameExposure;
use yoto_avatar::train::{TrainPerson, Trainer};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::{CaptureError, CaptureFolder, FrameImage, HeldOutView, Shard};
use yoto_proto::pose_track::PoseTrack;
use yoto_synthetic::SyntheticPerson;

/// The two kinds of held-out pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Split {
    /// Training poses from other cameras.
    NovelView,
    /// Held-out poses.
    NovelPose,
}

impl Split {
    /// The splits of a protocol.
    pub(super) fn of(protocol: &Protocol) -> &'static [Self] {
        match protocol.pictures {
            Pictures::Views => &[Self::NovelView],
            Pictures::ViewsAndPoses => &[Self::NovelView, Self::NovelPose],
        }
    }

    /// Title.
    pub(super) fn title(self) -> &'static str {
        match self {
            Self::NovelView => "held-out views",
            Self::NovelPose => "held-out poses",
        }
    }

    /// The folder of its pictures.
    pub(super) fn folder(self) -> &'static str {
        match self {
            Self::NovelView => "novel-view",
            Self::NovelPose => "novel-pose",
        }
    }
}

/// One person's capture, with held-out pictures at the size of the measurement.
#[derive(Debug)]
pub(super) struct Recording {
    pub name: String,
    pub shard: Arc<Shard>,
    pub novel_view: Vec<HeldOutPicture>,
    pub novel_pose: Vec<HeldOutPicture>,
    /// The synthetic person that it shows, if it shows one.
    pub actor: Option<SyntheticPerson>,
    /// Exact poses of the training frames, where training has others.
    pub exact: Option<Vec<Pose>>,
}

/// A held-out picture.
#[derive(Debug)]
pub(super) struct HeldOutPicture {
    /// `camera-frame`, unique inside its split.
    pub label: String,
    /// The pose that the capture gives.
    pub given: Pose,
    /// The pose that it is rendered in.
    pub pose: Pose,
    pub camera: Camera,
    pub truth: FrameImage,
    /// Index of the frame of the training film that this is; `None` for pictures of other cameras and films.
    pub frame: Option<u32>,
    /// Its exposure relative to the frames that are trained on.
    pub exposure: FrameExposure,
}

/// A capture to measure on.
#[derive(Debug, Clone)]
pub enum CaptureSource {
    /// A folder with pictures from other cameras or of other poses.
    Studio(PathBuf),
    /// One camera's frames, some of which are held out.
    OneCamera(PathBuf, OneCamera),
}

impl CaptureSource {
    /// Its folder or archive.
    pub(super) fn path(&self) -> &Path {
        match self {
            Self::Studio(path) | Self::OneCamera(path, _) => path,
        }
    }
}

/// Reads the captures in `folders`, with the held-out pictures of `protocol` scaled to its size,
/// or to `size` pixels if it has none.
pub(super) fn read_all(
    folders: &[PathBuf],
    size: u32,
    protocol: &Protocol,
    screen: &dyn Screen,
) -> anyhow::Result<Vec<Recording>> {
    let sources: Vec<CaptureSource> = folders.iter().cloned().map(CaptureSource::Studio).collect();
    read_sources(&sources, size, HeldOut::Every(0), protocol, screen)
}

/// Reads the captures of `sources` as [`read_all`] does. Of a capture of one camera, frames are `held_out`.
pub(super) fn read_sources(
    sources: &[CaptureSource],
    size: u32,
    held_out: HeldOut,
    protocol: &Protocol,
    screen: &dyn Screen,
) -> anyhow::Result<Vec<Recording>> {
    let mut recordings: Vec<Recording> = Vec::new();
    for source in sources {
        let path = source.path();
        let size = protocol.size(size);
        let recording = match source {
            CaptureSource::Studio(folder) => {
                screen.note(&format!("reading {}", folder.display()));
                read(folder, size, protocol)
            }
            CaptureSource::OneCamera(_, source) => one_camera::recording(source, held_out, size),
        };
        let recording = recording.with_context(|| format!("the capture {}", path.display()))?;
        ensure!(
            recordings.iter().all(|other| other.name != recording.name),
            "two captures are called {}; people need distinct names",
            recording.name
        );
        recordings.push(recording);
    }
    Ok(recordings)
}

/// Replaces the poses of each training frame by those of the pose track `file` in the capture's
/// folder. Held-out pictures keep the poses of `poses.json`: what a training makes of inexact poses
/// is measured at the exact ones.
pub(super) fn train_on_poses_of(
    file: &str,
    sources: &[CaptureSource],
    recordings: &mut [Recording],
) -> anyhow::Result<()> {
    for (source, recording) in sources.iter().zip(recordings) {
        let path = source.path().join(file);
        let bytes = std::fs::read(&path).with_context(|| format!("reading {}", path.display()))?;
        let others = PoseTrack::from_file(file, &bytes)
            .map_err(CaptureError::Invalid)
            .with_context(|| path.display().to_string())?;
        let exact = recording.shard.track.frames.iter().map(Pose::from_frame);
        recording.exact = Some(exact.collect::<Result<_, _>>()?);
        let shard = Arc::make_mut(&mut recording.shard);
        ensure!(
            others.skeleton.names == shard.track.skeleton.names,
            "{}: skeleton: its joints are not those of the capture",
            path.display()
        );
        for frame in &mut shard.track.frames {
            let other = others.frames.iter().find(|it| it.index == frame.index);
            let other = other
                .with_context(|| format!("{}: it has no frame {}", path.display(), frame.index))?;
            frame.pose.clone_from(&other.pose);
            frame.translation = other.translation;
        }
    }
    Ok(())
}

fn read(path: &Path, size: u32, protocol: &Protocol) -> anyhow::Result<Recording> {
    let folder = CaptureFolder::open(path)?;
    let view = |held_out: &HeldOutView| -> anyhow::Result<HeldOutPicture> {
        Ok(HeldOutPicture {
            label: format!("{}-{:06}", held_out.camera_name, held_out.frame),
            given: held_out.pose.clone(),
            pose: held_out.pose.clone(),
            camera: held_out.camera.scaled_to(size),
            truth: held_out.read()?.resized(size),
            frame: None,
            exposure: FrameExposure::NEUTRAL,
        })
    };
    let views = |held_out: &[HeldOutView]| {
        let taken = held_out.iter().filter(|view| protocol.takes(view.frame));
        taken
            .map(view)
            .collect::<anyhow::Result<Vec<HeldOutPicture>>>()
    };
    let recording = Recording {
        name: name_of(path)?,
        shard: Arc::new(folder.shard()?),
        novel_view: views(folder.held_out_views())?,
        novel_pose: match protocol.pictures {
            Pictures::Views => Vec::new(),
            Pictures::ViewsAndPoses => views(folder.held_out_poses())?,
        },
        actor: None,
        exact: None,
    };
    for split in Split::of(protocol) {
        let field = match split {
            Split::NovelView => "eval",
            Split::NovelPose => "eval_pose",
        };
        ensure!(
            !recording.split(*split).is_empty(),
            "poses.json: {field}: it names no held-out picture to measure on by {}",
            protocol.name
        );
    }
    Ok(recording)
}

/// A person has the name of their folder.
fn name_of(path: &Path) -> anyhow::Result<String> {
    let full = path.canonicalize().context("finding its name")?;
    let name = full.file_name().context("it has no name")?;
    Ok(name.to_string_lossy().into_owned())
}

impl Recording {
    /// All pictures of a split.
    pub(super) fn split(&self, split: Split) -> &[HeldOutPicture] {
        match split {
            Split::NovelView => &self.novel_view,
            Split::NovelPose => &self.novel_pose,
        }
    }

    /// Sets poses and exposures of pictures of the training film to those that the training of the person in `slot` has
    /// found for the neighbouring frames. A service measures held-out frames in the same way.
    pub(super) fn follow(&mut self, trainer: &Trainer, slot: usize) {
        for view in self.novel_view.iter_mut().chain(&mut self.novel_pose) {
            if let Some(index) = view.frame {
                view.exposure = trainer.exposure_near(slot, index);
                view.pose = trainer.pose_near(slot, index, &view.given);
            }
        }
    }

    /// A fixed subset of a split, of at most `wanted` pictures.
    pub(super) fn subset(
        &self,
        split: Split,
        wanted: usize,
    ) -> impl Iterator<Item = &HeldOutPicture> {
        let views = self.split(split);
        subset_of(views.len(), wanted).filter_map(|index| views.get(index))
    }

    /// Mean distance of the joints of its training poses from the exact ones, as in the track and as
    /// `refined` (with their indices in the track); `None` where training has the exact ones.
    pub(super) fn pose_errors(
        &self,
        refined: &[(usize, Pose)],
    ) -> anyhow::Result<Option<PoseErrors>> {
        let Some(exact) = &self.exact else {
            return Ok(None);
        };
        let track = &self.shard.track;
        let skeleton = Skeleton::from_track(&track.skeleton)?;
        let poses = self.track_poses()?;
        let refined_mm = || {
            let pairs = refined.iter().map(|(index, pose)| (pose, &exact[*index]));
            joints_apart(&skeleton, pairs)
        };
        Ok(Some(PoseErrors {
            given_mm: joints_apart(&skeleton, poses.iter().zip(exact)),
            refined_mm: (!refined.is_empty()).then(refined_mm),
        }))
    }

    /// The gauge of a model that was learned from its training poses as `refined` (with their indices
    /// in the track), or as in the track where none are; `None` where training has the exact ones.
    pub(super) fn alignment(&self, refined: &[(usize, Pose)]) -> anyhow::Result<Option<Alignment>> {
        let Some(exact) = &self.exact else {
            return Ok(None);
        };
        let poses = self.track_poses()?;
        let refined = refined.iter().map(|(index, pose)| (&exact[*index], pose));
        let refined = Alignment::between(refined);
        Ok(refined.or_else(|| Alignment::between(exact.iter().zip(&poses))))
    }

    fn track_poses(&self) -> anyhow::Result<Vec<Pose>> {
        let poses = self.shard.track.frames.iter().map(Pose::from_frame);
        Ok(poses.collect::<Result<_, _>>()?)
    }

    /// This person in `slot` of a model to be trained.
    pub(super) fn person(&self, slot: usize) -> TrainPerson {
        TrainPerson {
            slot,
            name: self.name.clone(),
            shard: Arc::clone(&self.shard),
        }
    }
}

/// `wanted` of `count` indices, spread over all cameras, with a shift so that cameras do not
/// all show their first frame.
fn subset_of(count: usize, wanted: usize) -> impl Iterator<Item = usize> {
    let chosen = wanted.min(count);
    let stride = count / chosen.max(1);
    (0..chosen).map(move |index| index * stride + index * stride / chosen.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_subset_takes_every_camera_at_another_frame() {
        // Six cameras of twenty frames, one camera after the other.
        let chosen: Vec<(usize, usize)> = subset_of(120, 6)
            .map(|index| (index / 20, index % 20))
            .collect();
        assert_eq!(chosen, [(0, 0), (1, 3), (2, 6), (3, 10), (4, 13), (5, 16)]);
    }

    #[test]
    fn small_splits_are_taken_whole() {
        for count in 0..=6 {
            assert_eq!(
                subset_of(count, 6).collect::<Vec<_>>(),
                (0..count).collect::<Vec<_>>()
            );
        }
        for count in 0..500 {
            let chosen: std::collections::BTreeSet<usize> = subset_of(count, 6).collect();
            assert_eq!(
                chosen.len(),
                6.min(count),
                "{count}: no picture counts twice"
            );
            assert!(chosen.iter().all(|&index| index < count));
        }
    }
}
