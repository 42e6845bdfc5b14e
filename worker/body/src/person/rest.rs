//! The body in a person's rest pose: each bone is rotated and stretched from the body's joints to the person's.

use crate::{Body, JOINTS, WITH_FACE, WITH_FINGERS};
use rayon::prelude::*;

/// Length below which a bone has no direction, metres.
const LEAST: f32 = 1e-4;

/// The parents of SMPL's joints, whose order the body has, and of the fingers' and the face's joints after them; a root's is itself.
pub(crate) const PARENTS: [usize; WITH_FACE] = [
    0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21, //
    20, 24, 25, 20, 27, 28, 20, 30, 31, 20, 33, 34, 20, 36, 37, //
    21, 39, 40, 21, 42, 43, 21, 45, 46, 21, 48, 49, 21, 51, 52, //
    15, 15, 15, 15, 15,
];

/// Whether the bone of a joint's parent ends at the joint, of a body with `count` joints. A hand ends at its middle finger, if it has
/// fingers. The head goes on beyond the joints of the face.
fn is_end(joint: usize, count: usize) -> bool {
    let of_wrist = PARENTS[joint] == 20 || PARENTS[joint] == 21;
    let ends_wrist = !of_wrist || count == JOINTS || joint == 27 || joint == 42;
    ends_wrist && joint < WITH_FINGERS
}

/// An affine map of points: `linear` x + `shift`.
#[derive(Clone, Copy, Debug)]
struct Affine {
    linear: [[f32; 3]; 3],
    shift: [f32; 3],
}

/// Maps of the body's bones to those of a person.
#[derive(Clone, Debug)]
pub struct RestPose {
    maps: Vec<Affine>,
    /// The size of the person as a multiple of the body's.
    scale: f32,
}

impl RestPose {
    /// The maps that take bones with joints `from` `[K]` to the person's joints `to` `[K]`, metres, K of SMPL, with
    /// fingers or with a face. Along its
    /// own axis a bone is as long as the person's. Across it, it grows as the sum of SMPL's bones does.
    pub fn new(from: &[[f32; 3]], to: &[[f32; 3]]) -> Self {
        let total = |joints: &[[f32; 3]]| -> f32 {
            bones()
                .map(|(joint, parent)| length(sub(joints[joint], joints[parent])))
                .sum()
        };
        let scale = total(to) / total(from).max(LEAST);
        let mut maps: Vec<Affine> = Vec::with_capacity(from.len());
        for joint in 0..from.len() {
            if joint >= WITH_FINGERS {
                // A face at rest is as the head makes it, wherever its joints are said to be.
                maps.push(maps[PARENTS[joint]]);
                continue;
            }
            let mut children = (1..from.len())
                .map(|child| (child, PARENTS[child]))
                .filter(|(child, parent)| *parent == joint && is_end(*child, from.len()));
            let linear = match (children.next(), children.next()) {
                (Some((child, _)), None) => stretch(
                    sub(from[child], from[joint]),
                    sub(to[child], to[joint]),
                    scale,
                ),
                // Several children, as of pelvis and chest: the bone keeps its direction.
                (Some(_), Some(_)) => times(IDENTITY, scale),
                // A hand, a finger's tip, a foot's tip and the head go on as the bone before them.
                (None, _) => times(maps[PARENTS[joint]].rotation(), scale),
            };
            maps.push(Affine {
                linear,
                shift: sub(to[joint], apply(linear, from[joint])),
            });
        }
        Self { maps, scale }
    }

    /// The size of the person as a multiple of the body's.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// `vertices` `[V, 3]` of the body in the person's rest pose: Σ wₖ (Aₖ x + tₖ).
    pub fn apply(&self, body: &Body, vertices: &[[f32; 3]]) -> Vec<[f32; 3]> {
        vertices
            .par_iter()
            .enumerate()
            .map(|(i, x)| {
                let map = self.blend(body, i);
                let moved = apply(map.linear, *x);
                std::array::from_fn(|a| moved[a] + map.shift[a])
            })
            .collect()
    }

    /// The linear part of the map of vertex `i`.
    pub(crate) fn linear(&self, body: &Body, i: usize) -> [[f32; 3]; 3] {
        self.blend(body, i).linear
    }

    fn blend(&self, body: &Body, i: usize) -> Affine {
        let mut sum = Affine {
            linear: [[0.0; 3]; 3],
            shift: [0.0; 3],
        };
        for (bone, weight) in body.bones[i].iter().zip(body.weights[i]) {
            let map = &self.maps[usize::from(*bone)];
            for r in 0..3 {
                for c in 0..3 {
                    sum.linear[r][c] += weight * map.linear[r][c];
                }
                sum.shift[r] += weight * map.shift[r];
            }
        }
        sum
    }
}

