//! Who somebody is: identity codes, and the code conditioned on the pose.

pub mod pose_condition;
