//! Finds what the numbers of a pose tool mean, by masks of the same clip.
//!
//! Readers give [`ToolOutput`]. Every tool documents one reading of its numbers ([`reading`]); converters and
//! older versions follow others. [`choice`] takes the person, the masks ([`masks`]) and the reading that
//! agree best ([`score`], [`silhouette`]), with rest joints ([`rest`]) and the frame of the clip that
//! each pose is of ([`numbers`]). [`track`] compares a track with any joint hierarchy with masks.

mod camera_pose;
mod choice;
mod found;
mod masks;
mod numbers;
mod reading;
mod rest;
mod score;
mod silhouette;
mod track;

pub(crate) use camera_pose::{CameraPose, moves};
pub(crate) use choice::ImportChoice;
pub(crate) use found::{Intrinsics, PoseEstimate, ToolOutput, TrackedPerson};
pub(crate) use masks::{Masks, MasksByFrame};
pub(crate) use numbers::Numbers;
pub(crate) use reading::{Documented, Focal, SmplVariant, Translation, ratio};
pub(crate) use silhouette::LEAST;
pub(crate) use track::{agreement, prove, said_agreement};
