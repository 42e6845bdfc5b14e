//! The model that the program has, and files.

use crate::body::{Body, JOINTS};
use crate::extra_joints::{
    ExtraJoints, FACE, FINGERS, WITH_FACE, WITH_FINGERS, hand_of, is_of_face,
};
use crate::learn::tests::learned;
use crate::tensors::FileError;
use safetensors::SafeTensors;
use safetensors::tensor::TensorView;

const HEAD: usize = 15;
/// The joint on the other side of the left ones.
const RIGHT_OF_LEFT: [(usize, usize); 9] = [
    (1, 2),
    (4, 5),
    (7, 8),
    (10, 11),
    (13, 14),
    (16, 17),
    (18, 19),
    (20, 21),
    (22, 23),
];

/// The same file, with the bytes of one tensor changed, which are given with the bytes of a row. It is left out if
/// nothing is left of it.
fn changed(bytes: &[u8], tensor: &str, change: impl Fn(&mut Vec<u8>, usize)) -> Vec<u8> {
    let (_, header) = SafeTensors::read_metadata(bytes).expect("a header");
    let notes = header.metadata().clone();
    let file = SafeTensors::deserialize(bytes).expect("a file");
    let mut tensors = Vec::new();
    for (name, view) in file.tensors() {
        let (mut data, mut shape) = (view.data().to_vec(), view.shape().to_vec());
        if name == tensor {
            let row = shape[1..].iter().product::<usize>() * view.dtype().bitsize() / 8;
            change(&mut data, row);
            shape[0] = data.len() / row;
        }
        if name != tensor || !data.is_empty() {
            tensors.push((name, view.dtype(), shape, data));
        }
    }
    let views = tensors.iter().map(|(name, dtype, shape, data)| {
        let view = TensorView::new(*dtype, shape.clone(), data);
        (name, view.expect("a view"))
    });
    safetensors::serialize(views, notes).expect("a file")
}

#[test]
fn the_program_has_a_model() {
    let body = Body::people();
    let v = body.mean.len();
    assert_eq!(v, 22_442);
    assert_eq!(
        (body.shape_components(), body.colour_components()),
        (40, 24)
    );
    assert_eq!((body.shapes.len(), body.colours.len()), (40 * v, 24 * v));
    assert_eq!(
        (body.colour_mean.len(), body.uv.len(), body.part.len()),
        (v, v, v)
    );
    assert_eq!((body.bones.len(), body.weights.len()), (v, v));
    assert_eq!(
        (body.mirror.len(), body.welded.len(), body.joints.len()),
        (v, v, JOINTS)
    );
    assert_eq!(body.faces.len(), 42_552);
    let eyes = [1, 2].map(|eye| body.part.iter().filter(|part| **part == eye).count());
    assert_eq!(eyes, [201, 201]);
    assert!(
        body.weights
            .iter()
            .all(|row| (row.iter().sum::<f32>() - 1.0).abs() < 1e-5)
    );
    assert!(
        body.welded
            .iter()
            .all(|first| body.welded[*first as usize] == *first)
    );
}

#[test]
fn it_has_fingers_that_move_hands_alone() {
    let plain = Body::people();
    let body = Body::for_joints(WITH_FINGERS);
    assert_eq!(Body::for_joints(JOINTS), plain);
    assert_eq!(body.joints.len(), WITH_FINGERS);
    let joints = body.joints_of(&body.mean);
    // Three joints in a row, outward from the wrist, and the right hand mirrors the left one.
    for finger in 0..5 {
        let [a, b, c] = [0, 1, 2].map(|joint| joints[JOINTS + 3 * finger + joint]);
        assert!(
            joints[20][0] < a[0] && a[0] < b[0] && b[0] < c[0],
            "{finger}"
        );
        let right = joints[JOINTS + 15 + 3 * finger];
        assert!((a[0] + right[0]).abs() < 1e-3 && (a[1] - right[1]).abs() < 1e-3);
    }
    let mut moved = [0usize; WITH_FINGERS];
    for vertex in 0..body.mean.len() {
        let own = body.bones[vertex].iter().zip(body.weights[vertex]);
        let own: Vec<(usize, f32)> = own
            .filter(|(_, weight)| *weight > 0.0)
            .map(|(bone, weight)| (usize::from(*bone), weight))
            .collect();
        assert!((own.iter().map(|it| it.1).sum::<f32>() - 1.0).abs() < 1e-3);
        for (bone, _) in own.iter().filter(|(bone, _)| *bone >= JOINTS) {
            moved[*bone] += 1;
            let side = usize::from(*bone >= JOINTS + FINGERS / 2);
            assert_eq!(hand_of(*bone as u8), Some(side));
            // Beyond the wrist, on its own side.
            let x = body.mean[vertex][0] * [1.0, -1.0][side];
            assert!(x > joints[20][0] - 0.03, "vertex {vertex} at {x}");
        }
    }
    assert!(
        moved[JOINTS..].iter().all(|count| *count > 100),
        "{moved:?}"
    );
    // A finger that bends leaves the others where they are.
    let index = |vertex: usize| (24..27).contains(&body.bones[vertex][0]);
    let tips = (0..body.mean.len()).filter(|i| index(*i) && body.mean[*i][0] > joints[26][0]);
    let away = tips.map(|i| body.mean[i][2] - joints[29][2]);
    assert!(away.fold(f32::INFINITY, f32::min) > 0.0);
}

