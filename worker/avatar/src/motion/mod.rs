//! The map from a posed body to its canonical pose (paper eq. 1): the prior volume, the learned
//! motion weights, bone transforms, and the correction of poses.

pub mod body;
pub(crate) mod correction;
pub(crate) mod deconv;
pub mod posed;
pub mod prior;
pub(crate) mod released;
pub mod rotation;
mod upsample;
pub(crate) mod weights;
