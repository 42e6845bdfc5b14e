//! Describes a file that was given in the wrong place, for errors that say what to give instead.

use crate::ImportError;
use crate::clip::fault;
use crate::source::Source;
use std::path::Path;
use yoto_formats::Value;

/// Most arrays and keys that are named.
const NAMED: usize = 6;

/// A kind of file, by the keys of its contents, and what to do with it.
struct KnownFile {
    /// Sets of keys. A file that has all keys of one set is of this kind.
    keys: &'static [&'static [&'static str]],
    words: &'static str,
}

/// Files that people confuse with those that an import takes, the surest first.
const KNOWN_FILES: [KnownFile; 12] = [
    KnownFile {
        keys: &[&["bbx_xyxy"], &["bbx_xys"]],
        words: "this is GVHMR's file of boxes; its poses are in hmr4d_results.pt",
    },
    KnownFile {
        keys: &[&["f_imgseq"]],
        words: "this is GVHMR's file of features; its poses are in hmr4d_results.pt",
    },
    KnownFile {
        keys: &[
            &["keypoints", "bbox", "frame_id"],
            &["features", "flipped_features"],
        ],
        words: "this is WHAM's file of tracks; its poses are in wham_output.pkl (--save_pkl)",
    },
    KnownFile {
        keys: &[&["pred_keypoints_3d"]],
        words: "this is SAM 3D Body's, without pred_joint_coords or pred_cam_t: save these two of its dictionary as well",
    },
    KnownFile {
        keys: &[&["poses", "trans"], &["root_orient", "pose_body"]],
        words: "this is a motion: it moves a trained person (yoto render --motion-file), and has no camera for a clip",
    },
    KnownFile {
        keys: &[&["smpl_poses", "smpl_trans"]],
        words: "this is AIST++'s motion: as an .npz of poses and trans it moves a trained person (--motion-file)",
    },
    KnownFile {
        keys: &[
            &["global_orient", "body_pose", "transl"],
            &["thetas", "transl"],
        ],
        words: "these are SMPL's poses without a camera: InstantAvatar's captures have a cameras.npz beside them; as a \
                motion, they move a trained person (--motion-file)",
    },
    KnownFile {
        keys: &[&["J_regressor", "v_template"]],
        words: "this is a body model: --smpl takes it",
    },
    KnownFile {
        keys: &[&["skeleton", "frames", "image_size"]],
        words: "this is a capture's pose track: its folder is imported itself, and as a motion it moves a trained person \
                (--motion-file)",
    },
    KnownFile {
        keys: &[&["intrinsic", "extrinsic"]],
        words: "this is a file of cameras, not of poses",
    },
    KnownFile {
        keys: &[&["img_focal", "img_center"]],
        words: "this is TRAM's camera; its poses are in hps/hps_track_*.npy",
    },
    KnownFile {
        keys: &[&["pred_cam", "pred_vertices"]],
        words: "these are the raw outputs of a network, without a translation in the clip's camera",
    },
];

/// What a file's ending tells about formats that are not read.
const ENDINGS: [(&str, &str); 7] = [
    (
        "trc",
        "this is a motion of markers (OpenSim), which is not read: export BVH, or give the pictures' key points",
    ),
    (
        "c3d",
        "this is a motion of markers, which is not read: export BVH",
    ),
    (
        "mot",
        "this is OpenSim's motion, which is not read: export BVH",
    ),
    (
        "fbx",
        "FBX is not read: export BVH from the program that wrote it",
    ),
    ("glb", "glTF is not read: export BVH"),
    (
        "vmd",
        "this is MikuMikuDance's motion, which is not read: export BVH",
    ),
    (
        "bvh",
        "this is a motion as BVH: --poses FILE.bvh with its clip, or --motion-file",
    ),
];

/// What the name of the file at `path` tells about formats that are not read.
pub(crate) fn of_ending(path: &Path) -> Option<&'static str> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    let found = ENDINGS.iter().find(|(known, _)| *known == ending);
    found.map(|(_, words)| *words)
}

