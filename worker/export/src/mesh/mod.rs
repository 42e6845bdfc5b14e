//! A person as a skinned mesh: a surface, a texture, and skinning weights.

mod cloud;
pub mod glb;
mod hands;
pub mod obj;
pub mod ply;
mod reduce;
pub mod still;
mod surface;
mod texture;

use crate::gaussians::mean_colours;
use cloud::{Cloud, unit};
use yoto_avatar::render::SkinnedSplats;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::SkeletonError;
use yoto_capture::skeleton::smpl::has_joints;

/// Limits of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshOptions {
    /// Most triangles.
    pub triangles: usize,
    /// Pixels along a side of the texture.
    pub texture: u32,
}

impl Default for MeshOptions {
    fn default() -> Self {
        Self {
            triangles: 20_000,
            texture: 1024,
        }
    }
}

/// A person in the rest pose, metres, y up.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// `[V, 3]`.
    pub positions: Vec<[f32; 3]>,
    /// `[V, 3]`, unit vectors out of the body.
    pub normals: Vec<[f32; 3]>,
    /// `[V, 2]`, texture coordinates from 0 to 1 from the upper left corner.
    pub coordinates: Vec<[f32; 2]>,
    /// `[V]`, four joints each and their skinning weights, which sum to 1.
    pub bones: Vec<[(u16, f32); 4]>,
    /// Indices of the corners, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// sRGB colours of a square, row by row.
    pub texture: Vec<[u8; 3]>,
    /// Pixels along a side of the texture.
    pub side: u32,
}

/// Why a person has no mesh.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// A pose for the light does not fit the skeleton.
    #[error(transparent)]
    Pose(#[from] SkeletonError),
    /// The splats enclose nothing.
    #[error("the splats enclose nothing, or lie metres apart: train the person for longer")]
    Nothing,
    /// The surface does not fit on the texture.
    #[error("unwrapping the surface")]
    Unwrap(#[from] uvunwrap::Error),
    /// The reduction refuses the positions.
    #[error("reducing the surface")]
    Reduce(#[from] meshopt::Error),
}

/// The mesh of a `person`. Its texture has the mean light of `poses`, or that of the rest pose without any.
///
/// # Errors
/// If a pose does not fit the person's skeleton, or the splats enclose nothing.
pub fn mesh(
    person: &SkinnedSplats,
    poses: &[Pose],
    options: &MeshOptions,
) -> Result<Mesh, MeshError> {
    let cloud = Cloud::new(&person.splats, &mean_colours(person, poses)?);
    let surface = surface::surface(&cloud);
    if surface.triangles.is_empty() {
        return Err(MeshError::Nothing);
    }
    let mut surface = reduce::smooth(surface);
    if has_joints(&person.skeleton) {
        surface = hands::with_hands(&cloud, &person.skeleton, surface);
    }
    let surface = reduce::reduced(surface, options.triangles)?;
    let normals = reduce::normals(&surface);
    let settings = uvunwrap::Options {
        density: uvunwrap::Density::Auto {
            page_size: options.texture,
        },
        ..Default::default()
    };
    let corners = surface.triangles.as_flattened();
    let atlas = uvunwrap::generate(
        &[uvunwrap::MeshInput::new(&surface.positions, corners)],
        &settings,
    )?;
    let side = atlas.width.max(atlas.height).max(1);
    let [unwrapped] = atlas.meshes.as_slice() else {
        return Err(MeshError::Nothing);
    };
    let stretch = [atlas.width, atlas.height].map(|length| length as f32 / side as f32);
    let original = |vertex: &uvunwrap::OutputVertex| vertex.xref as usize;
    let vertices = unwrapped.vertices.iter();
    let mut mesh = Mesh {
        positions: vertices
            .clone()
            .map(|v| surface.positions[original(v)])
            .collect(),
        normals: vertices.clone().map(|v| normals[original(v)]).collect(),
        coordinates: vertices
            .clone()
            .map(|v| std::array::from_fn(|a| v.uv[a] * stretch[a]))
            .collect(),
        bones: Vec::new(),
        triangles: unwrapped.indices.as_chunks().0.to_vec(),
        texture: Vec::new(),
        side,
    };
    mesh.bones = mesh
        .positions
        .iter()
        .map(|point| bones(&cloud, *point))
        .collect();
    mesh.texture = texture::texture(&cloud, &mesh);
    Ok(mesh)
}

/// The four bones with the largest skinning weights in the splats around a point of the surface.
fn bones(cloud: &Cloud, point: [f32; 3]) -> [(u16, f32); 4] {
    /// Standard deviation of a splat's influence, metres: about the distance between splats.
    const SPREAD: f32 = 0.01;
    let mut shares: Vec<(u16, f32)> = Vec::new();
    let mut nearest = (f32::INFINITY, [(0, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)]);
    cloud.near(point, |disc| {
        let square: f32 = disc.local(point).iter().map(|v| v * v).sum();
        if square < nearest.0 {
            nearest = (square, disc.bones);
        }
        let weight = disc.opacity * (-0.5 * square / (SPREAD * SPREAD)).exp();
        for (bone, share) in disc.bones {
            match shares.iter_mut().find(|(other, _)| *other == bone) {
                Some((_, sum)) => *sum += weight * share,
                None => shares.push((bone, weight * share)),
            }
        }
    });
    shares.sort_by(|(_, one), (_, other)| other.total_cmp(one));
    shares.truncate(4);
    let sum: f32 = shares.iter().map(|(_, share)| share).sum();
    if sum < 1e-6 {
        return nearest.1;
    }
    std::array::from_fn(|rank| match shares.get(rank) {
        Some((bone, share)) => (*bone, share / sum),
        None => (0, 0.0),
    })
}

#[cfg(test)]
mod tests;
