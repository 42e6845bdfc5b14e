use super::*;
use crate::clip::Clip;
use std::collections::HashMap;
use std::f32::consts::{PI, TAU};
use yoto_avatar::render::SkinnedSplat;
use yoto_body::Body;
use yoto_body::person::mesh::normals;
use yoto_body::person::sample::{SurfacePoint, spread};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::smpl::JOINTS;

const RADIUS: f32 = 0.2;
/// Standard deviation of a splat across the ball, metres.
const THICKNESS: f32 = 0.002;
/// Radius at which half of the light is absorbed.
const SEEN: f32 = RADIUS + surface::OUTWARD * THICKNESS;

/// A ball of splats around [0, 1, 0], red above its middle and blue below, with one bone on either side of x = 0,
/// without the splats in the cap of `hole` radians around x.
fn ball(hole: f32) -> SkinnedSplats {
    let count = 4000;
    // A Fibonacci lattice.
    let direction = |i: usize| {
        let y = 1.0 - 2.0 * (i as f32 + 0.5) / count as f32;
        let angle = TAU * (i as f32 * 0.618_034).fract();
        let across = (1.0 - y * y).sqrt();
        [across * angle.cos(), y, across * angle.sin()]
    };
    let splat = |n: [f32; 3]| {
        // The rotation from z to n.
        let rotation = match n[2] < -0.999 {
            true => [0.0, 1.0, 0.0, 0.0],
            false => {
                let w = ((1.0 + n[2]) / 2.0).sqrt();
                [w, -n[1] / (2.0 * w), n[0] / (2.0 * w), 0.0]
            }
        };
        let (red, blue) = if n[1] > 0.0 { (0.8, 0.1) } else { (0.1, 0.8) };
        let bone = u16::from(n[0] > 0.0);
        SkinnedSplat {
            mean: [RADIUS * n[0], 1.0 + RADIUS * n[1], RADIUS * n[2]],
            rotation,
            deviations: [0.006, 0.006, THICKNESS],
            opacity: 0.9,
            colour: [red, 0.5, blue],
            harmonics: [[0.0; 3]; 8],
            bones: [(bone, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)],
            guessed: false,
        }
    };
    let outside_hole = |n: &[f32; 3]| n[0] < hole.cos();
    SkinnedSplats {
        skeleton: Skeleton {
            names: vec!["root".into(), "arm".into()],
            parents: vec![None, Some(0)],
            rest: vec![[0.0, 1.0, 0.0], [0.1, 1.0, 0.0]],
        },
        splats: (0..count)
            .map(direction)
            .filter(outside_hole)
            .map(splat)
            .collect(),
        shapes: None,
        degree: 0,
        light: [[0.0; 8]; 3],
    }
}

/// For each edge, by the positions of its ends, the number of triangles along its direction minus the number against
/// it.
fn edges(mesh: &Mesh) -> HashMap<[[u32; 3]; 2], i32> {
    let mut edges = HashMap::new();
    for triangle in &mesh.triangles {
        let position = triangle.map(|corner| mesh.positions[corner as usize].map(f32::to_bits));
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            *edges.entry([position[a], position[b]]).or_insert(0) += 1;
            *edges.entry([position[b], position[a]]).or_insert(0) -= 1;
        }
    }
    edges
}

fn volume(mesh: &Mesh) -> f32 {
    let mut volume = 0.0;
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize]);
        volume += cloud::dot(a, cloud::cross(b, c)) / 6.0;
    }
    volume
}

fn from_middle([x, y, z]: [f32; 3]) -> f32 {
    (x * x + (y - 1.0) * (y - 1.0) + z * z).sqrt()
}

#[test]
fn a_ball_of_splats_is_a_closed_ball_even_with_a_hole() {
    let options = MeshOptions {
        triangles: 2000,
        texture: 128,
    };
    for hole in [0.0, 0.12] {
        let person = ball(hole);
        let mesh = mesh(&person, &[], &options).expect("a mesh");
        assert!(edges(&mesh).values().all(|sum| *sum == 0), "open");
        assert!(mesh.triangles.len() <= 2000);
        let exact = 4.0 / 3.0 * PI * SEEN.powi(3);
        assert!(
            (volume(&mesh) / exact - 1.0).abs() < 0.02,
            "{}",
            volume(&mesh) / exact
        );
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            // Over the hole the lid is flat.
            let lid = position[0] > SEEN * (1.6 * hole).cos() - 1e-3 && hole > 0.0;
            let off = (from_middle(*position) - SEEN).abs();
            assert!(
                off < if lid { 0.006 } else { 0.002 },
                "{off} at {position:?}"
            );
            let outward = unit([position[0], position[1] - 1.0, position[2]]);
            assert!(cloud::dot(outward, *normal) > if lid { 0.7 } else { 0.95 });
        }
    }
}

