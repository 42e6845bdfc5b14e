//! The fingers that bodies have by the bones of their rig.

use super::read::Topology;
use crate::body::JOINTS;
use crate::extra_joints::{ExtraJoints, FINGERS};
use yoto_formats::Value;

/// A rig's words for the fingers, in the order of SMPL-H.
const WORDS: [&str; 5] = ["Index", "Middle", "Pinky", "Ring", "Thumb"];
/// Wrists and hands of SMPL: what fingers do not move of a hand's vertex, the wrist does.
const HANDS: [u8; 4] = [20, 21, 22, 23];
/// Weight of a joint that counts as none.
const NONE: f32 = 0.5 / 255.0;

/// The bone of each finger's joint, `[30]`, by the names of a rig's bones; `None` if one is missing.
pub(super) fn bones_of_rig(names: &Value) -> Option<Vec<usize>> {
    let names: Vec<&str> = (names.items()?.iter())
        .filter_map(|name| name.text())
        .collect();
    let bone = |joint: usize| {
        let side = ["Left", "Right"][joint / 15];
        let wanted = format!("{side}Hand{}{}", WORDS[joint % 15 / 3], joint % 3 + 1);
        names.iter().position(|name| *name == wanted)
    };
    (0..FINGERS).map(bone).collect()
}

/// The weight of each finger's joint, `[V, 30]`, by the rig's bones and weights `[V, 4]`; `None` if a row has no weight.
pub(super) fn weights_of_rig(
    of: &[usize],
    bones: &[f64],
    weights: &[f64],
) -> Option<Vec<[f32; FINGERS]>> {
    let rows = bones
        .as_chunks::<4>()
        .0
        .iter()
        .zip(weights.as_chunks::<4>().0);
    rows.map(|(bones, weights)| {
        let sum: f64 = weights.iter().sum();
        let mut of_fingers = [0.0; FINGERS];
        for (bone, weight) in bones.iter().zip(weights) {
            if let Some(joint) = of.iter().position(|own| *own as f64 == *bone) {
                of_fingers[joint] += (weight / sum) as f32;
            }
        }
        (sum > 0.0).then_some(of_fingers)
    })
    .collect()
}

/// The fingers of bodies whose vertices have these weights `[V, 30]`, with the regressor of their `joints`.
pub(super) fn of_rig(
    topology: &Topology,
    weights: &[[f32; FINGERS]],
    joints: Vec<Vec<(u32, f32)>>,
) -> ExtraJoints {
    let mut fingers = ExtraJoints {
        joints,
        vertices: Vec::new(),
        bones: Vec::new(),
        weights: Vec::new(),
    };
    for (vertex, own) in weights.iter().enumerate() {
        if own.iter().all(|weight| *weight < NONE) {
            continue;
        }
        let (bones, shares) = mixed(topology.bones[vertex], topology.weights[vertex], own);
        fingers.vertices.push(vertex as u32);
        fingers.bones.push(bones);
        fingers.weights.push(shares);
    }
    fingers
}

/// The four joints that move a vertex most, and their shares: fingers, joints of the body, and the wrist for the rest.
fn mixed(bones: [u8; 4], weights: [f32; 4], fingers: &[f32; FINGERS]) -> ([u8; 4], [f32; 4]) {
    let of_fingers = fingers.iter().enumerate();
    let mut all: Vec<(u8, f32)> = of_fingers
        .map(|(joint, weight)| ((JOINTS + joint) as u8, *weight))
        .chain(
            bones
                .into_iter()
                .zip(weights)
                .filter(|(bone, _)| !HANDS.contains(bone)),
        )
        .filter(|(_, weight)| *weight >= NONE)
        .collect();
    let rest = 1.0 - all.iter().map(|(_, weight)| weight).sum::<f32>();
    let is_left = all
        .iter()
        .any(|(bone, _)| (JOINTS..JOINTS + FINGERS / 2).contains(&usize::from(*bone)));
    if rest >= NONE {
        all.push((if is_left { HANDS[0] } else { HANDS[1] }, rest));
    }
    strongest(all)
}

/// The four joints with the largest weights, and these as shares.
pub(super) fn strongest(mut all: Vec<(u8, f32)>) -> ([u8; 4], [f32; 4]) {
    all.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    all.truncate(4);
    let sum: f32 = all.iter().map(|(_, weight)| weight).sum();
    let at = |i: usize| {
        all.get(i)
            .map_or((0, 0.0), |(bone, weight)| (*bone, weight / sum))
    };
    (
        std::array::from_fn(|i| at(i).0),
        std::array::from_fn(|i| at(i).1),
    )
}
