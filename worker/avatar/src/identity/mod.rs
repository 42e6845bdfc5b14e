//! Identities: codes, the code conditioned on the pose, and mixtures of two identities.

pub(crate) mod blend;
pub mod pose_condition;
