//! Pose tracks from key points: inverse kinematics of all frames together.
//!
//! [`fit()`] searches for a body with constant bone lengths and plausible joint rotations, and for its pose in
//! every frame of a clip, so that its points project to where a detector saw them.
//!
//! ```text
//! key points → check → problem → initial (+ flips) → solve (residuals → normal → banded) → hands → report → fingers → expression
//! ```

mod banded;
mod check;
mod colours;
mod error;
mod expression;
mod fingers;
mod fit;
mod flips;
mod forward;
mod hands;
mod height;
mod initial;
mod joints;
mod key_points;
pub mod lift;
mod markers;
mod normal;
mod options;
mod parameters;
mod parts;
mod problem;
mod report;
mod residuals;
mod rotation;
mod skeleton;
mod smooth;
mod solve;
mod world;

pub use colours::patches;
pub use error::PoseError;
pub use fit::fit;
pub use key_points::{FacePoints, FrameKeyPoints, HandPoints, KeyPointSet, KeyPoints};
pub use options::{FitOptions, MAX_FRAMES};
pub use report::Fitted;
