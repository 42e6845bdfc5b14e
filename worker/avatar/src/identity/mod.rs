//! Identities: pose-conditioned codes and mixtures of two identities.

pub(crate) mod blend;
pub(crate) mod pose_condition;
