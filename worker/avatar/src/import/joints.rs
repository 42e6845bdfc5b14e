//! Canonical joints of a foreign model: a pickle of the released HumanNeRF program's data
//! preparation, plain JSON, or the skeleton of a capture.

use super::ImportError;
use serde_json::Value as Json;
use std::ops::RangeInclusive;
use std::path::Path;
use yoto_capture::skeleton::Vec3;
pub(super) use yoto_capture::skeleton::smpl::JOINTS as SMPL;
use yoto_formats::{Value, pickle};

/// Largest file that is read, bytes: 24 joints take under a thousandth.
const MAX_BYTES: u64 = 64 << 20;
/// Extents of a body along its longest axis, metres: from a child to stretched arms, with room.
const EXTENT: RangeInclusive<f64> = 0.3..=4.0;

/// The 24 canonical joints, metres, as their file has them: a pickle `{"joints": [24][3]}`, JSON in the
/// same form or as a bare list, or a capture's `poses.json`, whose rest joints they are. None is moved:
/// the networks know the positions that they were trained with, and the released program leaves the
/// pelvis where SMPL's template has it.
///
/// # Errors
/// When the file is none of these, or its numbers are not a body's joints in metres.
pub fn read_canonical_joints(path: &Path) -> Result<Vec<Vec3>, ImportError> {
    let failed = |message: String| ImportError::file(path, message);
    let size = std::fs::metadata(path)
        .map_err(|e| failed(e.to_string()))?
        .len();
    if size > MAX_BYTES {
        return Err(failed(format!("{size} bytes are too many for 24 joints")));
    }
    let bytes = std::fs::read(path).map_err(|e| failed(e.to_string()))?;
    let joints = match bytes.first() {
        Some(b'{' | b'[' | b' ' | b'\n' | b'\t' | b'\r') => from_json(&bytes),
        _ => pickle::read(&bytes)
            .map_err(|error| error.to_string())
            .and_then(|value| from_pickle(&value)),
    }
    .map_err(failed)?;
    if joints.len() != SMPL.len() {
        return Err(failed(format!(
            "{} joints, {} are needed",
            joints.len(),
            SMPL.len()
        )));
    }
    plausible(&joints).map_err(failed)?;
    Ok(joints)
}

/// Refuses what can't be a body in metres: it would render as an empty frame.
fn plausible(joints: &[Vec3]) -> Result<(), String> {
    let finite = |joint: &Vec3| joint.iter().all(|v| v.is_finite());
    if let Some(at) = joints.iter().position(|joint| !finite(joint)) {
        return Err(format!("joints[{at}]: not a position"));
    }
    let extent = |a: usize| {
        let along = joints.iter().map(|joint| joint[a]);
        along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min)
    };
    let longest = (0..3).map(extent).fold(0.0, f64::max);
    if EXTENT.contains(&longest) {
        return Ok(());
    }
    let hint = match longest > *EXTENT.end() {
        true => "; are these millimetres?",
        false => "",
    };
    Err(format!(
        "joints: a body of {longest:.3} from end to end; metres are expected{hint}"
    ))
}

fn from_json(bytes: &[u8]) -> Result<Vec<Vec3>, String> {
    let json: Json = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
    if let Some(skeleton) = json.get("skeleton") {
        let parents: Vec<Option<usize>> = skeleton
            .get("parents")
            .and_then(Json::as_array)
            .into_iter()
            .flatten()
            .map(|parent| parent.as_u64().map(|parent| parent as usize))
            .collect();
        if !parents.iter().eq(SMPL.iter().map(|(_, parent)| parent)) {
            return Err("skeleton.parents: not the 24 joints of SMPL".into());
        }
        return positions(skeleton.get("rest_joints"), "skeleton.rest_joints");
    }
    positions(Some(json.get("joints").unwrap_or(&json)), "joints")
}

fn positions(json: Option<&Json>, field: &str) -> Result<Vec<Vec3>, String> {
    json.and_then(|json| serde_json::from_value(json.clone()).ok())
        .ok_or_else(|| format!("{field}: not a list of [x, y, z]"))
}

fn from_pickle(value: &Value) -> Result<Vec<Vec3>, String> {
    let joints = value.get("joints").unwrap_or(value);
    let joints = joints
        .numbers()
        .ok_or("joints: neither an array nor lists of numbers")?;
    joints
        .rows()
        .ok_or_else(|| format!("joints: shape {:?}, [24, 3] is needed", joints.shape))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: &str, bytes: &[u8]) -> Result<Vec<Vec3>, ImportError> {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).expect("writes");
        read_canonical_joints(&path)
    }

    /// Numbers that binary fractions hold exactly, so that JSON gives them back bit for bit.
    fn list() -> Vec<Vec3> {
        (0..24)
            .map(|k| [0.09375 * f64::from(k), 0.5, -1.0])
            .collect()
    }

    #[test]
    fn json_comes_in_three_forms() {
        let bare = serde_json::to_vec(&list()).expect("json");
        assert_eq!(read("a.json", &bare).expect("bare"), list());
        let keyed = serde_json::to_vec(&serde_json::json!({"joints": list()})).expect("json");
        assert_eq!(read("a.json", &keyed).expect("keyed"), list());
        let parents: Vec<i64> = SMPL
            .iter()
            .map(|(_, p)| p.map_or(-1, |p| p as i64))
            .collect();
        let capture = serde_json::json!({"skeleton": {"parents": parents, "rest_joints": list()}});
        let joints = read("poses.json", &serde_json::to_vec(&capture).expect("json"));
        assert_eq!(joints.expect("a capture"), list(), "nothing is moved");
    }

    #[test]
    fn what_is_no_list_of_24_is_refused() {
        for (bytes, part) in [
            (b"[[1,2,3]]".as_slice(), "1 joints, 24 are needed"),
            (b"[[1,2]]", "not a list of [x, y, z]"),
            (b"{\"skeleton\": {\"parents\": [-1]}}", "skeleton.parents"),
            (b"", "ends"),
        ] {
            let error = read("a", bytes).expect_err(part).to_string();
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn bodies_of_other_sizes_than_people_are_refused() {
        let scaled = |factor: f64| {
            let joints: Vec<Vec3> = list().iter().map(|j| j.map(|v| v * factor)).collect();
            read("joints.json", &serde_json::to_vec(&joints).expect("json"))
        };
        for fine in [0.25, 1.0, 1.7] {
            assert!(scaled(fine).is_ok(), "{fine}");
        }
        let error = scaled(1000.0).expect_err("millimetres").to_string();
        for part in [
            "joints.json",
            "a body of 2156.250",
            "are these millimetres?",
        ] {
            assert!(error.contains(part), "{error}");
        }
        let error = scaled(0.1).expect_err("a doll").to_string();
        assert!(error.contains("a body of 0.216"), "{error}");
        assert!(error.contains("metres are expected"), "{error}");
        assert!(!error.contains("millimetres"), "{error}");
    }
}