#[test]
fn its_face_moves_what_a_face_does() {
    let body = Body::for_joints(WITH_FACE);
    assert_eq!(body.joints.len(), WITH_FACE);
    let joints = body.joints_of(&body.mean);
    let [jaw, left, right] = [54, 55, 56].map(|joint| joints[joint]);
    assert!(
        (left[0] + right[0]).abs() < 2e-3 && left[0] > 0.025,
        "{left:?}"
    );
    assert!(
        jaw[0].abs() < 2e-3 && jaw[1] < left[1] && jaw[2] < left[2],
        "{jaw:?}"
    );
    assert_eq!(joints[57..], joints[55..57]);
    let weight = |vertex: usize, joint: usize| -> f32 {
        let own = body.bones[vertex].iter().zip(body.weights[vertex]);
        own.filter(|(bone, _)| usize::from(**bone) == joint)
            .map(|(_, weight)| weight)
            .sum()
    };
    let all = || 0..body.mean.len();
    for vertex in all() {
        let of_face: f32 = (WITH_FINGERS..WITH_FACE).map(|it| weight(vertex, it)).sum();
        let [x, y, z] = body.mean[vertex];
        // Nothing behind the ears, and nothing below the throat.
        assert!(
            of_face < 0.01 || (z > jaw[2] && y > 1.44 && x.abs() < 0.09),
            "{vertex}"
        );
        if body.part[vertex] > 0 {
            assert!(weight(vertex, 54 + usize::from(body.part[vertex])) > 0.99);
        }
    }
    // The chin goes with the jaw, the nose and the upper lip do not.
    let near = |at: [f32; 3]| {
        let off =
            |vertex: usize| -> f32 { (0..3).map(|a| (body.mean[vertex][a] - at[a]).powi(2)).sum() };
        all()
            .min_by(|a, b| off(*a).total_cmp(&off(*b)))
            .expect("vertices")
    };
    let [chin, nose] = [[0.0, 1.475, 0.168], [0.0, 1.54, 0.187]].map(near);
    assert!(weight(chin, 54) > 0.95 && weight(nose, 54) < 0.01);
    let [upper, lower] = [[0.0, 1.514, 0.177], [0.0, 1.502, 0.1745]].map(near);
    assert!(weight(upper, 54) < 0.05 && weight(lower, 54) > 0.95);
    // The edge of the left upper eyelid goes with it, the lower one and the brow do not.
    let [edge, under, brow] = [
        [0.03, 1.579, 0.151],
        [0.03, 1.5700, 0.151],
        [0.03, 1.595, 0.165],
    ]
    .map(near);
    assert!(
        weight(edge, 57) > 0.8 && weight(edge, 58) == 0.0,
        "{}",
        weight(edge, 57)
    );
    assert!(weight(under, 57) < 0.05 && weight(brow, 57) < 0.05);
    assert!((WITH_FINGERS..WITH_FACE).all(|joint| is_of_face(joint as u8)));
    assert_eq!(WITH_FACE - WITH_FINGERS, FACE);
}

