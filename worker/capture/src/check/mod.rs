//! The check of a capture: is it what it claims to be, before an hour goes into training?
//!
//! Most captures that fail do so at input: extrinsics the wrong way round, millimetres, masks
//! of another frame. Each of these leaves a body that does not cover its mask. So the check
//! draws the body of [`figure`] where the numbers put it, measures how far it covers the
//! masks ([`fit`]), undoes each common mistake in turn ([`causes`], [`timing`]), and names the
//! one without which bodies and masks decisively agree. What needs no other reading (views,
//! jumps, duplicates, blur, exposure) is measured beside it. Pure functions: no files.

mod advice;
mod agreement;
mod causes;
mod drawing;
mod figure;
mod fit;
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
pub use report::{Cause, Grade, Kind, Measure, Report, Tried};

use crate::FrameImage;
use crate::skeleton::{Skeleton, SkeletonError};
use observe::Observation;
use yoto_proto::pose_track::PoseTrack;

/// Indices of frames before which a joint jumps as no body can: the tracker lost hold, or the film was
/// cut.
///
/// # Errors
/// Invalid skeleton.
pub fn jumps(track: &PoseTrack) -> Result<Vec<u32>, SkeletonError> {
    let skeleton = Skeleton::from_track(&track.skeleton)?;
    Ok(motion::Motion::of(track, &skeleton).jumps)
}

/// Takes the frames of a capture one by one and reports on all of them.
pub struct Checker {
    track: PoseTrack,
    skeleton: Skeleton,
    /// Positions to look at, ascending.
    wanted: Vec<usize>,
    seen: Vec<Observation>,
}

impl Checker {
    /// A check of `track`, which [`PoseTrack::check`] found to be in order.
    ///
    /// # Errors
    /// Invalid skeleton.
    pub fn new(track: PoseTrack) -> Result<Self, SkeletonError> {
        Ok(Self {
            skeleton: Skeleton::from_track(&track.skeleton)?,
            wanted: plan::positions(track.frames.len()),
            seen: Vec::new(),
            track,
        })
    }

    /// Positions in the track of the frames whose pictures it wants, ascending.
    pub fn wanted(&self) -> &[usize] {
        &self.wanted
    }

    /// Looks at the pictures of the frame at `position`; those that are not wanted are
    /// passed over, and so is one that is not of the size that the track says.
    pub fn look(&mut self, position: usize, frame: &FrameImage) {
        let size = self.track.image_size.map(|side| side as usize);
        if self.wanted.binary_search(&position).is_ok() && [frame.width, frame.height] == size {
            self.seen.push(Observation::of(position, frame));
        }
    }

    /// Measures and grades.
    pub fn finish(mut self) -> Report {
        self.seen.sort_by_key(|it| it.position);
        self.seen.dedup_by_key(|it| it.position);
        measures::report(&self.track, &self.skeleton, &self.seen)
    }
}
