//! A mesh with bones and motions as a `.glb` file.

use super::Mesh;
use crate::clip::Clip;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use serde_json::{Value, json};
use std::io::{self, Write};
use yoto_capture::skeleton::transform::{compose, position, sub, to_quaternion};
use yoto_capture::skeleton::{Skeleton, SkeletonError};
use yoto_formats::glb::{Numbers, Target};

/// Why a mesh can't be written.
#[derive(Debug, thiserror::Error)]
pub enum GlbError {
    /// A clip of another skeleton.
    #[error("the clip {clip}")]
    Clip {
        /// Its name.
        clip: String,
        /// What is wrong with a pose.
        source: SkeletonError,
    },
    /// A skeleton with more joints than a byte counts.
    #[error("{0} joints; 256 at most")]
    Joints(usize),
    /// The texture's file.
    #[error("the texture")]
    Texture(#[from] image::ImageError),
    /// The file.
    #[error(transparent)]
    Write(#[from] io::Error),
}

/// Writes a person called `name`, who stands on the origin and faces z on average in each clip. The texture includes the
/// capture's light, so it is shown without shading (`KHR_materials_unlit`).
///
/// # Errors
/// If a clip does not fit `skeleton`, or writing fails.
pub fn write(
    to: &mut impl Write,
    name: &str,
    mesh: &Mesh,
    skeleton: &Skeleton,
    clips: &[Clip],
) -> Result<(), GlbError> {
    let joints = skeleton.joints();
    if joints > 256 {
        return Err(GlbError::Joints(joints));
    }
    let mut numbers = Numbers::default();
    let bones = mesh.bones.iter();
    // glTF demands joint 0 for a joint without a weight.
    let joint = |(bone, share): (u16, f32)| if share > 0.0 { bone as u8 } else { 0 };
    let carriers: Vec<[u8; 4]> = bones.clone().map(|bones| bones.map(joint)).collect();
    let shares: Vec<[f32; 4]> = bones.map(|bones| bones.map(|(_, share)| share)).collect();
    let attributes = json!({
        "POSITION": numbers.bounded(&mesh.positions, Target::Vertices),
        "NORMAL": numbers.rows(&mesh.normals, Target::Vertices),
        "TEXCOORD_0": numbers.rows(&mesh.coordinates, Target::Vertices),
        "JOINTS_0": numbers.rows(&carriers, Target::Vertices),
        "WEIGHTS_0": numbers.rows(&shares, Target::Vertices),
    });
    let corners: Vec<[u32; 1]> = mesh
        .triangles
        .as_flattened()
        .iter()
        .map(|corner| [*corner])
        .collect();
    let corners = numbers.rows(&corners, Target::Triangles);
    let back: Vec<[f32; 16]> = skeleton
        .rest
        .iter()
        .map(|rest| unmoved(rest.map(|v| -v)))
        .collect();
    let back = numbers.rows(&back, Target::Other);
    let texture = numbers.picture(&png(mesh)?);
    let mut animations = Vec::new();
    for clip in clips {
        let animation =
            animation(&mut numbers, clip, skeleton).map_err(|source| GlbError::Clip {
                clip: clip.name.clone(),
                source,
            })?;
        animations.push(animation);
    }
    let mut scene = json!({
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": nodes(name, skeleton),
        "skins": [{ "joints": (1..=joints).collect::<Vec<_>>(), "inverseBindMatrices": back }],
        "meshes": [{ "name": name, "primitives": [{
            "attributes": attributes, "indices": corners, "material": 0,
        }]}],
        "materials": [{
            "name": name,
            "pbrMetallicRoughness": {
                "baseColorTexture": { "index": 0 }, "metallicFactor": 0.0, "roughnessFactor": 1.0,
            },
            "extensions": { "KHR_materials_unlit": {} },
        }],
        "textures": [{ "source": 0, "sampler": 0 }],
        // glTF's codes: linear, linear also between mip levels, and clamped to the edge.
        "samplers": [{ "magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071 }],
        "images": [{ "bufferView": texture, "mimeType": "image/png" }],
    });
    if !animations.is_empty() {
        scene["animations"] = animations.into();
    }
    Ok(numbers.write(scene, to)?)
}

/// The mesh's node, then the joints' nodes in their order.
fn nodes(name: &str, skeleton: &Skeleton) -> Vec<Value> {
    let mut nodes = vec![json!({ "name": name, "mesh": 0, "skin": 0 })];
    for joint in 0..skeleton.joints() {
        let rest = skeleton.rest[joint];
        let offset = match skeleton.parents[joint] {
            Some(parent) => sub(rest, skeleton.rest[parent]),
            None => rest,
        };
        let mut node = json!({ "name": skeleton.names[joint], "translation": offset });
        let children = skeleton.parents.iter().enumerate();
        let children: Vec<usize> = children
            .filter(|(_, parent)| **parent == Some(joint))
            .map(|(child, _)| child + 1)
            .collect();
        if !children.is_empty() {
            node["children"] = json!(children);
        }
        nodes.push(node);
    }
    nodes
}

/// The rotations of all joints and the translation of the root, frame by frame.
fn animation(
    numbers: &mut Numbers,
    clip: &Clip,
    skeleton: &Skeleton,
) -> Result<Value, SkeletonError> {
    let to = clip.stand(skeleton)?;
    let frames = 0..clip.poses.len();
    let times: Vec<[f32; 1]> = frames
        .map(|frame| [(frame as f64 / clip.fps) as f32])
        .collect();
    let times = numbers.bounded(&times, Target::Other);
    let mut rotations = vec![Vec::new(); skeleton.joints()];
    let mut path = Vec::new();
    for pose in &clip.poses {
        let joints = skeleton.world_transforms(pose);
        let Some(root) = joints.first() else { continue };
        let root = compose(&to, root);
        path.push(position(&root).map(|value| value as f32));
        for (joint, (rotations, rotation)) in
            rotations.iter_mut().zip(pose.rotations_f64()).enumerate()
        {
            let matrix = match joint {
                0 => root.map(|[a, b, c, _]| [a, b, c]),
                _ => yoto_capture::skeleton::transform::rodrigues(rotation),
            };
            let [w, x, y, z] = to_quaternion(&matrix).map(|value| value as f32);
            rotations.push(upright(rotations.last(), [x, y, z, w]));
        }
    }
    let mut channels = Vec::new();
    let mut samplers = Vec::new();
    let mut add = |joint: usize, what: &str, output: usize| {
        channels.push(json!({
            "sampler": samplers.len(), "target": { "node": joint + 1, "path": what },
        }));
        samplers.push(json!({ "input": times, "output": output, "interpolation": "LINEAR" }));
    };
    add(0, "translation", numbers.rows(&path, Target::Other));
    for (joint, rotations) in rotations.iter().enumerate() {
        add(joint, "rotation", numbers.rows(rotations, Target::Other));
    }
    Ok(json!({ "name": clip.name, "channels": channels, "samplers": samplers }))
}

/// The one of a quaternion and its negative, which is the same rotation, that is nearer to the frame before, so that
/// interpolation takes the short way.
fn upright(before: Option<&[f32; 4]>, rotation: [f32; 4]) -> [f32; 4] {
    let side: f32 = before.map_or(1.0, |before| {
        before.iter().zip(rotation).map(|(a, b)| a * b).sum()
    });
    if side < 0.0 {
        rotation.map(|q| -q)
    } else {
        rotation
    }
}

/// A translation as a matrix, column after column.
fn unmoved([x, y, z]: [f64; 3]) -> [f32; 16] {
    let [x, y, z] = [x, y, z].map(|value| value as f32);
    [
        1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0,
    ]
}

/// The texture as a PNG file.
pub(super) fn png(mesh: &Mesh) -> Result<Vec<u8>, image::ImageError> {
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Best, FilterType::Adaptive)
        .write_image(
            mesh.texture.as_flattened(),
            mesh.side,
            mesh.side,
            ExtendedColorType::Rgb8,
        )?;
    Ok(file)
}
