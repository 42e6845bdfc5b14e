//! Fingers: thirty joints after SMPL's, for captures that show them.

/// The joints of the fingers, which follow [`JOINTS`](super::JOINTS) in a skeleton with hands: three per finger from the palm to the tip, in the order of
/// SMPL-H and SMPL-X, the left hand first. Each has its parent; wrists are those of
/// the body.
pub const FINGERS: [(&str, Option<usize>); 30] = [
    ("l_index1", Some(20)),
    ("l_index2", Some(24)),
    ("l_index3", Some(25)),
    ("l_middle1", Some(20)),
    ("l_middle2", Some(27)),
    ("l_middle3", Some(28)),
    ("l_pinky1", Some(20)),
    ("l_pinky2", Some(30)),
    ("l_pinky3", Some(31)),
    ("l_ring1", Some(20)),
    ("l_ring2", Some(33)),
    ("l_ring3", Some(34)),
    ("l_thumb1", Some(20)),
    ("l_thumb2", Some(36)),
    ("l_thumb3", Some(37)),
    ("r_index1", Some(21)),
    ("r_index2", Some(39)),
    ("r_index3", Some(40)),
    ("r_middle1", Some(21)),
    ("r_middle2", Some(42)),
    ("r_middle3", Some(43)),
    ("r_pinky1", Some(21)),
    ("r_pinky2", Some(45)),
    ("r_pinky3", Some(46)),
    ("r_ring1", Some(21)),
    ("r_ring2", Some(48)),
    ("r_ring3", Some(49)),
    ("r_thumb1", Some(21)),
    ("r_thumb2", Some(51)),
    ("r_thumb3", Some(52)),
];
