//! Importers against captures that the originals' own libraries wrote (`tests/formats`): each
//! joint of each frame must land where the script that wrote them says.

mod bad;
#[expect(unreachable_pub, reason = "the file is a module of another crate, too")]
#[path = "../../../../tests/src/bvh.rs"]
mod bvh;
mod bvh_clip;
mod capture_check;
mod captures;
mod dialects;
mod easymocap_camera;
mod features;
mod few_bad_frames;
mod ffmpeg;
mod film;
mod key_point_faces;
mod key_point_hands;
mod key_point_masks;
mod key_points;
#[cfg(feature = "matting")]
mod matting;
mod misfits;
mod motions;
mod moving_camera;
#[cfg(feature = "matting")]
#[path = "../../../../worker/matting/tests/networks/mod.rs"]
mod networks;
mod npz;
mod own_skeleton;
mod pickled;
mod point_shapes;
mod pose_tools;
mod pose_tools_bad;
mod pose_tools_bodies;
mod pose_tools_made;
mod pose_tools_misread;
mod projected;
mod rigs;
mod takes;
mod traps;
mod up;
mod words;
mod written;

use std::path::PathBuf;
use yoto_import::Format;

/// The format that `--from` calls `name`.
fn format(name: &str) -> Format {
    Format::named(name).unwrap_or_else(|| panic!("no format is called {name}"))
}

/// A file or folder that the script wrote.
fn captures(name: &str) -> PathBuf {
    let here = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo runs the tests"));
    here.join("../../tests/formats/captures").join(name)
}

/// What the script says of a capture.
fn expected(name: &str) -> serde_json::Value {
    let text = std::fs::read(captures("expected.json")).expect("the script's figures");
    let mut all: serde_json::Value = serde_json::from_slice(&text).expect("JSON");
    let part = all[name].take();
    assert!(!part.is_null(), "{name}");
    part
}
