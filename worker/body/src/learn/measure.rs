//! How well a model describes bodies that it was not learned from.

use super::read::Bodies;
use super::symmetry::distance;
use super::{LearnError, triangles};
use crate::body::{Body, JOINTS};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use rayon::prelude::*;
use std::fmt;

/// Numbers of components that are measured.
const COMPONENTS: [usize; 6] = [0, 5, 10, 20, 40, 80];

/// How well a model describes bodies.
#[derive(Clone, Debug)]
pub struct Report {
    /// Number of bodies.
    pub bodies: usize,
    /// Numbers of shape components, with the mean distance of a vertex, and the distance that 95 % are within, mm.
    pub shapes: Vec<(usize, [f64; 2])>,
    /// Numbers of colour components, with the mean difference of a channel and the difference that 95 % are within, in
    /// steps of 255.
    pub colours: Vec<(usize, [f64; 2])>,
    /// Mean distance of each joint from the joint of the bodies' own vertices, `[K]`, mm, with the fingers' joints after SMPL's if the
    /// model has them.
    pub joints: Vec<f64>,
    /// Share of the triangles whose mirror image is a triangle, 0 to 1.
    pub mirrored: f64,
    /// Share of the vertices whose partner's partner they are, 0 to 1.
    pub mutual: f64,
}

impl Body {
    /// Measures the model on the bodies of `identities`, with the best code for each.
    ///
    /// # Errors
    /// If there is no such identity.
    pub fn measure(&self, bodies: &Bodies, identities: &[String]) -> Result<Report, LearnError> {
        let chosen: Vec<usize> = (bodies.of(identities)?.iter().enumerate())
            .filter_map(|(body, chosen)| chosen.then_some(body))
            .collect();
        let shapes = Fit::new(&self.mean, &self.shapes);
        let colours = Fit::new(&self.colour_mean, &self.colours);
        let length = |off: &[f64; 3]| 1e3 * off.iter().map(|off| off * off).sum::<f64>().sqrt();
        let channel = |off: &[f64; 3]| 255.0 * off.iter().map(|off| off.abs()).sum::<f64>() / 3.0;
        let with_fingers = self.with_fingers();
        let regressor = with_fingers.as_ref().unwrap_or(self);
        let mut joints = vec![0.0; regressor.joints.len()];
        for body in &chosen {
            let found = regressor.joints_of(&bodies.vertices[*body]);
            for ((sum, found), truth) in joints.iter_mut().zip(found).zip(&bodies.joints[*body]) {
                *sum += 1e3 * f64::from(distance(found, *truth)) / chosen.len() as f64;
            }
        }
        let own = |(at, partner): &(usize, &u32)| self.mirror[**partner as usize] as usize == *at;
        let mutual = self.mirror.iter().enumerate().filter(own).count();
        Ok(Report {
            bodies: chosen.len(),
            shapes: shapes.errors(&bodies.vertices, &chosen, length),
            colours: colours.errors(&bodies.colours, &chosen, channel),
            joints,
            mirrored: triangles::mirrored_share(&self.faces, &self.welded, &self.mirror),
            mutual: mutual as f64 / self.mirror.len().max(1) as f64,
        })
    }
}

/// Components and what the best code for rows needs.
struct Fit<'a> {
    mean: &'a [[f32; 3]],
    components: Vec<&'a [[f32; 3]]>,
    /// Products of the components, `[C, C]`.
    gram: Mat<f64>,
}

impl<'a> Fit<'a> {
    fn new(mean: &'a [[f32; 3]], components: &'a [[f32; 3]]) -> Self {
        let components: Vec<_> = components.chunks_exact(mean.len().max(1)).collect();
        let c = components.len();
        Self {
            gram: Mat::from_fn(c, c, |r, c| dot(components[r], components[c])),
            mean,
            components,
        }
    }

    /// Mean and 95 % of the rows' errors, for each number of components.
    fn errors(
        &self,
        rows: &[Vec<[f32; 3]>],
        chosen: &[usize],
        size: impl Fn(&[f64; 3]) -> f64 + Sync,
    ) -> Vec<(usize, [f64; 2])> {
        let mut counts: Vec<usize> = COMPONENTS
            .iter()
            .copied()
            .filter(|c| *c < self.components.len())
            .collect();
        counts.push(self.components.len());
        let error = |count: usize| {
            let of_row = |row: &usize| -> Vec<f64> {
                self.rest(&rows[*row], count).iter().map(&size).collect()
            };
            let mut errors: Vec<f64> = chosen.par_iter().flat_map_iter(of_row).collect();
            errors.sort_by(f64::total_cmp);
            let mean = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
            let most = errors.get(errors.len() * 95 / 100).copied().unwrap_or(0.0);
            (count, [mean, most])
        };
        counts.into_iter().map(error).collect()
    }

    /// What the first `count` components leave of a row.
    fn rest(&self, row: &[[f32; 3]], count: usize) -> Vec<[f64; 3]> {
        let off = |(own, mean): (&[f32; 3], &[f32; 3])| -> [f32; 3] {
            std::array::from_fn(|c| own[c] - mean[c])
        };
        let off: Vec<[f32; 3]> = row.iter().zip(self.mean).map(off).collect();
        let mut rest: Vec<[f64; 3]> = off.iter().map(|row| row.map(f64::from)).collect();
        let part = Mat::from_fn(count, count, |r, c| self.gram[(r, c)]);
        let right = Mat::from_fn(count, 1, |r, _| dot(self.components[r], &off));
        let Some(factor) = part.llt(Side::Lower).ok().filter(|_| count > 0) else {
            return rest;
        };
        let code = factor.solve(&right);
        for (k, component) in self.components.iter().take(count).enumerate() {
            for (rest, number) in rest
                .as_flattened_mut()
                .iter_mut()
                .zip(component.as_flattened())
            {
                *rest -= code[(k, 0)] * f64::from(*number);
            }
        }
        rest
    }
}

fn dot(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let products = a.as_flattened().iter().zip(b.as_flattened());
    products.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

impl fmt::Display for Report {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(out, "{} bodies that were left out", self.bodies)?;
        for (count, [mean, most]) in &self.shapes {
            writeln!(
                out,
                "{count:3} shape components: {mean:.2} mm, 95 % within {most:.1} mm"
            )?;
        }
        for (count, [mean, most]) in &self.colours {
            writeln!(
                out,
                "{count:3} colour components: {mean:.1} of 255, 95 % within {most:.0}"
            )?;
        }
        let (body, fingers) = self.joints.split_at(JOINTS.min(self.joints.len()));
        for (name, joints) in [("joints", body), ("fingers", fingers)] {
            let mean = joints.iter().sum::<f64>() / joints.len().max(1) as f64;
            let most = joints.iter().copied().fold(0.0, f64::max);
            if !joints.is_empty() {
                writeln!(out, "{name}: {mean:.1} mm, {most:.1} mm for the worst")?;
            }
        }
        write!(
            out,
            "mirror: {:.1} % of the vertices are mutual, {:.1} % of the triangles have an image",
            100.0 * self.mutual,
            100.0 * self.mirrored
        )
    }
}
