//! The joints of a face, and what they move, by where the eyes are: the rig of the bodies has no jaw and no eyelids.
//!
//! Lengths are multiples of the distance of the eyes' middles, measured on the mean of the bodies (docs/research/body.md, "Faces").

use super::fingers::strongest;
use super::read::Topology;
use crate::extra_joints::{ExtraJoints, FACE, WITH_FINGERS};
use crate::file::MOST_SHARES;

/// The jaw's axis from the middle between the eyes, up and forward, and half of its length: the joints before the ears.
const HINGE: [f32; 2] = [-0.46, -0.99];
const HALF_HINGE: f32 = 1.08;
/// Height of the line between the lips from the eyes, and half of its length.
const LIPS: f32 = -1.125;
const HALF_LIPS: f32 = 0.375;
/// How far forward of the jaw's axis its weight begins and is full.
const JAW_FROM: [f32; 2] = [0.3, 1.05];
/// How far below the eyes the jaw's weight begins to fall, and where it is 0: under the chin, and above the chest.
const THROAT: [f32; 2] = [1.95, 2.2];
/// Width of the step from upper to lower lip, and how much wider it is per distance from the corners of the mouth: cheeks stretch.
const STEP: f32 = 0.016;
const WIDER: f32 = 0.55;
/// Distance from the middle at which lips begin to part less, and that of the corners, and distance below the lips down to which they do.
const CORNERS: [f32; 2] = [0.15, HALF_LIPS];
const CHIN: f32 = 0.35;
/// Distance from the lips' line within which the direction that a vertex faces tells its lip, since lips touch.
const TOUCH: f32 = 0.05;
/// Distance from an eye's front to its middle.
const RADIUS: f32 = 0.25;
/// Angle above the eye's axis of the upper eyelid's edge and of its upper end, radians, and the lowest vertex that counts.
const LID: [f32; 2] = [0.25, 0.6];
const LOWEST: f32 = -0.05;
/// Half of the eyelid's width at which its weight begins to fall, and where it is 0: lids meet in the corners.
const LID_WIDTH: [f32; 2] = [0.13, 0.25];
/// Weight that counts as none.
const NONE: f32 = 0.5 / 255.0;

/// The face of bodies with these mean vertices; `None` if they have no eyes. A welded vertex counts once.
pub(super) fn of(topology: &Topology, mean: &[[f32; 3]], welded: &[u32]) -> Option<ExtraJoints> {
    let face = Face::of(topology, mean)?;
    let normals = normals(&topology.faces, mean, welded);
    let [left, right] = [1, 2].map(|eye| shares(&rear(&all(topology, eye), mean)));
    let hinge = face.hinge(mean, welded);
    let mut extra = ExtraJoints {
        joints: vec![hinge, left.clone(), right.clone(), left, right],
        vertices: Vec::new(),
        bones: Vec::new(),
        weights: Vec::new(),
    };
    for (vertex, at) in mean.iter().enumerate() {
        let of_face = match topology.part[vertex] {
            0 => face.skin(*at, normals[welded[vertex] as usize]),
            eye => std::array::from_fn(|joint| f32::from(u8::from(joint == usize::from(eye)))),
        };
        if of_face.iter().all(|weight| *weight < NONE) {
            continue;
        }
        let (bones, weights) = mixed(topology.bones[vertex], topology.weights[vertex], &of_face);
        extra.vertices.push(vertex as u32);
        extra.bones.push(bones);
        extra.weights.push(weights);
    }
    Some(extra)
}

/// Where the face is.
struct Face {
    /// Middles of the left and the right eye, of which only the front is a surface, metres.
    eyes: [[f32; 3]; 2],
    /// Distance of the eyes, metres.
    unit: f32,
}

impl Face {
    fn of(topology: &Topology, mean: &[[f32; 3]]) -> Option<Self> {
        let eye = |eye: u8| -> Option<[f32; 3]> {
            let own = all(topology, eye);
            let sum = own.iter().fold([0.0; 3], |sum: [f32; 3], at| {
                std::array::from_fn(|a| sum[a] + mean[*at as usize][a] / own.len() as f32)
            });
            let front = own.iter().map(|at| mean[*at as usize][2]);
            (!own.is_empty()).then(|| [sum[0], sum[1], front.fold(f32::NEG_INFINITY, f32::max)])
        };
        let [left, right] = [eye(1)?, eye(2)?];
        let unit = left[0] - right[0];
        let middle = |[x, y, z]: [f32; 3]| [x, y, z - RADIUS * unit];
        (unit > 0.0).then(|| Self {
            eyes: [left, right].map(middle),
            unit,
        })
    }

    /// A point from the middle between the eyes' fronts, in distances of the eyes.
    fn relative(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let [left, right] = self.eyes;
        let middle = [0, 1, 2].map(|a| 0.5 * (left[a] + right[a]));
        let front = middle[2] + RADIUS * self.unit;
        [
            (x - middle[0]) / self.unit,
            (y - middle[1]) / self.unit,
            (z - front) / self.unit,
        ]
    }

