//! The model.

use crate::extra_joints::ExtraJoints;

/// Number of joints K, those of SMPL in its order.
pub const JOINTS: usize = 24;

/// A linear model of clothed bodies with V vertices, F triangles, C shape components and D colour components.
///
/// Bodies stand in a T-pose: y up, facing +z, left hand at +x, feet at y = 0, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Mean vertices, `[V]`, metres.
    pub mean: Vec<[f32; 3]>,
    /// Shape components σₖ Uₖ, `[C V]`, metres per standard deviation, one component after the other. The component with
    /// the largest deviation is first.
    pub shapes: Vec<[f32; 3]>,
    /// Mean colours, `[V]`, 0 to 1, sRGB.
    pub colour_mean: Vec<[f32; 3]>,
    /// Colour components τₖ Tₖ, `[D V]`, per standard deviation, in the order of `shapes`.
    pub colours: Vec<[f32; 3]>,
    /// Triangles, `[F]`, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// Texture coordinates, `[V]`, 0 to 1. Left and right shoe share theirs.
    pub uv: Vec<[f32; 2]>,
    /// Regressor of the joints, `[K]`: vertices and their shares. Shares are positive and sum to 1.
    pub joints: Vec<Vec<(u32, f32)>>,
    /// Joints that move a vertex, `[V]`.
    pub bones: Vec<[u8; 4]>,
    /// Shares of those joints, `[V]`. They sum to 1.
    pub weights: Vec<[f32; 4]>,
    /// The partner of each vertex on the other side, `[V]`. A vertex on the middle plane is its own.
    pub mirror: Vec<u32>,
    /// Part of each vertex, `[V]`: 0 main, 1 left eye, 2 right eye.
    pub part: Vec<u8>,
    /// The first vertex at the same place, `[V]`: seams of the texture duplicate vertices.
    pub welded: Vec<u32>,
    /// What fingers move, if the bodies that the model is learned from have them.
    pub fingers: Option<ExtraJoints>,
    /// What jaw, eyes and eyelids move, if the bodies that the model is learned from have fingers and eyes.
    pub face: Option<ExtraJoints>,
}

impl Body {
    /// Number of shape components C.
    pub fn shape_components(&self) -> usize {
        self.shapes.len() / self.mean.len().max(1)
    }

    /// Number of colour components D.
    pub fn colour_components(&self) -> usize {
        self.colours.len() / self.colour_mean.len().max(1)
    }

    /// The vertices of a body with the code β, `[V]`, metres. Components without a number count 0, and numbers without a
    /// component count nothing.
    pub fn vertices(&self, shape: &[f32]) -> Vec<[f32; 3]> {
        combined(&self.mean, &self.shapes, shape)
    }

    /// The colours of a body with the code γ, `[V]`, sRGB. An extreme code gives colours beyond 0 to 1.
    pub fn colours_of(&self, code: &[f32]) -> Vec<[f32; 3]> {
        combined(&self.colour_mean, &self.colours, code)
    }

    /// The joints at rest of a body with these vertices, `[K]`, metres. A vertex that is missing counts nothing.
    pub fn joints_of(&self, vertices: &[[f32; 3]]) -> Vec<[f32; 3]> {
        joints_of(&self.joints, vertices)
    }
}

/// The joints of a regressor, `[K]`, metres, of a body with these vertices.
pub(crate) fn joints_of(regressor: &[Vec<(u32, f32)>], vertices: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let joint = |shares: &Vec<(u32, f32)>| {
        let mut sum = [0.0; 3];
        for (vertex, share) in shares {
            let at = vertices.get(*vertex as usize).copied().unwrap_or_default();
            for (sum, at) in sum.iter_mut().zip(at) {
                *sum += share * at;
            }
        }
        sum
    };
    regressor.iter().map(joint).collect()
}

/// mean + Σₖ codeₖ componentₖ.
fn combined(mean: &[[f32; 3]], components: &[[f32; 3]], code: &[f32]) -> Vec<[f32; 3]> {
    let mut sum = mean.to_vec();
    for (number, component) in code.iter().zip(components.chunks_exact(mean.len().max(1))) {
        for (sum, part) in sum
            .as_flattened_mut()
            .iter_mut()
            .zip(component.as_flattened())
        {
            *sum += number * part;
        }
    }
    sum
}
