//! The shape of a person in closed form: the posterior of the shape's components, which have a standard normal prior, given bone
//! lengths and outlines.

use super::rest::{RestPose, apply, bones, dot, length, sub};
use crate::Body;
use faer::Mat;
use faer::linalg::solvers::Solve;
use rayon::prelude::*;

/// Standard deviation of a bone's length, metres: joints of other body models are elsewhere in the flesh.
const BONE: f64 = 0.015;
/// Standard deviation of an outline's place, metres, with what clothes, masks and poses add.
const OUTLINE: f64 = 0.01;
/// Outlines that tell as much as one, since neighbours have equal errors.
const ALIKE: f64 = 40.0;
/// Distance from which an outline counts less, metres: hair, bags and wide clothes are outside of the space of shapes.
const FAR: f32 = 0.03;

/// Where a vertex should be along its normal, by the outlines of frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outline {
    /// Index of the vertex.
    pub vertex: usize,
    /// Distance to the outline along the normal, metres.
    pub distance: f32,
    /// In how many frames the vertex is on the outline.
    pub frames: u32,
}

/// Normal equations of the components.
struct Equations {
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl Equations {
    /// Those of the prior.
    fn prior(components: usize) -> Self {
        let mut matrix = vec![0.0; components * components];
        (0..components).for_each(|k| matrix[k * components + k] = 1.0);
        Self {
            matrix,
            right: vec![0.0; components],
        }
    }

    /// Adds h·β = value with the precision `weight`.
    fn add(&mut self, h: &[f64], value: f64, weight: f64) {
        let n = self.right.len();
        for (row, a) in h.iter().enumerate() {
            let scaled = weight * a;
            let own = &mut self.matrix[row * n..(row + 1) * n];
            own.iter_mut().zip(h).for_each(|(m, b)| *m += scaled * b);
            self.right[row] += scaled * value;
        }
    }

    fn merged(mut self, other: &Self) -> Self {
        let add = |to: &mut [f64], from: &[f64]| {
            to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
        };
        add(&mut self.matrix, &other.matrix);
        add(&mut self.right, &other.right);
        self
    }

    fn solved(&self) -> Vec<f32> {
        let n = self.right.len();
        let matrix = Mat::from_fn(n, n, |r, c| self.matrix[r * n + c]);
        let right = Mat::from_fn(n, 1, |r, _| self.right[r]);
        // Positive definite, since the prior is.
        match matrix.llt(faer::Side::Lower) {
            Ok(factor) => {
                let solution = factor.solve(&right);
                (0..n).map(|k| solution[(k, 0)] as f32).collect()
            }
            Err(_) => vec![0.0; n],
        }
    }
}

/// The shape `[C]` of a person with joints `to` `[24]`, near the shape `now`, whose body in the rest pose `rest` has unit `normals`
/// `[V, 3]` and is off by the `outlines`.
pub fn solve(
    body: &Body,
    now: &[f32],
    to: &[[f32; 3]],
    rest: &RestPose,
    normals: &[[f32; 3]],
    outlines: &[Outline],
) -> Vec<f32> {
    let components = now.len();
    let mut equations = Equations::prior(components);
    add_bones(&mut equations, body, now, to, rest.scale());
    let count = body.mean.len();
    let parts = outlines.par_chunks(512).map(|chunk| {
        let mut equations = Equations {
            matrix: vec![0.0; components * components],
            right: vec![0.0; components],
        };
        for outline in chunk {
            let i = outline.vertex;
            let linear = rest.linear(body, i);
            let h: Vec<f64> = (0..components)
                .map(|k| f64::from(dot(normals[i], apply(linear, body.shapes[k * count + i]))))
                .collect();
            let here: f64 = h.iter().zip(now).map(|(h, b)| h * f64::from(*b)).sum();
            let far = f64::from((FAR / outline.distance.abs()).min(1.0));
            let weight = far / (ALIKE * OUTLINE * OUTLINE);
            equations.add(&h, here + f64::from(outline.distance), weight);
        }
        equations
    });
    let parts: Vec<Equations> = parts.collect();
    parts.iter().fold(equations, Equations::merged).solved()
}

/// Adds the lengths of the bones, linear about the present shape: ∂|b|/∂βₖ = b/|b| · ∂b/∂βₖ.
fn add_bones(equations: &mut Equations, body: &Body, now: &[f32], to: &[[f32; 3]], scale: f32) {
    let count = body.mean.len();
    let joints = body.joints_of(&body.vertices(now));
    let moved: Vec<Vec<[f32; 3]>> = (0..now.len())
        .map(|k| body.joints_of(&body.shapes[k * count..(k + 1) * count]))
        .collect();
    for (joint, parent) in bones() {
        let bone = sub(joints[joint], joints[parent]);
        let own = length(bone).max(1e-6);
        let wanted = length(sub(to[joint], to[parent])) / scale;
        let h: Vec<f64> = moved
            .iter()
            .map(|moved| f64::from(dot(bone, sub(moved[joint], moved[parent])) / own))
            .collect();
        let here: f64 = h.iter().zip(now).map(|(h, b)| h * f64::from(*b)).sum();
        equations.add(&h, here + f64::from(wanted - own), 1.0 / (BONE * BONE));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::person::mesh::normals;

    /// The body of a shape, on its own joints.
    fn at_rest(body: &Body, shape: &[f32], joints: &[[f32; 3]]) -> (RestPose, Vec<[f32; 3]>) {
        let vertices = body.vertices(shape);
        let rest = RestPose::new(&body.joints_of(&vertices), joints);
        let vertices = rest.apply(body, &vertices);
        (rest, vertices)
    }

    fn mean_distance(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
        let sum: f32 = a.iter().zip(b).map(|(a, b)| length(sub(*a, *b))).sum();
        sum / a.len() as f32
    }

    #[test]
    fn bones_and_outlines_give_the_shape_of_a_known_body() {
        let body = Body::people();
        let truth = [1.5, -1.0, 0.8, 0.0, -0.7];
        let person = body.vertices(&truth);
        let joints = body.joints_of(&person);
        let mut shape = vec![0.0; 10];
        let mut distances = Vec::new();
        for round in 0..5 {
            let (rest, vertices) = at_rest(body, &shape, &joints);
            distances.push(mean_distance(&vertices, &person));
            let normals = normals(body, &vertices);
            let outlines: Vec<Outline> = (0..vertices.len())
                .step_by(3)
                .map(|vertex| Outline {
                    vertex,
                    distance: dot(normals[vertex], sub(person[vertex], vertices[vertex])),
                    frames: 3,
                })
                .collect();
            let known = if round == 0 { &[][..] } else { &outlines };
            shape = solve(body, &shape, &joints, &rest, &normals, known);
        }
        let last = distances[4];
        assert!(last < 0.5 * distances[0], "{distances:?}");
        assert!(last < 0.003, "{distances:?}");
    }

    #[test]
    fn without_evidence_the_shape_is_the_mean() {
        let body = Body::people();
        let joints = body.joints_of(&body.mean);
        let (rest, vertices) = at_rest(body, &[0.0; 6], &joints);
        let normals = normals(body, &vertices);
        let shape = solve(body, &[0.0; 6], &joints, &rest, &normals, &[]);
        assert!(shape.iter().all(|number| number.abs() < 1e-3), "{shape:?}");
    }
}
