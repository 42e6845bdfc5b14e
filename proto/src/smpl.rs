//! The joint tree of SMPL, the most common body model: the tree of imported captures and of
//! synthetic people, and the only one that the released HumanNeRF program supports.

mod face;
mod fingers;
mod spelling;
mod tree;
mod unify;

pub use face::FACE;
pub use fingers::FINGERS;
pub use spelling::Spelled;
pub use tree::{WITH_FACE, WITH_FINGERS, all_joints, drop_parts, is_smpls, is_smpls_tree};
pub use unify::unify;

/// The 24 joints in the published order, each with its parent.
pub const JOINTS: [(&str, Option<usize>); 24] = [
    ("pelvis", None),
    ("l_hip", Some(0)),
    ("r_hip", Some(0)),
    ("spine1", Some(0)),
    ("l_knee", Some(1)),
    ("r_knee", Some(2)),
    ("spine2", Some(3)),
    ("l_ankle", Some(4)),
    ("r_ankle", Some(5)),
    ("spine3", Some(6)),
    ("l_foot", Some(7)),
    ("r_foot", Some(8)),
    ("neck", Some(9)),
    ("l_collar", Some(9)),
    ("r_collar", Some(9)),
    ("head", Some(12)),
    ("l_shoulder", Some(13)),
    ("r_shoulder", Some(14)),
    ("l_elbow", Some(16)),
    ("r_elbow", Some(17)),
    ("l_wrist", Some(18)),
    ("r_wrist", Some(19)),
    ("l_hand", Some(20)),
    ("r_hand", Some(21)),
];
