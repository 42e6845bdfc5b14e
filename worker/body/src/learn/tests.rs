//! A model is learned from made-up bodies, who differ by known components.

use super::{Bodies, LearnError, ReadError, Settings};
use crate::body::{Body, JOINTS};
use std::f32::consts::TAU;
use std::io::{Cursor, Write};
use zip::write::{SimpleFileOptions, ZipWriter};

/// Rings and segments of a barrel. The last segment lies on the first: a seam on the middle plane.
const RINGS: usize = 12;
const SEGMENTS: usize = 12;
const VERTICES: usize = RINGS * (SEGMENTS + 1);
/// How tall and how stout each identity is, in standard deviations of 1.
const CODES: [[f32; 2]; 4] = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
/// Relative standard deviations of tall and stout.
const DEVIATIONS: [f32; 2] = [0.1, 0.04];

fn array(dtype: &str, shape: &[usize], data: Vec<u8>) -> Vec<u8> {
    let sides: String = shape.iter().map(|side| format!("{side},")).collect();
    let header = format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({sides}), }}");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

fn archive(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in arrays {
        let started = writer.start_file(format!("{name}.npy"), SimpleFileOptions::default());
        started.expect("starts");
        writer.write_all(bytes).expect("writes");
    }
    writer.finish().expect("finishes").into_inner()
}

fn barrel([tall, stout]: [f32; 2]) -> Vec<[f32; 3]> {
    let vertex = |at: usize| {
        let (ring, segment) = (at / (SEGMENTS + 1), at % (SEGMENTS + 1) % SEGMENTS);
        // From the middle plane, so that segments are mirror images of each other.
        let (sin, cos) = (TAU * segment as f32 / SEGMENTS as f32).sin_cos();
        let radius = 0.2 * (1.0 + DEVIATIONS[1] * stout);
        let height = 1.7 * ring as f32 / (RINGS - 1) as f32 * (1.0 + DEVIATIONS[0] * tall);
        [radius * sin, height, radius * cos]
    };
    (0..VERTICES).map(vertex).collect()
}

/// Two vertices of each joint, whose middle it is: front and back for those in the middle, else one above the other.
fn ends(joint: usize) -> [usize; 2] {
    let other = super::joints::OTHER[joint];
    let ring = joint.min(other) / 3;
    let at = |ring: usize, segment: usize| ring * (SEGMENTS + 1) + segment;
    match other {
        _ if other == joint => [at(ring, 0), at(ring, SEGMENTS / 2)],
        _ if other > joint => [at(ring, 3), at(ring + 1, 3)],
        _ => [at(ring, 9), at(ring + 1, 9)],
    }
}

/// The archives of bodies with these names, with an identity's code each.
fn archives(people: &[(&str, [f32; 2])]) -> [Vec<u8>; 2] {
    let n = people.len();
    let (mut names, mut vertices, mut colours, mut joints) = (vec![], vec![], vec![], vec![]);
    for (name, code) in people {
        let letters = name.chars().chain(std::iter::repeat('\0')).take(12);
        names.extend(letters.flat_map(|letter| (letter as u32).to_le_bytes()));
        let body = barrel(*code);
        let steps = body
            .as_flattened()
            .iter()
            .map(|metres| (metres * 1e4).round() as i16);
        vertices.extend(steps.flat_map(i16::to_le_bytes));
        // Stout people wear light clothes.
        colours.extend(vec![(128.0 + 40.0 * code[1]) as u8; 3 * VERTICES]);
        for joint in 0..JOINTS {
            let [a, b] = ends(joint).map(|at| body[at]);
            joints.extend((0..3).flat_map(|c| (0.5 * (a[c] + b[c])).to_le_bytes()));
        }
    }
    let mut faces: Vec<u8> = Vec::new();
    for ring in 0..RINGS - 1 {
        for segment in 0..SEGMENTS {
            let at = ring * (SEGMENTS + 1) + segment;
            let above = at + SEGMENTS + 1;
            // Diagonals of left and right are mirror images of each other.
            let two = if segment < SEGMENTS / 2 {
                [[at, at + 1, above], [at + 1, above + 1, above]]
            } else {
                [[at, at + 1, above + 1], [at, above + 1, above]]
            };
            faces.extend(
                two.as_flattened()
                    .iter()
                    .flat_map(|at| (*at as u16).to_le_bytes()),
            );
        }
    }
    let uv: Vec<u8> = (0..2 * VERTICES)
        .flat_map(|_| 0.25f32.to_le_bytes())
        .collect();
    let count = faces.len() / 6;
    let bodies = archive(&[
        ("names", array("<U12", &[n], names)),
        ("vertices", array("<i2", &[n, VERTICES, 3], vertices)),
        ("colours", array("|u1", &[n, VERTICES, 3], colours)),
        ("joints", array("<f4", &[n, JOINTS, 3], joints)),
    ]);
    let topology = archive(&[
        ("faces", array("<u2", &[count, 3], faces)),
        ("uv", array("<f4", &[VERTICES, 2], uv)),
        ("part", array("|u1", &[VERTICES], vec![0; VERTICES])),
        (
            "weight_joint",
            array("|u1", &[VERTICES, 4], [3, 0, 0, 0].repeat(VERTICES)),
        ),
        (
            "weight",
            array("|u1", &[VERTICES, 4], [255, 0, 0, 0].repeat(VERTICES)),
        ),
    ]);
    [bodies, topology]
}

