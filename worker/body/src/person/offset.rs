//! A person's offset from the body along its normals: what outlines tell and the space of shapes lacks, smooth on the surface, and 0
//! far from all outlines.

use super::mesh::neighbours;
use super::shape::Outline;
use crate::{Body, JOINTS, is_of_face};

/// Weight of the difference to each neighbour, in outlines.
const SMOOTH: f32 = 4.0;
/// Weight of the body itself, in outlines.
const BODY: f32 = 0.02;
/// Rounds of relaxation: an outline tells about the surface for as many edges.
const ROUNDS: usize = 150;
/// Over-relaxation.
const FASTER: f32 = 1.6;
/// Times that outlines are weighed again by how far they are from the surface, and the distance from which they count less, metres:
/// an outline of another part of the body is not this one's.
const WEIGHED: usize = 3;
const FAR: f32 = 0.012;
/// Largest offsets outward, metres: of joints whose flesh is well known or whose clothes hang free, and that of all others.
const LIMITS: [(u8, f32); 12] = [
    (1, 0.05),
    (2, 0.05),
    (4, 0.05),
    (5, 0.05),
    (7, 0.03),
    (8, 0.03),
    (10, 0.02),
    (11, 0.02),
    (20, 0.015),
    (21, 0.015),
    (22, 0.008),
    (23, 0.008),
];
const MOST: f32 = 0.10;
/// That of fingers.
const FINGER: f32 = 0.008;

/// Offsets `[V]`, metres, that minimise Σᵢ cᵢ (hᵢ − dᵢ)² + λ Σ (hᵢ − hⱼ)² + ε Σ hᵢ², over vertices i with outlines at dᵢ, and
/// neighbours i and j.
pub fn offsets(body: &Body, outlines: &[Outline]) -> Vec<f32> {
    let neighbours = neighbours(body);
    let limits: Vec<f32> = (0..neighbours.len()).map(|i| limit(body, i)).collect();
    let within = outlines
        .iter()
        .filter(|it| it.distance <= limits[it.vertex]);
    let within: Vec<&Outline> = within.collect();
    let mut heights = vec![0f32; neighbours.len()];
    for round in 0..WEIGHED {
        let mut seen = vec![[0f32; 2]; neighbours.len()];
        for outline in &within {
            let first = body.welded[outline.vertex] as usize;
            let off = outline.distance - heights[first];
            // Geman and McClure's weight.
            let like = match round {
                0 => 1.0,
                _ => (FAR * FAR / (FAR * FAR + off * off)).powi(2),
            };
            let weight = like * (outline.frames as f32).min(4.0);
            seen[first][0] += weight;
            seen[first][1] += weight * outline.distance;
        }
        relax(&neighbours, &seen, &mut heights);
    }
    let heights = body.welded.iter().map(|first| heights[*first as usize]);
    heights.zip(limits).map(|(it, most)| it.min(most)).collect()
}

/// Moves `heights` `[V]` towards the minimum, for `seen` `[V]`: the weight of outlines, and the weighted sum of their distances.
fn relax(neighbours: &[Vec<u32>], seen: &[[f32; 2]], heights: &mut [f32]) {
    for _ in 0..ROUNDS {
        for (i, own) in neighbours.iter().enumerate() {
            if own.is_empty() {
                continue;
            }
            let [weight, sum] = seen[i];
            let around: f32 = own.iter().map(|j| heights[*j as usize]).sum();
            let best = (sum + SMOOTH * around) / (weight + SMOOTH * own.len() as f32 + BODY);
            heights[i] += FASTER * (best - heights[i]);
        }
    }
}

/// The largest offset of a vertex outward: the mean of its bones'.
fn limit(body: &Body, vertex: usize) -> f32 {
    let bones = body.bones[vertex].iter().zip(body.weights[vertex]);
    bones
        .map(|(bone, weight)| {
            let own = LIMITS.iter().find(|(joint, _)| joint == bone);
            let other = match usize::from(*bone) < JOINTS || is_of_face(*bone) {
                true => MOST,
                false => FINGER,
            };
            weight * own.map_or(other, |(_, most)| *most)
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_follow_outlines_and_leave_the_rest_of_the_body() {
        let body = Body::people();
        // A wide jacket at the breast, and one outline of something else.
        let trunk = |i: &usize| {
            let [x, y, _] = body.mean[*i];
            x.abs() < 0.12 && (1.1..1.3).contains(&y)
        };
        let mut outlines: Vec<Outline> = (0..body.mean.len())
            .filter(trunk)
            .map(|vertex| Outline {
                vertex,
                distance: 0.03,
                frames: 5,
            })
            .collect();
        let stray = outlines.len() / 2;
        outlines[stray].distance = 0.09;
        let heights = offsets(body, &outlines);
        for outline in &outlines {
            let height = heights[outline.vertex];
            assert!((height - 0.03).abs() < 0.012, "{height}");
        }
        let feet = (0..body.mean.len()).filter(|i| body.mean[*i][1] < 0.1);
        feet.for_each(|i| assert!(heights[i].abs() < 5e-3, "{}", heights[i]));
    }

    #[test]
    fn a_hand_has_no_clothes() {
        let body = Body::people();
        let hand = |i: &usize| body.bones[*i][0] == 22 && body.weights[*i][0] > 0.99;
        let outlines: Vec<Outline> = (0..body.mean.len())
            .filter(hand)
            .map(|vertex| Outline {
                vertex,
                distance: 0.05,
                frames: 5,
            })
            .collect();
        assert!(!outlines.is_empty());
        let heights = offsets(body, &outlines);
        assert!(heights.iter().all(|height| *height <= 0.008 + 1e-6));
    }
}