impl Affine {
    /// The rotation nearest to the linear part of a bone, whose stretch is along and across one axis: its columns, orthonormal
    /// again.
    fn rotation(&self) -> [[f32; 3]; 3] {
        let column = |c: usize| -> [f32; 3] { std::array::from_fn(|r| self.linear[r][c]) };
        let x = unit(column(0));
        let y = column(1);
        let along: f32 = dot(x, y);
        let y = unit(std::array::from_fn(|a| y[a] - along * x[a]));
        let z = cross(x, y);
        std::array::from_fn(|r| [x[r], y[r], z[r]])
    }
}

/// SMPL's joints with their parents, without the root.
pub(crate) fn bones() -> impl Iterator<Item = (usize, usize)> {
    PARENTS.into_iter().enumerate().take(JOINTS).skip(1)
}

const IDENTITY: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The rotation from the direction of `from` to that of `to`, after a stretch by their lengths' ratio along `from` and by `across`
/// perpendicular to it.
fn stretch(from: [f32; 3], to: [f32; 3], across: f32) -> [[f32; 3]; 3] {
    if length(from) < LEAST || length(to) < LEAST {
        return times(IDENTITY, across);
    }
    let (a, b) = (unit(from), unit(to));
    let along = length(to) / length(from);
    // Q (across I + (along − across) a aᵀ), and Q a = b.
    let rotation = times(rotation(a, b), across);
    std::array::from_fn(|r| {
        std::array::from_fn(|c| rotation[r][c] + (along - across) * b[r] * a[c])
    })
}

/// The shortest rotation of the unit vector `a` to the unit vector `b`: I + V + V² / (1 + a·b), where V x = (a × b) × x.
fn rotation(a: [f32; 3], b: [f32; 3]) -> [[f32; 3]; 3] {
    let cosine = dot(a, b);
    if cosine < -0.999 {
        // Opposite bones: any half turn across them.
        let helper = if a[0].abs() < 0.7 {
            [1.0, 0.0, 0.0]
        } else {
            [0.0, 1.0, 0.0]
        };
        let axis = unit(cross(a, helper));
        return std::array::from_fn(|r| {
            std::array::from_fn(|c| 2.0 * axis[r] * axis[c] - IDENTITY[r][c])
        });
    }
    let [x, y, z] = cross(a, b);
    let v = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            let square: f32 = (0..3).map(|k| v[r][k] * v[k][c]).sum();
            IDENTITY[r][c] + v[r][c] + square / (1.0 + cosine)
        })
    })
}

fn times(matrix: [[f32; 3]; 3], by: f32) -> [[f32; 3]; 3] {
    matrix.map(|row| row.map(|v| v * by))
}

pub(crate) fn apply(matrix: [[f32; 3]; 3], x: [f32; 3]) -> [f32; 3] {
    matrix.map(|row| dot(row, x))
}

pub(crate) fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

pub(crate) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub(crate) fn length(a: [f32; 3]) -> f32 {
    dot(a, a).sqrt()
}

pub(crate) fn unit(a: [f32; 3]) -> [f32; 3] {
    let length = length(a).max(1e-12);
    a.map(|v| v / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bone_goes_to_the_persons_and_flesh_grows_across_it() {
        let (from, to) = ([0.0, -0.4, 0.0], [0.3, -0.3, 0.1]);
        let map = stretch(from, to, 1.5);
        let moved = apply(map, from);
        for a in 0..3 {
            assert!((moved[a] - to[a]).abs() < 1e-5, "{moved:?}");
        }
        let flesh = apply(map, [0.1, 0.0, 0.0]);
        assert!((length(flesh) - 0.15).abs() < 1e-5);
        assert!(dot(flesh, to).abs() < 1e-5);
        let back = apply(
            stretch([0.0, 1.0, 0.0], [0.0, -2.0, 0.0], 1.0),
            [0.0, 1.0, 0.0],
        );
        assert!((back[1] + 2.0).abs() < 1e-5);
    }

    #[test]
    fn joints_of_the_mean_body_go_to_the_persons_joints() {
        let body = Body::people();
        let from = body.joints_of(&body.mean);
        let mut to: Vec<[f32; 3]> = from.iter().map(|at| at.map(|v| 1.1 * v)).collect();
        for joint in [18, 20, 22] {
            to[joint][1] -= 0.1;
        }
        let rest = RestPose::new(&from, &to);
        for (joint, (map, from)) in rest.maps.iter().zip(&from).enumerate() {
            let moved = apply(map.linear, *from);
            for a in 0..3 {
                assert!((moved[a] + map.shift[a] - to[joint][a]).abs() < 1e-4);
            }
        }
        assert!((1.0..1.2).contains(&rest.scale()));
    }
}