fn people() -> Bodies {
    let [a, b, c, d] = CODES;
    // The first comes in three outfits, and counts once. The last is left out of some trainings.
    let people = [
        ("a_1_casual", a),
        ("a_1_busi", a),
        ("a_1_util", a),
        ("b_1_casual", b),
        ("c_1_casual", c),
        ("d_1_casual", d),
        ("E_1_casual", [0.5, 2.0]),
    ];
    let [bodies, topology] = archives(&people);
    Bodies::read(&bodies, &topology).expect("reads")
}

fn without(identities: &[&str]) -> Settings {
    Settings {
        shapes: 3,
        colours: 2,
        without: identities
            .iter()
            .map(|identity| identity.to_string())
            .collect(),
    }
}

pub(crate) fn learned() -> Body {
    Body::learn(&people(), &without(&["e_1"])).expect("learns")
}

#[test]
fn known_components_are_found() {
    let body = learned();
    let mean = barrel([0.0; 2]);
    let close = |a: &[[f32; 3]], b: &[[f32; 3]]| {
        a.iter()
            .zip(b)
            .all(|(a, b)| super::symmetry::distance(*a, *b) < 2e-4)
    };
    assert!(close(&body.mean, &mean));
    assert_eq!((body.shape_components(), body.colour_components()), (3, 2));
    // Components have a sign that nobody chose, the same for all vertices.
    let [tall, stout] = [[1.0, 0.0], [0.0, 1.0]].map(barrel);
    for (component, truth) in [(0, tall), (1, stout)] {
        let [there, back] = [1.0, -1.0].map(|number| {
            let mut code = [0.0; 2];
            code[component] = number;
            body.vertices(&code)
        });
        assert!(
            close(&there, &truth) || close(&back, &truth),
            "component {component}"
        );
    }
    let rest = &body.shapes[2 * VERTICES..];
    assert!(rest.as_flattened().iter().all(|number| number.abs() < 1e-3));
    let light = body.colours_of(&[1.0])[0][0] - body.colour_mean[0][0];
    assert!((light.abs() - 40.0 / 255.0).abs() < 0.01, "{light}");
}

#[test]
fn partners_are_mutual_and_seams_are_welded() {
    let body = learned();
    for (at, partner) in body.mirror.iter().enumerate() {
        let other = *partner as usize;
        let [x, y, z] = body.mean[at];
        assert!(
            super::symmetry::distance([-x, y, z], body.mean[other]) < 1e-6,
            "{at}"
        );
        let twice = body.mirror[other] as usize;
        assert_eq!(body.welded[twice], body.welded[at]);
        assert!(
            x.abs() > 1e-6 || other == at,
            "a vertex on the middle plane is its own partner"
        );
    }
    for ring in 0..RINGS {
        let first = ring * (SEGMENTS + 1);
        assert_eq!(body.welded[first + SEGMENTS], first as u32);
        assert_eq!(body.welded[first + 1], first as u32 + 1);
    }
}

#[test]
fn who_was_left_out_is_described() {
    let (bodies, body) = (people(), learned());
    let report = body.measure(&bodies, &["e_1".into()]).expect("measures");
    assert_eq!(report.bodies, 1);
    let [(0, nothing), .., (3, all)] = report.shapes[..] else {
        panic!("{:?}", report.shapes)
    };
    assert!(nothing[0] > 20.0 && all[0] < 0.3, "{report}");
    assert!(report.joints.iter().all(|off| *off < 1.0), "{report}");
    assert_eq!((report.mirrored, report.mutual), (1.0, 1.0));
}

#[test]
fn identities_must_exist_and_somebody_must_be_left() {
    let bodies = people();
    let unknown = Body::learn(&bodies, &without(&["f_1"]));
    assert!(matches!(unknown, Err(LearnError::Identity(name)) if name == "f_1"));
    let nobody = Body::learn(&bodies, &without(&["a_1", "b_1", "c_1", "d_1", "e_1"]));
    assert!(matches!(nobody, Err(LearnError::TooFew { bodies: 0, .. })));
    let many = Settings {
        shapes: 40,
        ..without(&[])
    };
    assert!(matches!(
        Body::learn(&bodies, &many),
        Err(LearnError::TooFew { .. })
    ));
}

#[test]
fn faults_of_arrays_are_named() {
    let [bodies, topology] = archives(&[("a_1_casual", [0.0; 2])]);
    assert!(matches!(
        Bodies::read(&topology, &topology),
        Err(ReadError::Missing("vertices"))
    ));
    assert!(matches!(
        Bodies::read(&bodies, &bodies),
        Err(ReadError::Missing("faces"))
    ));
    assert!(matches!(
        Bodies::read(b"", &topology),
        Err(ReadError::Npz(_))
    ));
}
