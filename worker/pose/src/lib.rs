//! Pose tracks from key points: inverse kinematics of all frames together.
