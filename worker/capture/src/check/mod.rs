//! The check of a capture before an hour goes into training.
//!
//! Most captures that fail have wrong input: inverted extrinsics, millimetres, masks of other frames. In
//! each case the projected body does not cover its mask. So the check draws the body of [`figure`],
//! measures its overlap with the masks ([`fit`]), undoes each common mistake in turn ([`causes`],
//! [`timing`]), and names the one without which bodies and masks agree decisively better. Views, jumps,
//! duplicates, blur and exposure need no other reading and are measured separately. Pure functions: no
//! files.

mod advice;
mod agreement;
mod causes;
mod drawing;
mod figure;
mod fit;
mod framing;
mod gait;
mod least_squares;
mod measures;
mod motion;
mod observe;
mod plan;
mod precision;
mod report;
mod shape;
mod silhouette;
mod timing;

pub use drawing::Drawing;
pub use precision::{PRECISE, precision};
pub use report::{Cause, CheckReport, Grade, Lack, Measure, MeasureKind, Tried};

use crate::FrameImage;
use crate::skeleton::{Skeleton, SkeletonError};
use observe::Observation;
use yoto_proto::pose_track::PoseTrack;
use yoto_proto::smpl;

/// Indices of frames before which a joint jumps faster than any body can: the pose estimator lost track,
/// or the film was cut.
///
/// # Errors
/// If the track's skeleton is invalid.
pub fn jumps(track: &PoseTrack) -> Result<Vec<u32>, SkeletonError> {
    let mut track = track.clone();
    smpl::drop_parts(&mut track);
    let skeleton = Skeleton::from_track(&track.skeleton)?;
    Ok(motion::Motion::of(&track, &skeleton).jumps)
}

/// Takes the frames of a capture one by one, and then reports on all of them.
pub struct Checker {
    track: PoseTrack,
    skeleton: Skeleton,
    /// Positions to look at, ascending.
    wanted: Vec<usize>,
    seen: Vec<Observation>,
}

impl Checker {
    /// A check of `track`, which must have passed [`PoseTrack::check`]. Fingers are too thin for what masks tell, and take no part.
    ///
    /// # Errors
    /// If the track's skeleton is invalid.
    pub fn new(mut track: PoseTrack) -> Result<Self, SkeletonError> {
        smpl::drop_parts(&mut track);
        Ok(Self {
            skeleton: Skeleton::from_track(&track.skeleton)?,
            wanted: plan::positions(track.frames.len()),
            seen: Vec::new(),
            track,
        })
    }

    /// Positions in the track of the frames to [`look`](Self::look) at, ascending.
    pub fn wanted(&self) -> &[usize] {
        &self.wanted
    }

    /// Looks at the pictures of the frame at `position`. A frame that is not wanted, or is not of the
    /// track's image size, is ignored.
    pub fn look(&mut self, position: usize, frame: &FrameImage) {
        let size = self.track.image_size.map(|side| side as usize);
        if self.wanted.binary_search(&position).is_ok() && [frame.width, frame.height] == size {
            self.seen.push(Observation::of(position, frame));
        }
    }

    /// Measures and grades.
    pub fn finish(mut self) -> CheckReport {
        self.seen.sort_by_key(|it| it.position);
        self.seen.dedup_by_key(|it| it.position);
        measures::report(&self.track, &self.skeleton, &self.seen)
    }
}
