//! Captures as folders, and captures and motions of other programs.
//!
//! [`capture_dir`] is a capture as a folder on disk before it is uploaded, [`capture_check`] tells
//! whether its poses, cameras, masks and pictures agree.
//!
//! `adapters` is the table of the formats that [`read`] knows. Each has one reader, which documents its
//! program's conventions: units, direction of extrinsics, pixel centres, meaning of the root's
//! translation. All readers give the one schema of the service
//! ([`PoseTrack`](yoto_proto::pose_track::PoseTrack)). [`write()`] writes a capture folder; [`motion`]
//! reads motions for animation. A module uses those below it:
//!
//! ```text
//! adapters                                        table, recognition, options
//! datasets  tools  keypoints  film                readers (files → pose track + pictures)
//! proof                                           what a tool's numbers mean, by masks
//! matting  motion                                 masks by a network; BVH and SMPL's parameters
//! misplaced  clip  pictures  source               videos and pictures, plain data; files in a wrong place
//! track  hierarchy  geometry                      skeletons and poses
//! progress  error                                 what the caller gets besides
//! ```

mod adapters;
pub mod best;
mod body_model;
pub mod capture_check;
pub mod capture_dir;
mod capture_frames;
mod clip;
mod datasets;
mod error;
mod features;
mod ffmpeg_arg;
mod film;
mod geometry;
mod hierarchy;
mod identities;
mod imported;
mod keypoints;
mod matting;
mod matting_model;
mod misplaced;
pub mod motion;
mod motion_file;
mod options;
mod pictures;
mod plausibility;
mod progress;
mod proof;
mod rest_joints;
mod served_film;
mod source;
mod to_folder;
mod tools;
mod track;
mod write;

pub use adapters::{Format, options_by_format, pose_tools, read};
pub use body_model::BodyModel;
pub use capture_frames::CaptureFrames;
pub use error::ImportError;
pub use ffmpeg_arg::FfmpegArg;
pub use imported::{Findings, Imported, PoseFit};
pub use keypoints::{PointRotation, PointSet, key_point_detectors};
pub use matting_model::{Levels, MattingModel};
pub use motion_file::read_motion;
pub use options::Options;
pub use pictures::{DecodedClip, Mask, MaskKind, PictureFiles, Pictures};
pub use progress::{Progress, ProgressEvent, Stage};
pub use served_film::{check_pose_model, read_film};
#[cfg(feature = "hdf5")]
pub use source::hdf5::MaskStack;
pub use to_folder::to_folder;
pub use write::{TrackForm, VIDEO, ensure_no_capture, write, write_images};