    /// Vertices around both ends of the jaw's axis, with equal shares.
    fn hinge(&self, mean: &[[f32; 3]], welded: &[u32]) -> Vec<(u32, f32)> {
        let [up, forward] = HINGE;
        let mut chosen = Vec::new();
        for end in [HALF_HINGE, -HALF_HINGE] {
            let off = |vertex: u32| {
                let [x, y, z] = self.relative(mean[vertex as usize]);
                (x - end).powi(2) + (y - up).powi(2) + (z - forward).powi(2)
            };
            let mut near: Vec<u32> = (0..mean.len() as u32)
                .filter(|at| welded[*at as usize] == *at)
                .collect();
            near.sort_by(|a, b| off(*a).total_cmp(&off(*b)));
            near.truncate(MOST_SHARES / 2);
            chosen.extend(near);
        }
        shares(&chosen)
    }

    /// The weights of jaw, eyes and eyelids of a vertex of the skin that faces `normal`.
    fn skin(&self, at: [f32; 3], normal: [f32; 3]) -> [f32; FACE] {
        let mut weights = [0.0; FACE];
        weights[0] = self.jaw(at, normal);
        for (side, eye) in self.eyes.iter().enumerate() {
            let [x, y, z] = [0, 1, 2].map(|a| (at[a] - eye[a]) / self.unit);
            let above = y.atan2(z);
            if z > 0.0 && above > LOWEST && y.hypot(z) < 2.0 * RADIUS {
                let high = 1.0 - smooth_step(LID, above);
                weights[3 + side] = high * (1.0 - smooth_step(LID_WIDTH, x.abs()));
            }
        }
        weights
    }

    /// The weight of the jaw: what is forward of its axis and below the plane through the axis and the corners of the mouth, level between
    /// the lips.
    fn jaw(&self, at: [f32; 3], normal: [f32; 3]) -> f32 {
        let [x, y, z] = self.relative(at);
        let forward = z - HINGE[1];
        let depth = -HINGE[1];
        let height = HINGE[0] + (LIPS - HINGE[0]) * (forward / depth).clamp(0.0, 1.0);
        let beside = (x.abs() - HALF_LIPS)
            .max(0.0)
            .hypot((depth - forward - 0.3).max(0.0));
        let mut below = height - y;
        if beside == 0.0 && below.abs() < TOUCH {
            below = TOUCH * normal[1];
        }
        let step = STEP + WIDER * beside;
        // Lips part less towards the corners, down to half as far.
        let corner = 0.5 * smooth_step(CORNERS, x.abs()) * (1.0 - smooth_step([0.0, CHIN], below));
        smooth_step([-step, step], below)
            * smooth_step(JAW_FROM, forward)
            * (1.0 - corner)
            * (1.0 - smooth_step(THROAT, -y))
    }
}

/// 0 up to the first number, 1 from the second, and smooth between them.
fn smooth_step([from, to]: [f32; 2], at: f32) -> f32 {
    let share = ((at - from) / (to - from)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}

/// The vertices of a part.
fn all(topology: &Topology, part: u8) -> Vec<u32> {
    let own = (0..).zip(&topology.part).filter(|(_, own)| **own == part);
    own.map(|(at, _)| at).collect()
}

/// The rear half of an eye's vertices, whose mean is about the eye's middle: the back of an eye has no surface.
fn rear(eye: &[u32], mean: &[[f32; 3]]) -> Vec<u32> {
    let mut sorted = eye.to_vec();
    sorted.sort_by(|a, b| mean[*a as usize][2].total_cmp(&mean[*b as usize][2]));
    sorted.truncate(eye.len() / 2);
    sorted
}

/// Equal shares of vertices, as many as a regressor can have, from the whole of them.
fn shares(vertices: &[u32]) -> Vec<(u32, f32)> {
    let count = vertices.len().min(MOST_SHARES);
    let chosen = (0..count).map(|i| vertices[i * vertices.len() / count]);
    chosen.map(|at| (at, 1.0 / count as f32)).collect()
}

/// Unit normals of the welded vertices, `[V]`.
fn normals(faces: &[[u32; 3]], mean: &[[f32; 3]], welded: &[u32]) -> Vec<[f32; 3]> {
    let mut normals = vec![[0f32; 3]; mean.len()];
    for face in faces {
        let [a, b, c] = face.map(|at| mean[at as usize]);
        let (u, v) = (
            [0, 1, 2].map(|i| b[i] - a[i]),
            [0, 1, 2].map(|i| c[i] - a[i]),
        );
        let normal = [0, 1, 2].map(|i: usize| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            u[j] * v[k] - u[k] * v[j]
        });
        for at in face {
            let sum = &mut normals[welded[*at as usize] as usize];
            sum.iter_mut()
                .zip(normal)
                .for_each(|(sum, own)| *sum += own);
        }
    }
    for normal in &mut normals {
        let length = normal.iter().map(|v| v * v).sum::<f32>().sqrt();
        *normal = normal.map(|v| v / length.max(f32::MIN_POSITIVE));
    }
    normals
}

/// The four joints that move a vertex most, and their shares: those of the face, and those of the body for the rest. What an eye moves has
/// no other joint.
fn mixed(bones: [u8; 4], weights: [f32; 4], face: &[f32; FACE]) -> ([u8; 4], [f32; 4]) {
    let of_face: f32 = face.iter().sum();
    let own = bones.into_iter().zip(weights).filter(|it| it.1 > 0.0);
    let all = (0..)
        .zip(face)
        .map(|(joint, weight)| ((WITH_FINGERS + joint) as u8, *weight))
        .chain(own.map(|(bone, weight)| (bone, (1.0 - of_face).max(0.0) * weight)))
        .filter(|(_, weight)| *weight >= NONE)
        .collect();
    strongest(all)
}