#[test]
fn its_mean_is_a_person() {
    let body = Body::people();
    let ends = |c: usize| {
        let numbers = body.mean.iter().map(|place| place[c]);
        numbers.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], x| {
            [low.min(x), high.max(x)]
        })
    };
    let [[left, right], [feet, crown], [back, toes]] = [0, 1, 2].map(ends);
    assert!(
        (0.0..0.02).contains(&feet) && (1.6..1.8).contains(&crown),
        "{feet} {crown}"
    );
    assert!(
        (left + right).abs() < 0.002 && right > 0.7,
        "{left} {right}"
    );
    assert!(toes > -back, "faces +z");
    // Triangles turn outwards: the volume below them is positive.
    let volume = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|at| body.mean[at as usize]);
        let cross = [
            b[1] * c[2] - b[2] * c[1],
            b[2] * c[0] - b[0] * c[2],
            b[0] * c[1] - b[1] * c[0],
        ];
        (0..3).map(|i| a[i] * cross[i]).sum::<f32>() / 6.0
    };
    let volume: f32 = body.faces.iter().map(volume).sum();
    assert!((0.05..0.1).contains(&volume), "{volume} m³");
}

#[test]
fn it_is_symmetric() {
    let body = Body::people();
    let off = |at: usize| {
        let ([x, y, z], other) = (body.mean[at], body.mean[body.mirror[at] as usize]);
        [other[0] + x, other[1] - y, other[2] - z]
            .map(f32::abs)
            .into_iter()
            .fold(0.0, f32::max)
    };
    let far = (0..body.mean.len()).filter(|at| off(*at) > 0.002).count();
    assert!(
        far * 500 < body.mean.len(),
        "{far} vertices are not symmetric"
    );
    let own = |at: usize| body.mirror[body.mirror[at] as usize] as usize == at;
    let mutual = (0..body.mean.len()).filter(|at| own(*at)).count();
    assert!(mutual * 100 > body.mean.len() * 99, "{mutual}");
    let joints = body.joints_of(&body.mean);
    for (left, right) in RIGHT_OF_LEFT {
        let ([x, y, z], other) = (joints[left], joints[right]);
        let off = [other[0] + x, other[1] - y, other[2] - z];
        assert!(
            x > 0.0 && off.iter().all(|off| off.abs() < 0.005),
            "{left}: {off:?}"
        );
    }
    assert!(joints[HEAD][1] > joints[0][1] && joints[0][1] > joints[10][1] && joints[10][1] > 0.0);
}

#[test]
fn codes_may_be_short_or_long() {
    let body = learned();
    assert_eq!(body.vertices(&[]), body.mean);
    assert_eq!(body.vertices(&[0.5]), body.vertices(&[0.5, 0.0, 0.0, 7.0]));
    assert_ne!(body.vertices(&[0.5]), body.mean);
    assert_eq!(body.colours_of(&[]), body.colour_mean);
    assert_eq!(body.joints_of(&body.mean).len(), JOINTS);
    assert_eq!(body.joints_of(&[]), vec![[0.0; 3]; JOINTS]);
}

#[test]
fn a_file_gives_the_model_back() {
    let body = learned();
    let bytes = body.to_bytes().expect("a file");
    let back = Body::from_bytes(&bytes).expect("reads");
    let near = |a: &[[f32; 3]], b: &[[f32; 3]], off: f32| {
        let pairs = a.as_flattened().iter().zip(b.as_flattened());
        assert!(a.len() == b.len() && pairs.into_iter().all(|(a, b)| (a - b).abs() <= off));
    };
    near(&back.mean, &body.mean, 5.1e-5);
    near(&back.shapes, &body.shapes, 1e-5);
    near(&back.colour_mean, &body.colour_mean, 0.5 / 255.0 + 1e-6);
    near(&back.colours, &body.colours, 0.002);
    assert_eq!(
        (&back.faces, &back.bones, &back.weights),
        (&body.faces, &body.bones, &body.weights)
    );
    assert_eq!(
        (&back.mirror, &back.part, &back.welded),
        (&body.mirror, &body.part, &body.welded)
    );
    assert_eq!(back.joints, body.joints);
    let (_, header) = SafeTensors::read_metadata(&bytes).expect("a header");
    let notes = header.metadata().clone().expect("notes");
    assert!(notes["licence"].contains("Copyright (c) 2022 Tiffany Do"));
}

