//! One motion in the BVH files of several programs, against the rotations that the script that wrote
//! them made them from.

use crate::captures;
use serde::Deserialize;
use std::collections::HashMap;
use std::path::Path;
use yoto_import::motion::{Motion, MotionOptions, Up, read};

type Vec3 = [f64; 3];
type Mat3 = [Vec3; 3];

#[derive(Deserialize)]
struct Dialect {
    /// The file's name of each joint of a person.
    matched: HashMap<String, String>,
    frames: Vec<Expected>,
}

#[derive(Deserialize)]
struct Expected {
    /// Global rotations of the joints of a T-pose that faces +z.
    rotations: HashMap<String, Mat3>,
    places: HashMap<String, Vec3>,
}

fn dialects() -> HashMap<String, Dialect> {
    let text = std::fs::read(captures("bvh/dialects.json")).expect("the script's figures");
    serde_json::from_slice(&text).expect("JSON")
}

/// Global rotations of the joints in frame `at`.
fn rotations(motion: &Motion, at: usize) -> Vec<Mat3> {
    use yoto_capture::skeleton::transform::{compose, rigid, rodrigues};
    let mut global: Vec<[[f64; 4]; 3]> = Vec::new();
    for (joint, rotation) in motion.frames[at].rotations.iter().enumerate() {
        let local = rigid(rodrigues(*rotation), [0.0; 3]);
        let parent = motion.skeleton.parents[joint];
        global.push(match usize::try_from(parent) {
            Ok(parent) => compose(&global[parent], &local),
            Err(_) => local,
        });
    }
    let rotation = |it: &[[f64; 4]; 3]| it.map(|row| [row[0], row[1], row[2]]);
    global.iter().map(rotation).collect()
}

/// Degrees between two rotations.
fn degrees(a: &Mat3, b: &Mat3) -> f64 {
    let trace: f64 = (a.iter().flatten().zip(b.iter().flatten()))
        .map(|(a, b)| a * b)
        .sum();
    ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees()
}

#[test]
fn every_dialect_moves_a_person_as_it_was_made() {
    for (name, dialect) in dialects() {
        let path = captures(&format!("bvh/{name}.bvh"));
        let motion =
            read(&path, &MotionOptions::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
        let matched: HashMap<String, String> = motion.matched.iter().cloned().collect();
        assert_eq!(matched, dialect.matched, "{name}");
        assert_eq!(motion.frames.len(), dialect.frames.len(), "{name}");
        for (at, expected) in dialect.frames.iter().enumerate() {
            let pelvis = expected.places["pelvis"];
            let off = (0..3).map(|a| (motion.frames[at].root[a] - pelvis[a]).abs());
            assert!(
                off.fold(0.0, f64::max) < 1e-3,
                "{name} frame {at}: the pelvis"
            );
            for (joint, found) in motion.skeleton.names.iter().zip(rotations(&motion, at)) {
                let off = degrees(&found, &expected.rotations[joint]);
                // Nothing defines the axes of feet and collars: they are not limbs of their own.
                let free = joint.ends_with("foot") || joint.ends_with("collar");
                assert!(
                    off < 0.1 || free,
                    "{name} frame {at}: {joint} is {off:.1} degrees off"
                );
            }
        }
        let is_standing = !matches!(&*name, "lafan1" | "bandai_namco" | "rokoko");
        assert_eq!(
            motion.notes.is_empty(),
            is_standing,
            "{name}: {:?}",
            motion.notes
        );
    }
}

/// The file `name` with the columns of its frames changed.
fn changed(name: &str, dir: &Path, change: impl Fn(&mut Vec<f64>)) -> std::path::PathBuf {
    let text = std::fs::read_to_string(captures(name)).expect("a file");
    let (head, frames) = text.split_once("Frame Time: 0.0333333\n").expect("frames");
    let frames: String = (frames.lines())
        .map(|line| {
            let mut row: Vec<f64> = line
                .split(' ')
                .map(|v| v.parse().expect("a number"))
                .collect();
            change(&mut row);
            let row: Vec<String> = row.iter().map(f64::to_string).collect();
            row.join(" ") + "\n"
        })
        .collect();
    let path = dir.join("changed.bvh");
    std::fs::write(&path, format!("{head}Frame Time: 0.0333333\n{frames}")).expect("writes");
    path
}

#[test]
fn a_person_who_never_stands_is_refused_or_lies_as_asked() {
    let dir = tempfile::tempdir().expect("a folder");
    let message = |path: &Path, options: &MotionOptions| {
        read(path, options).expect_err("refused").to_string()
    };
    // All rotations zero: every bone along +x for good.
    let folded = changed("bvh/lafan1.bvh", dir.path(), |row| row[3..].fill(0.0));
    let error = message(&folded, &MotionOptions::default());
    assert!(
        error.contains("does not tell which axis is up") && error.contains("--up"),
        "{error}"
    );
    let asked = MotionOptions {
        up: Some(Up::Y),
        ..MotionOptions::default()
    };
    let error = message(&folded, &asked);
    assert!(error.contains("not a standing person"), "{error}");
    // Lying on the front: the first rotation is about y, so the second tips the body over.
    let lying = changed("bvh/xsens.bvh", dir.path(), |row| {
        row[3..6].copy_from_slice(&[0.0, 90.0, 0.0]);
    });
    let error = message(&lying, &MotionOptions::default());
    assert!(error.contains("does the person lie"), "{error}");
    let motion = read(&lying, &asked).expect("believed");
    assert!((motion.frames[0].rotations[0][0] - std::f64::consts::FRAC_PI_2).abs() < 1e-6);
    assert!(motion.notes.is_empty());
    // The spine, which is along the hips' own x, along z, in a file whose rest pose does not stand, but
    // in one frame, in which the person lies along y.
    let frame = std::cell::Cell::new(0);
    let z_up = changed("bvh/lafan1.bvh", dir.path(), |row| {
        frame.set(frame.get() + 1);
        let lies = frame.get() == 4;
        row[3..6].copy_from_slice(if lies {
            &[90.0, 0.0, 0.0]
        } else {
            &[0.0, -90.0, 0.0]
        });
    });
    let motion = read(&z_up, &MotionOptions::default()).expect("z is up");
    let notes = motion.notes.join("; ");
    assert!(
        notes.contains("z is up") && notes.contains("frame 0"),
        "{notes}"
    );
}
