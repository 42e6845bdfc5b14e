//! Pose tracks from key points: inverse kinematics of all frames together.

mod key_points;

pub use key_points::{FrameKeyPoints, KeyPointSet, KeyPoints};
