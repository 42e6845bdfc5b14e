//! Identities: the owner of each parameter, pose-conditioned codes, and mixtures of two identities.

pub(crate) mod blend;
pub(crate) mod own;
pub(crate) mod pose_condition;
pub(crate) mod stored_names;
