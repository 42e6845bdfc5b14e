//! The drawing of a body over its frame, for picture sheets.

use super::fit::view;
use crate::body_box::BodyView;
use crate::skeleton::{Skeleton, SkeletonError};
use yoto_proto::pose_track::PoseTrack;

/// A frame's body in its image, pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// The joints' projections; `None` for a joint behind the camera.
    pub joints: Vec<Option<[f64; 2]>>,
    /// For each bone the indices of its joints, the parent first.
    pub bones: Vec<[usize; 2]>,
    /// The side of each joint at rest: above 0 left (+x), below 0 right.
    pub sides: Vec<f64>,
    /// The corners of the box that rays are cut to. Bit i of a corner's index is its end of axis i, so an
    /// edge joins indices that differ in one bit.
    pub corners: [Option<[f64; 2]>; 8],
}

impl Drawing {
    /// The body in the frame at `position` of `track`.
    ///
    /// # Errors
    /// If the track's skeleton is invalid.
    pub fn of(track: &PoseTrack, position: usize) -> Result<Self, SkeletonError> {
        let skeleton = Skeleton::from_track(&track.skeleton)?;
        let Some(frame) = track.frames.get(position) else {
            return Ok(Self {
                joints: Vec::new(),
                bones: Vec::new(),
                sides: Vec::new(),
                corners: [None; 8],
            });
        };
        let (pose, camera) = view(frame, track.image_size);
        let middle = skeleton.root()[0];
        let bones = skeleton.parents.iter().enumerate();
        Ok(Self {
            joints: skeleton
                .posed_joints(&pose)
                .into_iter()
                .map(|joint| camera.project(joint))
                .collect(),
            bones: bones
                .filter_map(|(joint, parent)| Some([(*parent)?, joint]))
                .collect(),
            sides: skeleton.rest.iter().map(|rest| rest[0] - middle).collect(),
            corners: BodyView::new(&skeleton, &pose, &camera).corners(),
        })
    }
}
