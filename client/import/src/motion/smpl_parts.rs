//! Fingers, jaw and eyes of poses in SMPL-H's and SMPL-X's parameters.

use crate::ImportError;
use crate::source::Part;
use yoto_capture::skeleton::fingers::relaxed;
use yoto_capture::skeleton::smpl::{FACE, JOINTS};

/// Numbers of the rotations of the fingers' joints, and of jaw, left and right eye.
const FINGERS: usize = 90;
const FACES: usize = 9;
/// Numbers of a pose of SMPL-H and of SMPL-X, and the first number of the fingers. SMPL-X has jaw and eyes before them.
const WITH_HANDS: [[usize; 2]; 2] = [[156, 66], [165, 75]];
const SMPL_X: usize = 165;

/// Rotations of the joints behind SMPL's 24, `[F][3 N]`, radians: of fingers, or of fingers and the face; empty if none of them moves.
pub(super) type Parts = Vec<Vec<f64>>;

/// The parts in the rows of `poses`, whose `width` tells the model.
pub(super) fn of_rows<'a>(rows: impl Iterator<Item = &'a [f64]>, width: usize) -> Parts {
    let Some([_, first]) = WITH_HANDS.into_iter().find(|[all, _]| *all == width) else {
        return Parts::new();
    };
    let (hands, faces) = rows
        .map(|row| {
            let face = &row[first - FACES..first];
            let hand = row[first..].iter().copied().take(FINGERS);
            (hand.collect::<Vec<_>>(), face.to_vec())
        })
        .unzip();
    joined(hands, if width == SMPL_X { faces } else { Parts::new() })
}

/// The parts of AMASS's `pose_hand` `[F, 90]`, `pose_jaw` `[F, 3]` and `pose_eye` `[F, 6]`, for this number of `frames`.
pub(super) fn of_amass(root: &Part<'_>, frames: usize) -> Result<Parts, ImportError> {
    fn rows<const N: usize>(
        root: &Part<'_>,
        name: &str,
        frames: usize,
    ) -> Result<Parts, ImportError> {
        let rows = root.find(name);
        let rows = rows.map(|it| it.unchecked_rows::<N>(Some(frames)));
        let rows = rows.transpose()?.unwrap_or_else(|| vec![[0.0; N]; frames]);
        Ok(rows.into_iter().map(Vec::from).collect())
    }
    let hands = rows::<FINGERS>(root, "pose_hand", frames)?;
    let (jaws, eyes) = (
        rows::<3>(root, "pose_jaw", frames)?,
        rows::<6>(root, "pose_eye", frames)?,
    );
    let faces = jaws.into_iter().zip(eyes);
    Ok(joined(hands, faces.map(|(a, b)| [a, b].concat()).collect()))
}

/// Hands and faces that move. Where faces move alone, fingers are half open. SMPL-X has no eyelids.
fn joined(mut hands: Parts, faces: Parts) -> Parts {
    let [hands_move, faces_move] =
        [&hands, &faces].map(|rows| rows.iter().flatten().any(|number| *number != 0.0));
    if !hands_move && !faces_move {
        return Parts::new();
    }
    if !hands_move {
        let first = JOINTS.len();
        let joints = (first..).map_while(relaxed).take(FINGERS / 3);
        let row: Vec<f64> = joints.flatten().map(f64::from).collect();
        hands.fill(row);
    }
    if faces_move {
        for (row, face) in hands.iter_mut().zip(faces) {
            row.extend(face);
            row.resize(FINGERS + 3 * FACE.len(), 0.0);
        }
    }
    hands
}
