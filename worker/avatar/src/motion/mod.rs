//! The map from a posed body to its canonical pose (paper eq. 1): the prior volume, the learned
//! motion weights, bone transforms, and the correction of poses.

pub mod body;
pub mod correction;
pub mod deconv;
pub mod posed;
pub mod prior;
pub mod released;
pub mod rotation;
pub mod weights;
