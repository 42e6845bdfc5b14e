//! Refinement of the poses of training frames.

pub(crate) mod decision;
mod expected_errors;
pub(crate) mod fit;
pub(crate) mod refinement;
pub(crate) mod refinement_file;
pub(crate) mod wrong_frames;
