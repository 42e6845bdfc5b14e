//! Files of programs that find the poses of people in a video, with the clip itself.
//!
//! One file per tool reads its files to [`ToolOutput`](crate::proof::ToolOutput): people, frames, rotations, translations and cameras.
//! The rest is common to all: [`recognise`] says which tool wrote a file, [`proof`](crate::proof) which
//! person is taken and what the numbers mean, and [`mod@capture`] makes the capture. BVH, which has rotations
//! and no body model, is a reader of its own ([`bvh_clip`]).
//!
//! ```text
//! tool's files → recognise → ToolOutput ┐
//! clip, masks ──────────────────────────┴→ choice (rest × masks × readings, by proof) → track
//! ```

pub(crate) mod bvh_clip;
mod camera_motion;
mod capture;
pub(crate) mod easymocap;
pub(crate) mod ex_avatar;
pub(crate) mod gvhmr;
pub(crate) mod lhm;
mod opencv;
mod parts;
pub(crate) mod phalp;
pub(crate) mod prompthmr;
mod recognise;
pub(crate) mod romp;
mod sieve;
mod tool;
pub(crate) mod tram;
pub(crate) mod wham;

pub(crate) use capture::capture;
pub(crate) use recognise::{has_files, open, wrote};
pub(crate) use tool::Tool;

/// All tools, in the order in which a file is tried.
pub(crate) static ALL: [&Tool; 9] = [
    &phalp::TOOL,
    &wham::TOOL,
    &gvhmr::TOOL,
    &tram::TOOL,
    &romp::TOOL,
    &prompthmr::TOOL,
    &lhm::TOOL,
    &ex_avatar::TOOL,
    &easymocap::TOOL,
];
