//! The demo's people: synthetic, recorded by one camera, with ground truth from other cameras
//! that is never uploaded, for comparison with renders.

use std::path::Path;
use yoto_capture::FrameImage;
use yoto_capture::camera::{Camera, Pose};
use yoto_import::{ImportError, write_images};
use yoto_proto::pose_track::PoseTrack;
use yoto_synthetic::SyntheticPerson;

/// Frames of each video.
const FRAMES: usize = 60;
/// Frames of the video with views from held-out cameras.
const VIEWED_FRAMES: [usize; 2] = [FRAMES / 4, 3 * FRAMES / 4];
/// Held-out cameras in use, at most.
const HELD_OUT_CAMERAS: usize = 4;
/// Length of the held-out motion, and its rendered frames.
const UNSEEN_FRAMES: usize = 16;
const UNSEEN_CHOSEN: [usize; 4] = [2, 6, 10, 14];

/// One synthetic person with their video and held-out views.
#[derive(Debug)]
pub(super) struct Actor {
    pub name: String,
    pub track: PoseTrack,
    pub film: Vec<FrameImage>,
    /// Poses of the video from held-out cameras.
    pub novel_view: Vec<HeldOut>,
    /// Held-out poses.
    pub novel_pose: Vec<HeldOut>,
}

/// A view with its truth.
#[derive(Debug)]
pub(super) struct HeldOut {
    pub pose: Pose,
    pub camera: Camera,
    pub truth: FrameImage,
}

/// Generates and records `count` people at `size` pixels.
pub(super) fn film(count: usize, size: u32, seed: u64) -> anyhow::Result<Vec<Actor>> {
    SyntheticPerson::cast(count, seed)
        .iter()
        .map(|person| Actor::film(person, size))
        .collect()
}

impl Actor {
    fn film(person: &SyntheticPerson, size: u32) -> anyhow::Result<Self> {
        let (track, film) = person.capture(FRAMES, size);
        let held_out = |pose: &Pose, camera: &Camera| HeldOut {
            pose: pose.clone(),
            camera: camera.clone(),
            truth: person.render(pose, camera),
        };
        let mut cameras = SyntheticPerson::held_out_cameras(size);
        cameras.truncate(HELD_OUT_CAMERAS);
        let viewed = VIEWED_FRAMES
            .iter()
            .filter_map(|&frame| track.frames.get(frame));
        let filmed = viewed
            .map(Pose::from_frame)
            .collect::<Result<Vec<_>, _>>()?;
        let novel_view = cameras
            .iter()
            .flat_map(|camera| filmed.iter().map(move |pose| held_out(pose, camera)))
            .collect();

        let unseen = person.unseen_motion(UNSEEN_FRAMES);
        let unseen: Vec<&Pose> = UNSEEN_CHOSEN
            .iter()
            .filter_map(|&frame| unseen.get(frame))
            .collect();
        let seen_by: Vec<Camera> = std::iter::once(SyntheticPerson::train_camera(size))
            .chain(cameras.first().cloned())
            .collect();
        let novel_pose = seen_by
            .iter()
            .flat_map(|camera| unseen.iter().map(move |pose| held_out(pose, camera)))
            .collect();
        Ok(Self {
            name: person.name().to_owned(),
            track,
            film,
            novel_view,
            novel_pose,
        })
    }

    /// Writes the video as a capture folder: `poses.json`, `frames/`, `masks/`.
    pub(super) fn write_capture(&self, folder: &Path) -> Result<(), ImportError> {
        write_images(&self.track, &self.film, folder).map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_is_a_capture_that_the_client_accepts() {
        let actors = film(1, 24, 3).expect("films");
        let dir = tempfile::tempdir().expect("temporary folder");
        actors[0].write_capture(dir.path()).expect("writes");
        let capture =
            yoto_import::capture_dir::CaptureDir::open(dir.path()).expect("a good capture");
        assert_eq!(capture.frames(), FRAMES);
        assert_eq!(capture.files.len(), 2 * FRAMES + 1);
        assert_eq!(
            actors[0].novel_view.len(),
            VIEWED_FRAMES.len() * HELD_OUT_CAMERAS
        );
        assert_eq!(actors[0].novel_pose.len(), UNSEEN_CHOSEN.len() * 2);
    }
}
