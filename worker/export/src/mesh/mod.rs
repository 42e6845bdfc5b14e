//! A person as a mesh: a closed surface, a texture, and the bones that carry it.

mod cloud;
pub mod glb;
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

/// What a mesh may cost.
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
    /// `[V, 2]`, shares of the texture's sides from its upper left corner.
    pub coordinates: Vec<[f32; 2]>,
    /// `[V]`, four joints each and their shares, which sum to 1.
    pub bones: Vec<[(u16, f32); 4]>,
    /// Corners, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Colours as a screen shows them, row by row, of a square.
    pub texture: Vec<[u8; 3]>,
    /// Pixels along a side of the texture.
    pub side: u32,
}

/// A person that makes no mesh.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// A pose for the light is of another skeleton.
    #[error(transparent)]
    Pose(#[from] SkeletonError),
    /// Nothing solid.
    #[error("the splats enclose nothing, or lie metres apart: train the person for longer")]
    Nothing,
    /// No place on the texture.
    #[error("unwrapping the surface")]
    Unwrap(#[from] uvunwrap::Error),
    /// Positions that the reduction can't read.
    #[error("reducing the surface")]
    Reduce(#[from] meshopt::Error),
}

/// The mesh of a `person`. Its texture has the mean light of `poses`, or that of the rest pose without any.
///
/// # Errors
/// If a pose is not of the person's skeleton, or the splats enclose nothing.
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
    let surface = reduce::reduced(reduce::smooth(surface), options.triangles)?;
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

/// The four bones with the largest shares in the splats around a point of the surface.
fn bones(cloud: &Cloud, point: [f32; 3]) -> [(u16, f32); 4] {
    /// Standard deviation of a splat's say, metres: the distance between splats.
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
    std::array::from_fn(|place| match shares.get(place) {
        Some((bone, share)) => (*bone, share / sum),
        None => (0, 0.0),
    })
}

#[cfg(test)]
mod tests;
