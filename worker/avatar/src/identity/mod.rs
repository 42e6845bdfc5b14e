//! Identities: pose-conditioned codes and mixtures of two identities.

pub(crate) mod blend;
pub mod pose_condition;