#[test]
fn damage_is_named() {
    let bytes = learned().to_bytes().expect("a file");
    for end in [0, 7, 100, bytes.len() - 1] {
        assert!(
            matches!(Body::from_bytes(&bytes[..end]), Err(FileError::Format(_))),
            "{end}"
        );
    }
    let fault = |tensor: &str, change: &dyn Fn(&mut Vec<u8>, usize)| {
        let error = Body::from_bytes(&changed(&bytes, tensor, change)).expect_err(tensor);
        assert!(
            error.to_string().starts_with(&format!("{tensor}: ")),
            "{tensor}: {error}"
        );
        error
    };
    // As a float, NaN.
    for tensor in [
        "shape_scales",
        "colour_scales",
        "joint_shares",
        "faces",
        "joint_vertices",
        "bones",
        "mirror",
        "part",
        "welded",
    ] {
        let error = fault(tensor, &|data, _| data.fill(0xff));
        assert!(matches!(error, FileError::Number(_)), "{error}");
    }
    for (tensor, byte) in [("weights", 0xff), ("joint_shares", 0)] {
        let error = fault(tensor, &|data, _| data.fill(byte));
        assert!(matches!(error, FileError::Shares(_)), "{error}");
    }
    for tensor in [
        "shapes_fine",
        "colour_mean",
        "colours",
        "uv",
        "bones",
        "weights",
        "mirror",
        "part",
    ] {
        let error = fault(tensor, &|data, row| data.truncate(data.len() - row));
        assert!(matches!(error, FileError::Shape { .. }), "{error}");
        let error = fault(tensor, &|data, _| data.clear());
        assert!(matches!(error, FileError::Missing(_)), "{error}");
    }
}

#[test]
fn files_of_others_and_of_later_versions_are_refused() {
    let bytes = learned().to_bytes().expect("a file");
    let text = b"\"version\":\"1\"";
    let at = bytes
        .windows(text.len())
        .position(|part| part == text)
        .expect("a version");
    let mut later = bytes.clone();
    later[at + text.len() - 2] = b'2';
    assert!(matches!(Body::from_bytes(&later), Err(FileError::Version(version)) if version == "2"));
    let other =
        safetensors::serialize(Vec::<(String, TensorView<'_>)>::new(), None).expect("a file");
    assert!(matches!(
        Body::from_bytes(&other),
        Err(FileError::Version(_))
    ));
}

#[test]
fn what_a_file_cannot_hold_is_an_error() {
    let mut body = learned();
    body.fingers = Some(ExtraJoints {
        joints: vec![vec![(0, 1.0)]; FINGERS],
        vertices: vec![1, 2],
        bones: vec![[24, 0, 0, 0]; 2],
        weights: vec![[1.0, 0.0, 0.0, 0.0]; 2],
    });
    let read = Body::from_bytes(&body.to_bytes().expect("a file")).expect("reads");
    assert_eq!(read.fingers, body.fingers);
    let refused = |change: &dyn Fn(&mut Body), tensor: &str| {
        let mut other = body.clone();
        change(&mut other);
        let error = other.to_bytes().expect_err(tensor);
        assert!(
            error.to_string().starts_with(&format!("{tensor}: ")),
            "{error}"
        );
    };
    refused(&|body| body.mean[0][0] = f32::NAN, "mean");
    refused(&|body| body.mean[0][0] = 4.0, "mean");
    refused(&|body| body.shapes[0][0] = f32::INFINITY, "shapes");
    refused(&|body| body.uv[0][0] = 1.5, "uv");
    refused(&|body| body.faces[0][0] = 1 << 16, "faces");
    refused(&|body| body.part.truncate(3), "part");
    refused(&|body| body.weights[0] = [0.5, 0.6, 0.0, 0.0], "weights");
    refused(&|body| body.weights[0] = [f32::NAN; 4], "weights");
    refused(&|body| body.joints[0] = vec![(0, 0.5)], "joint_shares");
    let fingers = |change: fn(&mut ExtraJoints)| {
        move |body: &mut Body| body.fingers.as_mut().into_iter().for_each(change)
    };
    refused(&fingers(|it| it.weights[0][0] = 0.5), "finger_weights");
    refused(
        &fingers(|it| it.joints[0][0].1 = 0.5),
        "finger_joint_shares",
    );
    refused(&fingers(|it| it.vertices[0] = 1 << 16), "finger_vertices");
    refused(&fingers(|it| it.bones.truncate(1)), "finger_bones");
    refused(
        &|body| body.joints[0] = vec![(0, 0.01); 100],
        "joint_vertices",
    );
}
