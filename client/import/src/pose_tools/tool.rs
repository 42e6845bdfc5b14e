//! The pose tools, and what all of their readers give.

use super::reading::{Focal, Place};
use super::to_world::ToWorld;
use crate::Format;
use crate::geometry::{Mat3, Vec3, axis_angle, rotation};
use crate::track::SmplPose;
use std::sync::Arc;
use yoto_formats::rle::RunLengths;
use yoto_proto::pose_track::NO_DISTORTION;

/// A program that finds the poses of people in a video.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tool {
    Phalp,
    Wham,
    Gvhmr,
    Tram,
    Romp,
    PromptHmr,
    Lhm,
    ExAvatar,
    EasyMocap,
}

impl Tool {
    pub const ALL: [Self; 9] = [
        Self::Phalp,
        Self::Wham,
        Self::Gvhmr,
        Self::Tram,
        Self::Romp,
        Self::PromptHmr,
        Self::Lhm,
        Self::ExAvatar,
        Self::EasyMocap,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Phalp => "4D-Humans (PHALP)",
            Self::Wham => "WHAM",
            Self::Gvhmr => "GVHMR",
            Self::Tram => "TRAM",
            Self::Romp => "ROMP or BEV",
            Self::PromptHmr => "PromptHMR",
            Self::Lhm => "LHM",
            Self::ExAvatar => "ExAvatar",
            Self::EasyMocap => "EasyMocap",
        }
    }

    /// The format that forces it.
    pub fn format(self) -> Format {
        match self {
            Self::Phalp => Format::Phalp,
            Self::Wham => Format::Wham,
            Self::Gvhmr => Format::Gvhmr,
            Self::Tram => Format::Tram,
            Self::Romp => Format::Romp,
            Self::PromptHmr => Format::PromptHmr,
            Self::Lhm => Format::Lhm,
            Self::ExAvatar => Format::ExAvatar,
            Self::EasyMocap => Format::EasyMocap,
        }
    }

    /// The files by which it is recognised, for errors.
    pub fn files(self) -> &'static str {
        match self {
            Self::Phalp => "results/demo_*.pkl with tid, smpl and camera of each frame",
            Self::Wham => "wham_output.pkl with pose, trans and frame_ids of each person",
            Self::Gvhmr => "hmr4d_results.pt with smpl_params_incam",
            Self::Tram => "hps/hps_track_*.npy with pred_rotmat, and camera.npy",
            Self::Romp => "*.npz with results",
            Self::PromptHmr => "results.pkl with people and camera",
            Self::Lhm => "smplx_params/*.json with root_pose and trans",
            Self::ExAvatar => "smplx_optimized/smplx_params/*.json with root_pose, trans and expr",
            Self::EasyMocap => "smpl/*.json with Rh and Th, and intri.yml",
        }
    }

    /// The focal length that it documents.
    pub fn focal(self) -> Focal {
        match self {
            Self::Phalp => Focal::Phalp,
            Self::Wham => Focal::Diagonal,
            Self::Romp => Focal::Sixty,
            Self::Gvhmr
            | Self::Tram
            | Self::PromptHmr
            | Self::Lhm
            | Self::ExAvatar
            | Self::EasyMocap => Focal::Own,
        }
    }

    /// The meaning of its translation.
    pub fn place(self) -> Place {
        match self {
            Self::EasyMocap => Place::AboutOrigin,
            Self::Lhm => Place::Pelvis,
            _ => Place::AboutPelvis,
        }
    }

    /// The body model whose parameters it writes.
    pub fn body(self) -> Body {
        match self {
            Self::Gvhmr | Self::PromptHmr | Self::Lhm | Self::ExAvatar => Body::SmplX,
            _ => Body::Smpl,
        }
    }
}

/// A body model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Body {
    Smpl,
    SmplX,
}

impl Body {
    pub fn name(self) -> &'static str {
        match self {
            Self::Smpl => "SMPL",
            Self::SmplX => "SMPL-X",
        }
    }
}

