//! Partners on the other side by the triangles between them: where clothes or a parting are not symmetric, the nearest
//! vertex is not the partner, but the mesh tells it.

use std::collections::HashMap;

/// Rounds, after which the partners are taken as they are.
const ROUNDS: usize = 30;

/// The vertices opposite of a directed edge, in its triangles.
type Opposite = HashMap<(u32, u32), Vec<u32>>;

/// Corrects the partners of welded vertices. Afterwards all partners are mutual, and some vertices may have none.
pub(super) fn refine(faces: &[[u32; 3]], welded: &[u32], partner: &mut [Option<u32>]) {
    let faces: Vec<[u32; 3]> = (faces.iter())
        .map(|face| face.map(|at| welded[at as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    let opposite = opposite(&faces);
    for _ in 0..ROUNDS {
        let wanted = wanted(&faces, &opposite, partner);
        let mut changed = false;
        for at in 0..partner.len() {
            let (own, other) = (at as u32, wanted[at]);
            let mutual = other.is_some_and(|other| wanted[other as usize] == Some(own));
            if !mutual || partner[at] == other {
                continue;
            }
            let Some(other) = other else { continue };
            // Those who are left alone.
            for left in [partner[at], partner[other as usize]].into_iter().flatten() {
                partner[left as usize] = None;
            }
            partner[at] = Some(other);
            partner[other as usize] = Some(own);
            changed = true;
        }
        if !changed {
            break;
        }
    }
}

fn opposite(faces: &[[u32; 3]]) -> Opposite {
    let mut opposite = Opposite::new();
    for [a, b, c] in faces {
        for (from, to, third) in [(a, b, c), (b, c, a), (c, a, b)] {
            opposite.entry((*from, *to)).or_default().push(*third);
        }
    }
    opposite
}

/// The partner that most triangles of each vertex want; its own where they want nobody more.
///
/// The mirror image of a triangle a b c turns the other way round, so the partner of c is opposite of the edge from b's
/// partner to a's.
fn wanted(faces: &[[u32; 3]], opposite: &Opposite, partner: &[Option<u32>]) -> Vec<Option<u32>> {
    let mut votes: Vec<Vec<(u32, u32)>> = vec![Vec::new(); partner.len()];
    for [a, b, c] in faces {
        for (from, to, third) in [(a, b, c), (b, c, a), (c, a, b)] {
            let (Some(from), Some(to)) = (partner[*from as usize], partner[*to as usize]) else {
                continue;
            };
            for candidate in opposite.get(&(to, from)).into_iter().flatten() {
                let votes = &mut votes[*third as usize];
                match votes.iter_mut().find(|(other, _)| other == candidate) {
                    Some((_, count)) => *count += 1,
                    None => votes.push((*candidate, 1)),
                }
            }
        }
    }
    let best = |(votes, own): (&Vec<(u32, u32)>, &Option<u32>)| {
        let held = votes.iter().find(|(other, _)| Some(*other) == *own);
        let held = held.map_or(0, |(_, count)| *count);
        let most = votes
            .iter()
            .copied()
            .max_by_key(|(other, count)| (*count, std::cmp::Reverse(*other)));
        most.filter(|(_, count)| *count > held.max(1))
            .map(|(other, _)| other)
            .or(*own)
    };
    votes.iter().zip(partner).map(best).collect()
}

/// Share of the triangles whose mirror image is a triangle, 0 to 1.
pub(super) fn mirrored_share(faces: &[[u32; 3]], welded: &[u32], mirror: &[u32]) -> f64 {
    let place = |at: u32| welded[at as usize];
    let welded_faces: Vec<[u32; 3]> = faces.iter().map(|face| face.map(place)).collect();
    let opposite = opposite(&welded_faces);
    let is_mirrored = |face: &&[u32; 3]| {
        let [a, b, c] = face.map(|at| place(mirror[at as usize]));
        opposite
            .get(&(b, a))
            .is_some_and(|thirds| thirds.contains(&c))
    };
    faces.iter().filter(is_mirrored).count() as f64 / faces.len().max(1) as f64
}
