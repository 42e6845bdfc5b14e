//! Learns a model from bodies in dense correspondence.
//!
//! Every identity counts the same, in however many outfits it comes, and every body counts twice, once with left and
//! right exchanged, so that components are either symmetric or antisymmetric and the mean is symmetric.

mod components;
mod face;
mod fingers;
mod joints;
mod measure;
mod nnls;
mod read;
mod symmetry;
#[cfg(test)]
pub(crate) mod tests;
mod triangles;

pub use measure::Report;
pub use read::{Bodies, BodyMesh, ReadError};

use crate::body::{Body, JOINTS};
use thiserror::Error;

/// How to learn.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Shape components C, at most.
    pub shapes: usize,
    /// Colour components D, at most.
    pub colours: usize,
    /// Identities that are left out; capitals and small letters are the same.
    pub without: Vec<String>,
}

/// Why nothing can be learned.
#[derive(Debug, Error)]
pub enum LearnError {
    /// An identity to be left out is unknown.
    #[error("there is no identity {0} among the bodies")]
    Identity(String),
    /// A body is unknown.
    #[error("there is no body {0} among the bodies; one of them is {1}")]
    Body(String, String),
    /// Fingers are asked for.
    #[error("the bodies have no fingers: their archives lack the bones of their rig")]
    NoFingers,
    /// Nobody is left.
    #[error("{bodies} bodies are left to learn from, which is too few for {components} components")]
    TooFew {
        /// Bodies that are left.
        bodies: usize,
        /// Components asked for.
        components: usize,
    },
    /// The decomposition does not converge.
    #[error("the bodies have no eigenvalue decomposition")]
    Decomposition,
}

impl Body {
    /// Learns a model from `bodies`.
    ///
    /// # Errors
    /// If an identity to be left out is unknown, or if too few bodies are left.
    pub fn learn(bodies: &Bodies, settings: &Settings) -> Result<Self, LearnError> {
        let weights = bodies.weights_without(&settings.without)?;
        let kept: Vec<(usize, f64)> = (weights.into_iter().enumerate())
            .filter(|(_, weight)| *weight > 0.0)
            .collect();
        let components = settings.shapes.max(settings.colours);
        if kept.len() < 2 || 2 * kept.len() <= components {
            return Err(LearnError::TooFew {
                bodies: kept.len(),
                components,
            });
        }
        let topology = &bodies.topology;
        let mean = bodies.mean(&kept);
        let welded = symmetry::weld(bodies, &kept, &mean);
        let mirror = symmetry::mirror(topology, &mean, &welded);
        let both = |rows: &[Vec<[f32; 3]>], flip: bool| -> Vec<(Vec<[f32; 3]>, f64)> {
            let row = |(body, weight): &(usize, f64)| {
                let row = rows[*body].clone();
                let mirrored = symmetry::mirrored(&row, &mirror, flip);
                [(row, weight / 2.0), (mirrored, weight / 2.0)]
            };
            kept.iter().flat_map(row).collect()
        };
        let shapes = components::learn(both(&bodies.vertices, true), settings.shapes)?;
        let colours = components::learn(both(&bodies.colours, false), settings.colours)?;
        let mut joints = joints::learn(bodies, &kept, &shapes.mean, &welded, &mirror);
        let of_fingers = joints.split_off(JOINTS);
        let face = topology
            .finger_weights
            .is_some()
            .then(|| face::of(topology, &shapes.mean, &welded));
        Ok(Self {
            joints,
            fingers: (topology.finger_weights.as_deref())
                .map(|weights| fingers::of_rig(topology, weights, of_fingers)),
            face: face.flatten(),
            mean: shapes.mean,
            shapes: shapes.components,
            colour_mean: colours.mean,
            colours: colours.components,
            faces: topology.faces.clone(),
            uv: topology.uv.clone(),
            bones: topology.bones.clone(),
            weights: topology.weights.clone(),
            part: topology.part.clone(),
            mirror,
            welded,
        })
    }
}