#[test]
fn a_mesh_has_no_more_triangles_than_wanted_and_stays_closed() {
    // To within a centimetre, the ball has more than a hundred.
    let options = MeshOptions {
        triangles: 24,
        texture: 64,
    };
    let mesh = mesh(&ball(0.0), &[], &options).expect("a mesh");
    let count = mesh.triangles.len();
    assert!((8..=24).contains(&count), "{count}");
    assert!(edges(&mesh).values().all(|sum| *sum == 0), "open");
    let share = volume(&mesh) / (4.0 / 3.0 * PI * SEEN.powi(3));
    assert!((0.4..1.2).contains(&share), "{share}");
}

#[test]
fn a_surface_with_few_triangles_stays_as_it_is() {
    let tetrahedron = || surface::Surface {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    };
    for wanted in [4, 1_000_000] {
        let reduced = reduce::reduced(tetrahedron(), wanted).expect("finite positions");
        let positions = |surface: &surface::Surface| -> Vec<_> {
            let corners = surface.triangles.as_flattened().iter();
            corners.map(|at| surface.positions[*at as usize]).collect()
        };
        assert_eq!(positions(&reduced), positions(&tetrahedron()));
    }
}

#[test]
fn what_floats_beside_a_person_is_not_of_the_mesh() {
    let mut person = ball(0.0);
    let speck = person.splats[0];
    for i in 0..40 {
        let mut other = speck;
        other.mean = [
            0.5 + 0.002 * (i % 7) as f32,
            1.0 + 0.002 * (i / 7) as f32,
            0.0,
        ];
        person.splats.push(other);
    }
    let mesh = mesh(&person, &[], &MeshOptions::default()).expect("a mesh");
    let farthest = mesh
        .positions
        .iter()
        .map(|position| from_middle(*position))
        .fold(0.0, f32::max);
    assert!(farthest < SEEN + 0.01, "{farthest}");
}

#[test]
fn vertices_have_the_colours_and_the_bones_of_their_place() {
    let options = MeshOptions {
        triangles: 3000,
        texture: 256,
    };
    let mesh = mesh(&ball(0.0), &[], &options).expect("a mesh");
    for (vertex, position) in mesh.positions.iter().enumerate() {
        let [u, v] = mesh.coordinates[vertex];
        let pixel = |share: f32| ((share * mesh.side as f32) as usize).min(mesh.side as usize - 1);
        let [red, green, blue] = mesh.texture[pixel(v) * mesh.side as usize + pixel(u)];
        if (position[1] - 1.0).abs() > 0.03 {
            let (more, less) = if position[1] > 1.0 {
                (red, blue)
            } else {
                (blue, red)
            };
            assert!(more > 195 && less < 35, "{position:?} {red} {blue}");
            assert!((120..=135).contains(&green));
        }
        let shares = mesh.bones[vertex];
        assert!((shares.iter().map(|(_, share)| share).sum::<f32>() - 1.0).abs() < 1e-5);
        if position[0].abs() > 0.03 {
            assert_eq!(shares[0].0, u16::from(position[0] > 0.0));
            assert!(shares[0].1 > 0.95);
        }
    }
}

/// Splats on the mean body where `wanted`, each with the skeleton's nearest bone.
fn on_body(wanted: impl Fn([f32; 3]) -> bool) -> SkinnedSplats {
    let body = Body::people();
    let normals = normals(body, &body.mean);
    let points = spread(body, &body.mean, |_| true, 30_000);
    let splat = |point: &SurfacePoint| {
        let [x, y, z] = unit(point.of(body, &normals));
        // The rotation from z to the normal.
        let w = ((1.0 + z) / 2.0).sqrt().max(1e-3);
        SkinnedSplat {
            mean: point.of(body, &body.mean),
            rotation: [w, -y / (2.0 * w), x / (2.0 * w), 0.0],
            deviations: [0.005, 0.005, THICKNESS],
            opacity: 0.9,
            colour: [0.5; 3],
            harmonics: [[0.0; 3]; 8],
            bones: point
                .skinning(body)
                .map(|(bone, share)| (u16::from(bone), share)),
            guessed: false,
        }
    };
    let rest = body.joints_of(&body.mean).into_iter();
    SkinnedSplats {
        skeleton: Skeleton {
            names: JOINTS.iter().map(|(name, _)| (*name).to_owned()).collect(),
            parents: JOINTS.iter().map(|(_, parent)| *parent).collect(),
            rest: rest.map(|joint| joint.map(f64::from)).collect(),
        },
        splats: (points.iter())
            .filter(|point| wanted(point.of(body, &body.mean)))
            .map(splat)
            .collect(),
        shapes: None,
        degree: 0,
        light: [[0.0; 8]; 3],
    }
}