/// A description of the file at `path`: its kind, or its contents.
pub(crate) fn what(path: &Path) -> Option<String> {
    if !path.is_file() {
        return None;
    }
    if let Some(words) = of_ending(path) {
        return Some(words.to_owned());
    }
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    if !["pkl", "pickle", "joblib", "pt", "pth", "npz", "npy", "json"].contains(&&*ending) {
        return None;
    }
    let folder = Source::new(path.parent().unwrap_or(Path::new("")));
    let name = path.file_name()?.to_str()?;
    let data = folder.data(name, None).ok()?;
    let value = data.root().value();
    let known = kind(value).or_else(|| {
        // Of people or frames by number, one tells as much as all.
        let first = match value {
            Value::List(items) => items.first(),
            other => other
                .entries()
                .and_then(|entries| entries.first())
                .map(|(_, value)| value),
        };
        kind(first?)
    });
    let known = known.map(str::to_owned).or_else(|| slam(value));
    Some(known.unwrap_or_else(|| format!("it holds {}", contents(value))))
}

fn kind(value: &Value) -> Option<&'static str> {
    let has_all = |keys: &&[&str]| keys.iter().all(|key| value.get(key).is_some());
    let has = |kind: &&KnownFile| kind.keys.iter().any(has_all);
    KNOWN_FILES.iter().find(has).map(|kind| kind.words)
}

/// WHAM's and DROID's path of the camera: `[F, 7]`.
fn slam(value: &Value) -> Option<String> {
    let shape = value.numbers()?.shape;
    matches!(shape[..], [_, 7]).then(|| {
        format!("{shape:?} numbers, such as the path of a camera (WHAM's slam_results.pth): its poses are in wham_output.pkl")
    })
}

/// Keys, and shapes of arrays.
fn contents(value: &Value) -> String {
    let shape = |value: &Value| match value.numbers() {
        Some(array) if !array.shape.is_empty() => format!("{:?}", array.shape),
        _ => value.kind(),
    };
    match value {
        Value::Dict(entries) => {
            let named = entries
                .iter()
                .take(NAMED)
                .map(|(key, value)| match key.text() {
                    Some(key) => format!("{key} {}", shape(value)),
                    None => format!("a number: {}", shape(value)),
                });
            let more = if entries.len() > NAMED { ", …" } else { "" };
            format!("{}{more}", named.collect::<Vec<_>>().join(", "))
        }
        Value::List(items) if value.numbers().is_none() => match items.first() {
            Some(first) if first.items().is_none() => {
                format!("a list of {}, first {}", items.len(), contents(first))
            }
            _ => value.kind(),
        },
        other => shape(other),
    }
}

/// The error about the file or folder at `path`; `looked` names the expected ones.
pub(crate) fn unknown(path: &Path, looked: &str) -> ImportError {
    let found = what(path).map_or(String::new(), |what| format!("{what}. "));
    let message = format!("{found}Looked for {looked}");
    fault(path, "UNKNOWN", message)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(json: &str) -> String {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.json");
        std::fs::write(&path, json).expect("writes");
        what(&path).expect("JSON is looked into")
    }

    #[test]
    fn what_a_file_is_is_told_by_what_it_holds() {
        assert!(of(r#"{"bbx_xyxy": [[0, 0, 1, 1]], "bbx_xys": []}"#).contains("hmr4d_results.pt"));
        assert!(
            of(r#"{"0": {"keypoints": [], "bbox": [], "frame_id": []}}"#)
                .contains("wham_output.pkl")
        );
        assert!(of(r#"{"poses": [[0]], "trans": [[0]]}"#).contains("--motion-file"));
        assert!(of("[[0,0,0,0,0,0,1]]").contains("slam_results"));
        assert_eq!(
            of(r#"{"a": [[1, 2]], "b": "x"}"#),
            "it holds a [1, 2], b text"
        );
        assert_eq!(
            of(r#"[{"a": 1}]"#),
            "it holds a list of 1, first a a number"
        );
        assert!(
            what(Path::new("walk.trc")).is_none(),
            "there is no such file"
        );
    }
}
