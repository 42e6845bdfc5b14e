//! Splats in `.glb` files, by glTF's extension `KHR_gaussian_splatting`.

use super::{Gaussian, harmonics};
use crate::glb::{Numbers, Target};
use serde_json::json;
use std::io::{self, Write};

const EXTENSION: &str = "KHR_gaussian_splatting";

/// Writes `splats`. Programs without the extension show coloured points.
///
/// # Errors
/// If writing fails, or the file has 4 GiB or more.
pub fn write(to: &mut impl Write, splats: &[Gaussian]) -> io::Result<()> {
    let mut numbers = Numbers::default();
    let means: Vec<[f32; 3]> = splats.iter().map(|splat| splat.mean).collect();
    let means = numbers.bounded(&means, Target::Vertices);
    let mut rows = |row: &dyn Fn(&Gaussian) -> [f32; 4]| {
        let rows: Vec<[f32; 4]> = splats.iter().map(row).collect();
        numbers.rows(&rows, Target::Vertices)
    };
    let turns = rows(&|splat| {
        let [w, x, y, z] = splat.rotation;
        [x, y, z, w]
    });
    let points = rows(&|splat| {
        let [red, green, blue] = splat.colour.map(linear);
        [red, green, blue, splat.opacity.clamp(0.0, 1.0)]
    });
    let mut rows = |row: &dyn Fn(&Gaussian) -> [f32; 3]| {
        let rows: Vec<[f32; 3]> = splats.iter().map(row).collect();
        numbers.rows(&rows, Target::Vertices)
    };
    let deviations = rows(&|splat| splat.deviations);
    let colours = rows(&Gaussian::harmonic);
    let opacities: Vec<[f32; 1]> = splats
        .iter()
        .map(|splat| [splat.opacity.clamp(0.0, 1.0)])
        .collect();
    let opacities = numbers.rows(&opacities, Target::Vertices);
    let named = |name: &str| format!("{EXTENSION}:{name}");
    let mut attributes = json!({
        "POSITION": means,
        "COLOR_0": points,
        (named("ROTATION")): turns,
        (named("SCALE")): deviations,
        (named("OPACITY")): opacities,
        (named("SH_DEGREE_0_COEF_0")): colours,
    });
    for k in 0..harmonics(splats) {
        let (degree, index) = if k < 3 { (1, k) } else { (2, k - 3) };
        let rows: Vec<[f32; 3]> = splats.iter().map(|splat| splat.harmonics[k]).collect();
        let rows = numbers.rows(&rows, Target::Vertices);
        attributes[named(&format!("SH_DEGREE_{degree}_COEF_{index}"))] = json!(rows);
    }
    let scene = json!({
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{
            "mode": 0,
            "attributes": attributes,
            "extensions": { EXTENSION: {
                "kernel": "ellipse",
                "colorSpace": "srgb_rec709_display",
                "projection": "perspective",
                "sortingMethod": "cameraDistance",
            }},
        }]}],
    });
    numbers.write(scene, to)
}

/// The linear value of an sRGB value (IEC 61966-2-1): glTF's colours of points are linear.
fn linear(value: f32) -> f32 {
    match value.clamp(0.0, 1.0) {
        dark if dark <= 0.04045 => dark / 12.92,
        value => ((value + 0.055) / 1.055).powf(2.4),
    }
}
