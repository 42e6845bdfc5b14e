//! Poses beyond the end of a capture's video.
//!
//! Pose tools often write one pose more than the video has frames, or stop a little after its end. A few such
//! poses are left out; many of them mean that track and video don't belong together.

use super::{Planned, Timing};
use crate::pose_track::violation;
use crate::v1::Violation;

/// Poses that may lie beyond the end, whatever the video's length.
const FEW: u64 = 5;
/// The part of the video's length by which poses may reach beyond it.
const SHARE: u64 = 20;

/// Where a video ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VideoEnd {
    /// Number of frames.
    pub frames: usize,
    /// Time of the last frame, seconds from the first.
    pub seconds: f64,
}

/// What the frames of a video are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VideoContent {
    /// Pictures of the person.
    Images,
    /// Masks of the person.
    Masks,
}

impl VideoEnd {
    /// The first pose frame that the video no longer shows.
    fn beyond(&self, timing: Timing, fps: f64) -> u64 {
        match timing {
            Timing::Index => self.frames as u64,
            // Half a frame away is still near; a float to an integer saturates.
            Timing::Time => (self.seconds * fps + 0.5 + 1e-6 * fps).max(0.0) as u64 + 1,
        }
    }
}

impl Planned {
    /// Leaves out the frames whose picture or mask would be beyond the `end` of the video called
    /// `video`, and notes it.
    ///
    /// # Errors
    /// When the track reaches further beyond the end than 5 frames and a twentieth of the video, or
    /// more than half of the track is beyond it; the message has both counts.
    pub fn end_with(
        &mut self,
        video: &str,
        shows: VideoContent,
        end: VideoEnd,
        timing: Timing,
    ) -> Result<(), Violation> {
        let first = end.beyond(timing, self.track.fps);
        let frames = self.track.frames.iter();
        let indices: Vec<u32> = match shows {
            VideoContent::Images => frames.map(|frame| frame.index).collect(),
            VideoContent::Masks => self.masks.clone(),
        };
        let is_beyond = |index: u32| u64::from(index) >= first;
        let mut beyond = indices.iter().copied().filter(|&index| is_beyond(index));
        let Some(nearest) = beyond.next() else {
            return Ok(());
        };
        let farthest = beyond.clone().next_back().unwrap_or(nearest);
        let (count, total) = (1 + beyond.count(), indices.len());
        let frames = end.frames;
        let last = match timing {
            Timing::Index => String::new(),
            Timing::Time => format!(", the last at {:.3} s", end.seconds),
        };
        if u64::from(farthest) >= first + FEW.max(first / SHARE) || 2 * count > total {
            let message = format!(
                "the pose track has this frame, but the video has only {frames}, 0 to {}{last}: \
                 {count} of {total} poses are beyond its end",
                frames.saturating_sub(1),
            );
            return Err(violation("MISSING", video, Some(nearest), "", message));
        }
        let which = match (count, shows) {
            (1, VideoContent::Images) => format!("the pose of frame {nearest} is"),
            (1, VideoContent::Masks) => format!("the pose whose mask is frame {nearest} is"),
            (_, VideoContent::Images) => format!("the poses of frames {nearest} to {farthest} are"),
            (_, VideoContent::Masks) => {
                format!("the poses whose masks are frames {nearest} to {farthest} are")
            }
        };
        self.notes.push(format!(
            "{video} has {frames} frames{last}: {which} left out"
        ));
        let mut keep = indices.iter().map(|&index| !is_beyond(index));
        self.track.frames.retain(|_| keep.next().unwrap_or(false));
        let mut keep = indices.iter().map(|&index| !is_beyond(index));
        self.masks.retain(|_| keep.next().unwrap_or(false));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose_track::{Frame, NO_DISTORTION, PoseTrack, Skeleton, describe};

    /// Poses of the first `count` frames, 15 per second; the mask of each is one frame later.
    fn planned(count: u32) -> Planned {
        let frame = |index| Frame {
            index,
            pose: vec![0.0; 3],
            translation: [0.0; 3],
            k: [[9.0, 0.0, 4.0], [0.0, 9.0, 4.0], [0.0, 0.0, 1.0]],
            e: std::array::from_fn(|i| std::array::from_fn(|j| f64::from(i == j))),
        };
        Planned {
            track: PoseTrack {
                skeleton: Skeleton {
                    names: vec!["root".into()],
                    parents: vec![-1],
                    rest_joints: vec![[0.0; 3]],
                },
                image_size: [8, 8],
                fps: 15.0,
                distortion: NO_DISTORTION,
                frames: (0..count).map(frame).collect(),
            },
            masks: (1..=count).collect(),
            notes: Vec::new(),
        }
    }

    /// A video of `frames` at 30 frames per second.
    fn video(frames: usize) -> VideoEnd {
        VideoEnd {
            frames,
            seconds: (frames - 1) as f64 / 30.0,
        }
    }

    fn cut(
        poses: u32,
        frames: usize,
        shows: VideoContent,
        timing: Timing,
    ) -> Result<(usize, Vec<String>), String> {
        let mut planned = planned(poses);
        planned
            .end_with("video.mp4", shows, video(frames), timing)
            .map_err(|fault| describe(&fault))?;
        assert_eq!(planned.track.frames.len(), planned.masks.len());
        for (frame, mask) in planned.track.frames.iter().zip(&planned.masks) {
            assert_eq!(frame.index + 1, *mask, "each frame keeps its mask");
        }
        Ok((planned.masks.len(), planned.notes))
    }

    #[test]
    fn a_few_poses_beyond_the_end_are_left_out_and_told() {
        let images = |poses, frames| cut(poses, frames, VideoContent::Images, Timing::Index);
        assert_eq!(images(300, 300), Ok((300, vec![])));
        assert_eq!(images(200, 300), Ok((200, vec![])));
        let told = "video.mp4 has 300 frames: the pose of frame 300 is left out";
        assert_eq!(images(301, 300), Ok((300, vec![told.into()])));
        let told = "video.mp4 has 300 frames: the poses of frames 300 to 314 are left out";
        assert_eq!(images(315, 300), Ok((300, vec![told.into()])));
        assert_eq!(images(15, 10).map(|(left, _)| left), Ok(10));
        let (left, notes) =
            cut(300, 300, VideoContent::Masks, Timing::Index).expect("one is missing");
        let told = "video.mp4 has 300 frames: the pose whose mask is frame 300 is left out";
        assert_eq!((left, notes), (299, vec![told.into()]));
    }

    #[test]
    fn many_poses_beyond_the_end_are_an_error_with_both_counts() {
        let images = |poses, frames| cut(poses, frames, VideoContent::Images, Timing::Index);
        for (poses, frames, beyond) in [(316, 300, 16), (16, 10, 6), (7, 3, 4)] {
            let said = images(poses, frames).expect_err("too many");
            let expected = format!(
                "video.mp4 frame {frames}: the pose track has this frame, but the video has only \
                 {frames}, 0 to {}: {beyond} of {poses} poses are beyond its end",
                frames - 1
            );
            assert_eq!(said, expected);
        }
        // One pose, but far away: its number is wrong.
        let mut late = planned(4);
        late.track.frames[3].index = 9;
        let fault = late
            .end_with("video.mp4", VideoContent::Images, video(4), Timing::Index)
            .expect_err("frame 9 of 4");
        assert_eq!(fault.frame, Some(9));
    }

    #[test]
    fn by_time_the_last_frame_counts_for_half_a_pose_frame_more() {
        let by_time = |poses, frames| cut(poses, frames, VideoContent::Images, Timing::Time);
        // 60 frames at 30 per second end at 1.967 s, which is pose 29.5 at 15 per second: pose 30 is half a
        // frame away.
        assert_eq!(by_time(31, 60).map(|(left, _)| left), Ok(31));
        let (left, notes) = by_time(33, 60).expect("two are missing");
        assert_eq!(left, 31, "{notes:?}");
        assert!(
            notes[0].contains("the last at 1.967 s: the poses of frames 31 to 32"),
            "{notes:?}"
        );
        assert!(
            by_time(60, 60).is_err(),
            "pose numbers of the video's own frames"
        );
    }
}
