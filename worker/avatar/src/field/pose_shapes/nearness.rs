//! The joints that can move the clothes at a place: those whose own bones are near, or that are near themselves. A skirt
//! follows the hip, whose thigh is beside it, and not the knee at the thigh's end.

use rayon::prelude::*;
use yoto_capture::skeleton::{Skeleton, Vec3};
use yoto_ops::exponential::exp_of_negative;
use yoto_ops::form::{Form, Work};

/// Nearness below which a joint counts as far.
const FAR: f32 = 1e-3;
/// Places per task, whose coordinates stay in the first-level cache.
const BLOCK: usize = 512;

/// The joints in the rest pose, and the bones that each rotates.
pub(crate) struct Nearness {
    joints: Vec<[f32; 3]>,
    bones: Vec<Bone>,
    /// Distance at which the nearness is e^(−1/2), metres.
    reach: f32,
}

/// A bone from a joint, which rotates it, to a child.
struct Bone {
    joint: usize,
    from: [f32; 3],
    way: [f32; 3],
}

impl Nearness {
    /// The nearness to a body whose first K joints are at `rest`. At the distance `reach`, metres, the nearness is e^(−1/2).
    pub(crate) fn new(skeleton: &Skeleton, rest: &[Vec3], reach: f32) -> Self {
        let joints: Vec<[f32; 3]> = rest.iter().map(|at| at.map(|v| v as f32)).collect();
        let children = skeleton.parents.iter().take(rest.len()).enumerate();
        let bones = children.filter_map(|(child, parent)| {
            let parent = (*parent)?;
            let (from, to) = (joints[parent], joints[child]);
            Some(Bone {
                joint: parent,
                from,
                way: std::array::from_fn(|a| to[a] - from[a]),
            })
        });
        Self {
            bones: bones.collect(),
            joints,
            reach,
        }
    }

    /// K.
    pub(crate) fn joints(&self) -> usize {
        self.joints.len()
    }

    /// Distance at which the nearness is e^(−1/2), metres.
    pub(crate) fn reach(&self) -> f32 {
        self.reach
    }

    /// aₖ(x) `[N, K]` at `places` `[N, 3]`.
    pub(crate) fn dense(&self, places: &[f32]) -> Vec<f32> {
        let joints = self.joints.len();
        let places = places.as_chunks::<3>().0;
        let mut all = vec![0f32; joints * places.len()];
        let blocks = all.par_chunks_mut(joints * BLOCK);
        blocks.zip(places.par_chunks(BLOCK)).for_each(|(near, at)| {
            Form::best().run(Rows {
                nearness: self,
                at,
                near,
            });
        });
        all
    }
}

/// Fills the nearness `[N, K]` of the places `at`, [`BLOCK`] at most.
struct Rows<'a> {
    nearness: &'a Nearness,
    at: &'a [[f32; 3]],
    near: &'a mut [f32],
}

impl Work for Rows<'_> {
    type Output = ();

    /// exp(−d²/2r²) of the distance to each joint and its bones.
    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let Nearness {
            joints,
            bones,
            reach,
        } = self.nearness;
        let scale = -0.5 / (reach * reach);
        let far = FAR.ln();
        let mut axes = [[0f32; BLOCK]; 3];
        for (i, at) in self.at.iter().enumerate() {
            for (axis, value) in axes.iter_mut().zip(at) {
                axis[i] = *value;
            }
        }
        let [x, y, z] = &axes;
        let mut nearest = [0f32; BLOCK];
        for (k, joint) in joints.iter().enumerate() {
            for i in 0..BLOCK {
                nearest[i] = squared([x[i] - joint[0], y[i] - joint[1], z[i] - joint[2]]);
            }
            for bone in bones.iter().filter(|bone| bone.joint == k) {
                let [a, b, c] = bone.way;
                let shorter = 1.0 / squared(bone.way).max(1e-9);
                for i in 0..BLOCK {
                    let off = [
                        x[i] - bone.from[0],
                        y[i] - bone.from[1],
                        z[i] - bone.from[2],
                    ];
                    let along = ((off[0] * a + off[1] * b + off[2] * c) * shorter).clamp(0.0, 1.0);
                    let off = [off[0] - along * a, off[1] - along * b, off[2] - along * c];
                    nearest[i] = nearest[i].min(squared(off));
                }
            }
            for value in &mut nearest {
                let exponent = scale * *value;
                let nearness = exp_of_negative::<FMA>(exponent);
                *value = if exponent < far { 0.0 } else { nearness };
            }
            let column = self.near[k..].iter_mut().step_by(joints.len());
            column.zip(&nearest).for_each(|(to, from)| *to = *from);
        }
    }
}

#[inline(always)]
fn squared([x, y, z]: [f32; 3]) -> f32 {
    x * x + y * y + z * z
}
