//! The fingers of a model: thirty more joints, which move the hands' vertices in place of wrists and hands.

use crate::body::{Body, JOINTS};
use crate::file::{MOST_SHARES, NewTensor, joint_rows, regressor, shares, skinning};
use crate::tensors::{FileError, Tensors, floats, indices};
use safetensors::tensor::Dtype;

/// Number of joints of all fingers: three each, in SMPL-H's order, the left hand first.
pub const FINGERS: usize = 30;
/// Number of joints of a body with fingers.
pub const WITH_FINGERS: usize = JOINTS + FINGERS;

/// The fingers' joints, and the vertices that they move.
#[derive(Clone, Debug, PartialEq)]
pub struct Fingers {
    /// Regressor of the fingers' joints, `[30]`: vertices and their shares. Shares are positive and sum to 1.
    pub joints: Vec<Vec<(u32, f32)>>,
    /// Vertices that fingers move, `[H]`, ascending.
    pub vertices: Vec<u32>,
    /// Joints that move each of them, `[H]`, those of fingers after the [`JOINTS`].
    pub bones: Vec<[u8; 4]>,
    /// Shares of those joints, `[H]`. They sum to 1.
    pub weights: Vec<[f32; 4]>,
}

/// Names of the tensors of a file with fingers.
const VERTICES: &str = "finger_vertices";
const SKINNING: [&str; 2] = ["finger_bones", "finger_weights"];
const REGRESSOR: [&str; 2] = ["finger_joint_vertices", "finger_joint_shares"];

impl Fingers {
    /// The fingers in the file of a body with `v` vertices, if it has them.
    pub(crate) fn read(file: &Tensors<'_>, v: usize) -> Result<Option<Self>, FileError> {
        if !file.has(VERTICES) {
            return Ok(None);
        }
        let count = file.count(VERTICES, 1..=v)?;
        let (bones, weights) = skinning(file, SKINNING, count, WITH_FINGERS)?;
        Ok(Some(Self {
            joints: regressor(file, REGRESSOR, FINGERS, v)?,
            vertices: file.indices(VERTICES, &[count], v)?,
            bones,
            weights,
        }))
    }

    /// The tensors of the file.
    pub(crate) fn tensors(&self) -> Result<Vec<NewTensor>, FileError> {
        let count = self.vertices.len();
        let (joint_vertices, joint_shares) = joint_rows(&self.joints, REGRESSOR)?;
        let rows = vec![FINGERS, MOST_SHARES];
        Ok(vec![
            (
                VERTICES,
                Dtype::U16,
                vec![count],
                indices(VERTICES, &self.vertices)?,
            ),
            (SKINNING[0], Dtype::U8, vec![count, 4], self.bones.concat()),
            (
                SKINNING[1],
                Dtype::U8,
                vec![count, 4],
                shares(SKINNING[1], &self.weights)?,
            ),
            (
                REGRESSOR[0],
                Dtype::U16,
                rows.clone(),
                indices(REGRESSOR[0], &joint_vertices)?,
            ),
            (REGRESSOR[1], Dtype::F32, rows, floats(&joint_shares)),
        ])
    }
}

impl Body {
    /// The model with joints of fingers after its [`JOINTS`]; `None` if it has no fingers.
    pub fn with_fingers(&self) -> Option<Self> {
        let fingers = self.fingers.as_ref()?;
        let mut body = self.clone();
        body.joints.extend(fingers.joints.iter().cloned());
        let moved = fingers.bones.iter().zip(&fingers.weights);
        for (vertex, (bones, weights)) in fingers.vertices.iter().zip(moved) {
            let vertex = *vertex as usize;
            (body.bones[vertex], body.weights[vertex]) = (*bones, *weights);
        }
        Some(body)
    }
}

/// The side of the hand that a joint moves: 0 for the left wrist, hand and fingers, 1 for the right ones, `None` for other joints.
pub fn hand_of(joint: u8) -> Option<usize> {
    match joint {
        20 | 22 | 24..=38 => Some(0),
        21 | 23 | 39..=53 => Some(1),
        _ => None,
    }
}