/// Intrinsics that a file has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Intrinsics {
    /// Pixels.
    pub focal: [f64; 2],
    /// Principal point, pixels from the first pixel's centre; the image's middle if absent.
    pub centre: Option<[f64; 2]>,
    /// Width and height of the images that it is of, if the file says.
    pub size: Option<[f64; 2]>,
    /// Share of the clip's width and height that margins around its images add to these.
    pub margin: f64,
}

impl Intrinsics {
    /// Of a 3×3 matrix, rows first, whose principal point is the image's middle.
    pub fn of_middle(k: &[f64; 9]) -> Self {
        Self {
            focal: [k[0], k[4]],
            centre: Some([k[2], k[5]]),
            size: Some([2.0 * k[2], 2.0 * k[5]]),
            margin: 0.0,
        }
    }
}

/// A person in one frame.
#[derive(Clone, Debug)]
pub(crate) struct Seen {
    /// Frame of the tool's clip, from 0.
    pub number: usize,
    /// The picture's name, if the file has it.
    pub image: Option<String>,
    /// The root's rotation is in the camera's axes (or in the world's, with `e`).
    pub pose: SmplPose,
    /// Translation, in the meaning of the tool.
    pub t: Vec3,
    pub betas: Vec<f64>,
    /// Posed joints by SMPL's number, metres, before the translation.
    pub joints: Vec<(usize, Vec3)>,
    pub mask: Option<Arc<RunLengths>>,
    pub intrinsics: Option<Intrinsics>,
    /// World to camera; `None` where the body is in the camera's axes.
    pub e: Option<[[f64; 4]; 4]>,
    /// The camera's place in the world, where the body is in the camera's axes and the camera moves.
    pub to_world: Option<ToWorld>,
}

impl Seen {
    /// With the parts that every tool has.
    pub fn new(number: usize, pose: SmplPose, t: Vec3, betas: Vec<f64>) -> Self {
        Self {
            number,
            image: None,
            pose,
            t,
            betas,
            joints: Vec::new(),
            mask: None,
            intrinsics: None,
            e: None,
            to_world: None,
        }
    }

    /// The root's rotation.
    pub fn root(&self) -> Mat3 {
        rotation([self.pose[0], self.pose[1], self.pose[2]])
    }
}

/// A person of a clip.
#[derive(Clone, Debug)]
pub(crate) struct Person {
    /// The tool's number or name.
    pub name: String,
    /// In the order of their frames.
    pub seen: Vec<Seen>,
}

/// The contents of a tool's files.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    pub people: Vec<Person>,
    /// Frames of the tool's clip, if the files say.
    pub frames: Option<usize>,
    /// Width and height of the tool's clip, if the files say.
    pub size: Option<[f64; 2]>,
    /// OpenCV's k1 k2 p1 p2 k3 of the clip.
    pub distortion: [f64; 5],
    /// Masks of all people together, by frame.
    pub masks: Vec<(usize, Arc<RunLengths>)>,
    pub notes: Vec<String>,
}

impl Found {
    pub fn of(people: Vec<Person>) -> Self {
        Self {
            people,
            frames: None,
            size: None,
            distortion: NO_DISTORTION,
            masks: Vec::new(),
            notes: Vec::new(),
        }
    }
}

/// A pose from 24 rotation matrices of 9 numbers each, rows first.
pub(super) fn pose_of_matrices(matrices: &[f64]) -> SmplPose {
    let mut pose = [0.0; 72];
    let (matrices, _) = matrices.as_chunks::<9>();
    let (axes, _) = pose.as_chunks_mut::<3>();
    for (axis, m) in axes.iter_mut().zip(matrices) {
        *axis = axis_angle(&[[m[0], m[1], m[2]], [m[3], m[4], m[5]], [m[6], m[7], m[8]]]);
    }
    pose
}

/// A pose from the root's rotation and those of SMPL-X's 21 joints; hands as the wrists.
pub(super) fn pose_of_smplx(root: Vec3, body: &[f64; 63]) -> SmplPose {
    let mut pose = [0.0; 72];
    pose[..3].copy_from_slice(&root);
    pose[3..66].copy_from_slice(body);
    pose
}
