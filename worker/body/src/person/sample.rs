//! Points spread evenly over a body's surface.

use super::mesh::areas;
use crate::Body;

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Index of the face.
    pub face: usize,
    /// Shares of the face's vertices, which sum to 1.
    pub shares: [f32; 3],
}

/// Fractions that are spread evenly over a square: multiples of the inverse plastic number and its square (Roberts 2018, the R2
/// sequence).
const EVENLY: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// `count` points, each with an equal share of the area of the faces that are `wanted` `[F]`, in the order of the faces. Empty if these have
/// no area.
pub fn spread(
    body: &Body,
    vertices: &[[f32; 3]],
    wanted: impl Fn(usize) -> bool,
    count: usize,
) -> Vec<SurfacePoint> {
    let areas = areas(body, vertices);
    let total: f64 = areas
        .iter()
        .enumerate()
        .filter(|(face, _)| wanted(*face))
        .map(|(_, area)| f64::from(*area))
        .sum();
    let mut points = Vec::with_capacity(count);
    if total <= 0.0 {
        return points;
    }
    let each = total / count as f64;
    let mut before = 0.0;
    for (face, area) in areas.iter().enumerate().filter(|(face, _)| wanted(*face)) {
        before += f64::from(*area);
        while points.len() < count && (points.len() as f64 + 0.5) * each <= before {
            let [u, v] = EVENLY.map(|step| (0.5 + step * points.len() as f64).fract() as f32);
            // The half of the square beyond the diagonal is turned onto the other.
            let [u, v] = if u + v > 1.0 {
                [1.0 - u, 1.0 - v]
            } else {
                [u, v]
            };
            points.push(SurfacePoint {
                face,
                shares: [1.0 - u - v, u, v],
            });
        }
    }
    points
}

impl SurfacePoint {
    /// The mean of the face's `values` `[V, 3]`.
    pub fn of(&self, body: &Body, values: &[[f32; 3]]) -> [f32; 3] {
        let corners = body.faces[self.face].map(|vertex| values[vertex as usize]);
        std::array::from_fn(|a| (0..3).map(|c| self.shares[c] * corners[c][a]).sum())
    }

    /// The bones that move it, most first, and their weights, which sum to 1.
    pub fn skinning(&self, body: &Body) -> [(u8, f32); 4] {
        let corners = body.faces[self.face].iter().zip(self.shares);
        strongest(corners.flat_map(|(vertex, share)| {
            let vertex = *vertex as usize;
            let own = body.bones[vertex].iter().zip(body.weights[vertex]);
            own.map(move |(bone, weight)| (*bone, share * weight))
        }))
    }
}

/// The four bones with most weight of `weights`, in which bones may repeat, and their weights, which sum to 1.
pub fn strongest(weights: impl Iterator<Item = (u8, f32)>) -> [(u8, f32); 4] {
    let mut sums: Vec<(u8, f32)> = Vec::with_capacity(8);
    for (bone, weight) in weights {
        match sums.iter_mut().find(|(known, _)| *known == bone) {
            Some((_, sum)) => *sum += weight,
            None => sums.push((bone, weight)),
        }
    }
    sums.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    sums.truncate(4);
    let total: f32 = sums.iter().map(|(_, weight)| weight).sum();
    std::array::from_fn(|i| match sums.get(i) {
        Some((bone, weight)) if total > 0.0 => (*bone, weight / total),
        _ => (0, 0.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_spread_by_area() {
        let body = Body::people();
        let points = spread(body, &body.mean, |_| true, 5_000);
        assert_eq!(points.len(), 5_000);
        let areas = areas(body, &body.mean);
        let total: f32 = areas.iter().sum();
        let (low, high): (Vec<_>, Vec<_>) =
            (points.iter().map(|it| it.of(body, &body.mean))).partition(|at| at[1] < 0.8);
        let below: f32 = (body.faces.iter().zip(&areas))
            .filter(|(face, _)| {
                face.iter().map(|v| body.mean[*v as usize][1]).sum::<f32>() < 3.0 * 0.8
            })
            .map(|(_, area)| area)
            .sum();
        let share = low.len() as f32 / (low.len() + high.len()) as f32;
        assert!((share - below / total).abs() < 0.01, "{share}");
        for point in &points {
            assert!(point.shares.iter().all(|share| *share >= 0.0));
            let sum: f32 = point.skinning(body).iter().map(|(_, weight)| weight).sum();
            assert!((sum - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn the_strongest_bones_remain() {
        let all = [(3, 0.1), (1, 0.3), (3, 0.3), (2, 0.2), (7, 0.06), (9, 0.04)];
        let kept = strongest(all.into_iter());
        assert_eq!(kept.map(|(bone, _)| bone), [3, 1, 2, 7]);
        assert!((kept.iter().map(|(_, weight)| weight).sum::<f32>() - 1.0).abs() < 1e-6);
    }
}
