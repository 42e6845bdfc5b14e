//! Conversion of SMPL's parameters to the pose track's.

use crate::geometry::{Mat3, Vec3, add, log_map, matmul, matvec, rodrigues, sub};
use yoto_proto::pose_track::{Frame, PoseTrack, Skeleton};
use yoto_proto::smpl::JOINTS;

/// A pose of SMPL: 24 rotations, local to the parent, the root's first.
pub(crate) type SmplPose = [f64; 72];

/// The skeleton of SMPL with rest joints, metres.
pub(crate) fn smpl_skeleton(rest_joints: Vec<Vec3>) -> Skeleton {
    let parent = |parent: &Option<usize>| parent.map_or(-1, |parent| parent as i32);
    Skeleton {
        names: JOINTS.iter().map(|(name, _)| (*name).to_owned()).collect(),
        parents: JOINTS.iter().map(|(_, above)| parent(above)).collect(),
        rest_joints,
    }
}

/// The pose of a body in the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WorldPose {
    pub pose: SmplPose,
    /// The root joint's position, metres.
    pub root: Vec3,
}

impl WorldPose {
    /// The body turned as a whole by `rh` about the *origin* and then moved by `th`, as in EasyMocap
    /// and HumanNeRF; `pelvis` is the root's rest position before that. A root rotation in
    /// `pose` turns about the pelvis, before `rh`.
    pub(crate) fn about_origin(pose: SmplPose, rh: Vec3, th: Vec3, pelvis: Vec3) -> Self {
        let whole = rodrigues(rh);
        Self {
            pose: with_root(pose, &matmul(&whole, &rodrigues(root(&pose)))),
            root: add(matvec(&whole, pelvis), th),
        }
    }

    /// The body moved by `translation` after its pose, as in SMPL's own programs: the root
    /// turns about the pelvis, which keeps the position of the shape.
    pub(crate) fn about_pelvis(pose: SmplPose, translation: Vec3, pelvis: Vec3) -> Self {
        Self {
            pose,
            root: add(pelvis, translation),
        }
    }

    /// A frame of a track whose root rests at `rest_root`.
    pub(crate) fn frame(&self, index: u32, rest_root: Vec3, camera: &Camera) -> Frame {
        Frame {
            index,
            pose: self.pose.to_vec(),
            translation: sub(self.root, rest_root),
            k: camera.k,
            e: camera.e,
        }
    }
}

fn root(pose: &SmplPose) -> Vec3 {
    [pose[0], pose[1], pose[2]]
}

fn with_root(mut pose: SmplPose, rotation: &Mat3) -> SmplPose {
    pose[..3].copy_from_slice(&log_map(rotation));
    pose
}

/// A camera in the track's conventions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Camera {
    pub k: [[f64; 3]; 3],
    pub e: [[f64; 4]; 4],
}

impl Camera {
    /// The camera with these intrinsics, whose pixel coordinates count from the first pixel's centre, as in
    /// OpenCV's calibration and in all imported formats.
    pub(crate) fn from_centres(mut k: [[f64; 3]; 3], e: [[f64; 4]; 4]) -> Self {
        k[0][2] += 0.5;
        k[1][2] += 0.5;
        Self { k, e }
    }
}

/// The mean of rows of equal length; shorter rows count as far as they go.
pub(crate) fn mean(rows: &[Vec<f64>]) -> Vec<f64> {
    let length = rows.iter().map(Vec::len).max().unwrap_or_default();
    let at = |i: usize| rows.iter().filter_map(move |row| row.get(i));
    (0..length)
        .map(|i| at(i).sum::<f64>() / at(i).count().max(1) as f64)
        .collect()
}

/// The median of each column of rows; shorter rows count as far as they go.
pub(crate) fn median_rows(rows: &[&[f64]]) -> Vec<f64> {
    let length = rows.iter().map(|row| row.len()).max().unwrap_or_default();
    let column = |i: usize| {
        let mut column: Vec<f64> = rows.iter().filter_map(|row| row.get(i).copied()).collect();
        let middle = column.len() / 2;
        let (_, median, _) = column.select_nth_unstable_by(middle, f64::total_cmp);
        *median
    };
    (0..length).map(column).collect()
}

/// A track without frames.
pub(crate) fn empty_track(skeleton: Skeleton, image_size: [u32; 2], fps: f64) -> PoseTrack {
    PoseTrack {
        skeleton,
        image_size,
        fps,
        distortion: yoto_proto::pose_track::NO_DISTORTION,
        frames: Vec::new(),
    }
}
