//! Joints of a model beyond SMPL's: those of fingers, which move the hands' vertices in place of wrists and hands, and those of the face.

use crate::body::{Body, JOINTS};
use crate::file::{MOST_SHARES, NewTensor, joint_rows, regressor, shares, skinning};
use crate::tensors::{FileError, Tensors, floats, indices};
use safetensors::tensor::Dtype;

/// Number of joints of all fingers: three each, in SMPL-H's order, the left hand first.
pub const FINGERS: usize = 30;
/// Number of joints of a face: jaw, left and right eye, left and right upper eyelid.
pub const FACE: usize = 5;
/// Number of joints of a body with fingers.
pub const WITH_FINGERS: usize = JOINTS + FINGERS;
/// Number of joints of a body with fingers and a face.
pub const WITH_FACE: usize = WITH_FINGERS + FACE;

/// Joints that follow others, and the vertices that they move.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtraJoints {
    /// Regressor of the joints, `[N]`: vertices and their shares. Shares are positive and sum to 1.
    pub joints: Vec<Vec<(u32, f32)>>,
    /// Vertices that the joints move, `[H]`, ascending.
    pub vertices: Vec<u32>,
    /// Joints that move each of them, `[H]`, of all joints up to these.
    pub bones: Vec<[u8; 4]>,
    /// Shares of those joints, `[H]`. They sum to 1.
    pub weights: Vec<[f32; 4]>,
}

/// Which joints of a model follow SMPL's, and the tensors of its file for them.
pub(crate) struct Tail {
    /// Their number.
    count: usize,
    /// Number of all joints up to these.
    with: usize,
    vertices: &'static str,
    skinning: [&'static str; 2],
    regressor: [&'static str; 2],
}

/// The joints of fingers.
pub(crate) const OF_FINGERS: Tail = Tail {
    count: FINGERS,
    with: WITH_FINGERS,
    vertices: "finger_vertices",
    skinning: ["finger_bones", "finger_weights"],
    regressor: ["finger_joint_vertices", "finger_joint_shares"],
};
/// The joints of the face.
pub(crate) const OF_FACE: Tail = Tail {
    count: FACE,
    with: WITH_FACE,
    vertices: "face_vertices",
    skinning: ["face_bones", "face_weights"],
    regressor: ["face_joint_vertices", "face_joint_shares"],
};

impl Tail {
    /// The joints in the file of a body with `v` vertices, if it has them.
    pub(crate) fn read(
        &self,
        file: &Tensors<'_>,
        v: usize,
    ) -> Result<Option<ExtraJoints>, FileError> {
        if !file.has(self.vertices) {
            return Ok(None);
        }
        let count = file.count(self.vertices, 1..=v)?;
        let (bones, weights) = skinning(file, self.skinning, count, self.with)?;
        Ok(Some(ExtraJoints {
            joints: regressor(file, self.regressor, self.count, v)?,
            vertices: file.indices(self.vertices, &[count], v)?,
            bones,
            weights,
        }))
    }

    /// The tensors of the file.
    pub(crate) fn tensors(&self, joints: &ExtraJoints) -> Result<Vec<NewTensor>, FileError> {
        let count = joints.vertices.len();
        let [of_bones, of_weights] = self.skinning;
        let [of_vertices, of_shares] = self.regressor;
        let (joint_vertices, joint_shares) = joint_rows(&joints.joints, self.regressor)?;
        let rows = vec![self.count, MOST_SHARES];
        let vertices = indices(self.vertices, &joints.vertices)?;
        let weights = shares(of_weights, &joints.weights)?;
        Ok(vec![
            (self.vertices, Dtype::U16, vec![count], vertices),
            (of_bones, Dtype::U8, vec![count, 4], joints.bones.concat()),
            (of_weights, Dtype::U8, vec![count, 4], weights),
            (
                of_vertices,
                Dtype::U16,
                rows.clone(),
                indices(of_vertices, &joint_vertices)?,
            ),
            (of_shares, Dtype::F32, rows, floats(&joint_shares)),
        ])
    }
}

impl Body {
    /// The model with joints of fingers after its [`JOINTS`]; `None` if it has no fingers.
    pub fn with_fingers(&self) -> Option<Self> {
        Some(self.with(self.fingers.as_ref()?))
    }

    /// The model with joints of fingers and of the face after its [`JOINTS`]; `None` if it lacks either.
    pub fn with_face(&self) -> Option<Self> {
        Some(self.with_fingers()?.with(self.face.as_ref()?))
    }

    fn with(&self, extra: &ExtraJoints) -> Self {
        let mut body = self.clone();
        body.joints.extend(extra.joints.iter().cloned());
        let moved = extra.bones.iter().zip(&extra.weights);
        for (vertex, (bones, weights)) in extra.vertices.iter().zip(moved) {
            let vertex = *vertex as usize;
            (body.bones[vertex], body.weights[vertex]) = (*bones, *weights);
        }
        body
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

/// Whether a joint is of the face.
pub fn is_of_face(joint: u8) -> bool {
    (WITH_FINGERS..WITH_FACE).contains(&usize::from(joint))
}
