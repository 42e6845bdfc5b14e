//! The data of a page that plays a person in a browser. The page itself is in `yoto_player`.

mod packed;

use crate::clip::Clip;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use packed::Packed;
use serde::Serialize;
use yoto_avatar::render::SkinnedSplats;
use yoto_capture::skeleton::{SkeletonError, Vec3};

/// The data for the player.
#[derive(Serialize)]
struct PagePerson<'a> {
    joints: &'a [String],
    parents: &'a [Option<usize>],
    rest: &'a [[f64; 3]],
    light: &'a [[f32; 8]; 3],
    count: usize,
    #[serde(rename = "box")]
    bounds: [[f32; 3]; 2],
    ranges: Ranges,
    splats: String,
    degree: usize,
    harmonics: String,
    guessed: String,
    /// Pose blend shapes.
    shapes: Option<PackedShapes>,
    clips: Vec<PackedClip<'a>>,
}

/// Pose blend shapes as [`yoto_avatar::render::SkinnedShapes`] describes them.
#[derive(Serialize)]
struct PackedShapes {
    count: usize,
    /// Metres.
    reach: f32,
    /// `[K, 9, 3, R]`, f32, little-endian.
    basis: String,
    /// `[2, 9 K]`, f32, little-endian.
    limits: String,
    /// `[N, R]` in 8 bits; 128 means 0.
    weights: String,
    /// Largest size of a weight.
    most: f32,
}

/// Ranges of packed numbers.
#[derive(Serialize)]
struct Ranges {
    /// Logarithms.
    deviations: [f32; 2],
    colours: [f32; 2],
    /// Largest size.
    harmonic: f32,
}

#[derive(Serialize)]
struct PackedClip<'a> {
    name: &'a str,
    fps: f64,
    up: Vec3,
    poses: String,
}

/// The page of a `person` called `title`, who moves as in `clips`, or stands in the rest pose without any.
///
/// # Errors
/// If a pose does not fit the person's skeleton.
pub fn page(title: &str, person: &SkinnedSplats, clips: &[Clip]) -> Result<String, SkeletonError> {
    let skeleton = &person.skeleton;
    let Packed {
        bytes,
        harmonics,
        guessed,
        bounds,
    } = packed::pack(&person.splats, person.degree);
    let rest = [Clip::rest(skeleton)];
    let clips = if clips.is_empty() { &rest } else { clips };
    let mut moves = Vec::new();
    for clip in clips {
        moves.push(PackedClip {
            name: &clip.name,
            fps: clip.fps,
            up: clip.up,
            poses: STANDARD.encode(clip.packed(skeleton)?),
        });
    }
    let data = PagePerson {
        joints: &skeleton.names,
        parents: &skeleton.parents,
        rest: &skeleton.rest,
        light: &person.light,
        count: person.splats.len(),
        bounds,
        ranges: Ranges {
            deviations: packed::DEVIATIONS,
            colours: packed::COLOURS,
            harmonic: packed::HARMONIC,
        },
        splats: STANDARD.encode(bytes),
        degree: person.degree,
        harmonics: STANDARD.encode(harmonics),
        guessed: STANDARD.encode(guessed),
        shapes: person.shapes.as_ref().map(|shapes| {
            let (weights, most) = packed::weights(&shapes.weights);
            PackedShapes {
                count: shapes.count,
                reach: shapes.reach,
                basis: STANDARD.encode(packed::floats(&shapes.basis)),
                limits: STANDARD.encode(packed::floats(&shapes.limits)),
                weights: STANDARD.encode(weights),
                most,
            }
        }),
        clips: moves,
    };
    // Strings and finite numbers always have a form in JSON.
    Ok(yoto_player::page(
        title,
        &serde_json::json!(data).to_string(),
    ))
}

#[cfg(test)]
mod tests;
