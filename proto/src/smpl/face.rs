//! Joints of the face: jaw, eyes and upper eyelids, for captures that show them.

/// The joints of the face, which follow those of the fingers. Jaw and eyes are those of SMPL-X.
///
/// In the T-pose the face looks along z. A positive rotation about x opens the jaw, turns an eye down and closes an eyelid.
pub const FACE: [(&str, Option<usize>); 5] = [
    ("jaw", Some(15)),
    ("l_eye", Some(15)),
    ("r_eye", Some(15)),
    ("l_eyelid", Some(15)),
    ("r_eyelid", Some(15)),
];