/// Where hands begin, from the middle of the body, metres.
fn wrists() -> f32 {
    let joints = Body::people().joints_of(&Body::people().mean);
    joints[20][0].abs().max(joints[21][0].abs())
}

#[test]
fn hands_have_the_fingers_of_the_body() {
    let body = Body::people();
    let mesh = mesh(&on_body(|_| true), &[], &MeshOptions::default()).expect("a mesh");
    let beyond = |distance: f32| move |at: &&[f32; 3]| at[0].abs() > wrists() + distance;
    let off = |from: &[f32; 3], to: &[[f32; 3]]| {
        let square = |at: &[f32; 3]| (0..3).map(|a| (at[a] - from[a]).powi(2)).sum::<f32>();
        to.iter().map(square).fold(f32::INFINITY, f32::min).sqrt()
    };
    let hands: Vec<&[f32; 3]> = mesh.positions.iter().filter(beyond(0.03)).collect();
    assert!(hands.len() > 300, "{}", hands.len());
    for at in hands {
        assert!(
            off(at, &body.mean) < 0.008,
            "{at:?}: {}",
            off(at, &body.mean)
        );
    }
    for at in body.mean.iter().filter(beyond(0.1)) {
        assert!(off(at, &mesh.positions) < 0.012, "{at:?}");
    }
}

#[test]
fn hands_that_splats_do_not_show_are_left_out() {
    let left_alone = on_body(|at| at[0] > -wrists() + 0.02);
    let mesh = mesh(&left_alone, &[], &MeshOptions::default()).expect("a mesh");
    let reach = |side: f32| {
        let all = mesh.positions.iter().map(|at| side * at[0]);
        all.fold(0.0, f32::max)
    };
    assert!(reach(1.0) > wrists() + 0.12, "{}", reach(1.0));
    assert!(reach(-1.0) < wrists() + 0.02, "{}", reach(-1.0));
}

#[test]
fn a_person_without_splats_is_an_error() {
    let mut person = ball(0.0);
    person.splats.clear();
    let error = mesh(&person, &[], &MeshOptions::default()).expect_err("nothing");
    assert!(matches!(error, MeshError::Nothing));
}

#[test]
fn a_file_has_the_mesh_its_joints_and_its_motions() {
    let person = ball(0.0);
    let mesh = mesh(&person, &[], &MeshOptions::default()).expect("a mesh");
    let mut clip = Clip::rest(&person.skeleton);
    clip.fps = 10.0;
    let mut turned = clip.poses[0].clone();
    turned.rotations[0] = [0.0, 0.0, 0.5];
    turned.translation = [3.0, 0.0, 0.0];
    clip.poses.push(turned);
    let mut file = Vec::new();
    glb::write(&mut file, "ada", &mesh, &person.skeleton, &[clip]).expect("writes");
    let length = u32::from_le_bytes(file[12..16].try_into().expect("4 bytes")) as usize;
    let scene: serde_json::Value = serde_json::from_slice(&file[20..20 + length]).expect("JSON");
    assert_eq!(scene["skins"][0]["joints"], serde_json::json!([1, 2]));
    assert_eq!(scene["nodes"][1]["children"], serde_json::json!([2]));
    let channels = scene["animations"][0]["channels"]
        .as_array()
        .expect("channels");
    assert_eq!(channels.len(), 3);
    let times = scene["animations"][0]["samplers"][0]["input"]
        .as_u64()
        .expect("times") as usize;
    assert_eq!(
        scene["accessors"][times]["max"],
        serde_json::json!([0.1f32])
    );
    let corners = scene["meshes"][0]["primitives"][0]["indices"]
        .as_u64()
        .expect("corners") as usize;
    assert_eq!(
        scene["accessors"][corners]["count"],
        3 * mesh.triangles.len()
    );
}
