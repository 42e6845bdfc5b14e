//! Depths of a film's key points, in place of the detector's.

use super::network::Network;
use super::points::{BONES, COUNT, HIPS, mirrored};
use super::window::{INPUTS, Sighting, window};
use crate::markers::Markers;
use crate::problem::{Depth, Direction, Observed, Problem};
use crate::skeleton::parent;
use faer::{Mat, MatRef};
use yoto_capture::skeleton::Vec3;

/// The head's joint.
const HEAD: usize = 15;
/// Range of a bone's standard deviation, metres.
const SPREAD: [f64; 2] = [0.01, 1.0];

/// Gives each frame of `problem` that has points in space the depths that `network` finds, and the depth of each bone.
pub(crate) fn deepen(problem: &mut Problem, network: &Network) {
    let places = problem.markers.places;
    let film: Vec<Sighting> = (problem.frames.iter())
        .map(|frame| sighting(frame, &places))
        .collect();
    let mirror: Vec<Sighting> = film.iter().map(Sighting::mirrored).collect();
    let run = |film: &[Sighting]| {
        let seen = (0..film.len()).flat_map(|at| window(film, at, problem.longer));
        let inputs: Vec<f32> = seen.collect();
        network.run(MatRef::from_row_major_slice(&inputs, film.len(), INPUTS))
    };
    let (straight, mirrored) = (run(&film), run(&mirror));
    let markers = &problem.markers;
    for (at, frame) in problem.frames.iter_mut().enumerate() {
        if !frame.space.is_empty() {
            apply(frame, &found(&straight, &mirrored, at), markers);
        }
    }
}

/// What is found in a frame: the depths of the points, and the standard deviation of each bone's, metres.
struct Found {
    depths: [f64; COUNT],
    spreads: [f64; BONES.len()],
}

/// The mean of what is found in the picture and in its mirror.
fn found(straight: &Mat<f32>, mirror: &Mat<f32>, at: usize) -> Found {
    let depth = |place: usize| {
        let other = mirror[(at, mirrored(place))];
        0.5 * f64::from(straight[(at, place)] + other)
    };
    let depths: [f64; COUNT] = std::array::from_fn(depth);
    let hips = 0.5 * (depths[HIPS[0]] + depths[HIPS[1]]);
    let spread = |bone: usize| {
        let ends = BONES[bone].map(mirrored);
        let same = |other: &[usize; 2]| *other == ends || [other[1], other[0]] == ends;
        let other = BONES.iter().position(same).unwrap_or(bone);
        let logs = straight[(at, COUNT + bone)] + mirror[(at, COUNT + other)];
        (0.5 * f64::from(logs)).exp().clamp(SPREAD[0], SPREAD[1])
    };
    Found {
        depths: depths.map(|depth| depth - hips),
        spreads: std::array::from_fn(spread),
    }
}

fn apply(frame: &mut Observed, found: &Found, markers: &Markers) {
    let before: Vec<Vec3> = frame.space.clone();
    let points = markers.markers.iter().enumerate();
    for (point, marker) in points {
        // A point that the network does not see follows one on the same joint, or on the joint above.
        let place = |of: usize| markers.places.iter().position(|it| *it == Some(of));
        let beside = || {
            let on = |joint: usize| {
                let is_on =
                    |it: &&Option<usize>| it.is_some_and(|at| markers.markers[at].joint == joint);
                markers.places.iter().find(is_on).copied().flatten()
            };
            on(marker.joint).or_else(|| on(parent(marker.joint)))
        };
        if let Some(place) = place(point) {
            frame.space[point][2] = found.depths[place];
        } else if let Some((followed, place)) = beside().and_then(|it| Some((it, place(it)?))) {
            let ahead = before[point][2] - before[followed][2];
            frame.space[point][2] = found.depths[place] + ahead;
        }
    }
    let ends = |bone: usize| {
        let [from, to] = BONES[bone].map(|place| markers.places[place]);
        Some([from?, to?])
    };
    // A detector of hands tells the bones of a hand, and one of faces all bones of a head.
    let close = || frame.directions.iter().filter(|it| it.is_close);
    let is_of_head = |ends: &[usize; 2]| ends.map(|at| markers.markers[at].joint) == [HEAD; 2];
    let has_face = close().any(|it| is_of_head(&it.markers));
    let is_told =
        |ends: &[usize; 2]| (has_face && is_of_head(ends)) || close().any(|it| it.markers == *ends);
    let seen = |marker: &usize| frame.detections.iter().any(|it| it.marker == *marker);
    frame.depths = (0..BONES.len())
        .filter_map(|bone| Some((bone, ends(bone)?)))
        .filter(|(_, ends)| ends.iter().all(seen) && !is_told(ends))
        .map(|(bone, markers)| Depth {
            markers,
            depth: found.depths[BONES[bone][1]] - found.depths[BONES[bone][0]],
            spread: found.spreads[bone],
        })
        .collect();
    let covered = |other: &[usize; 2]| {
        let same = |ends: [usize; 2]| ends == *other || [ends[1], ends[0]] == *other;
        (0..BONES.len()).filter_map(ends).any(same)
    };
    let is_kept = |direction: &Direction| direction.is_close || !covered(&direction.markers);
    frame.directions.retain(is_kept);
}

fn sighting(frame: &Observed, places: &[Option<usize>; COUNT]) -> Sighting {
    let mut points = [[0.0; 4]; COUNT];
    for (point, marker) in points.iter_mut().zip(places) {
        let seen = marker.and_then(|it| frame.detections.iter().find(|seen| seen.marker == it));
        if let Some(seen) = seen {
            let depth = frame.space.get(seen.marker).map_or(0.0, |at| at[2]);
            let [x, y] = seen.pixel;
            *point = [x, y, seen.confidence, depth];
        }
    }
    Sighting {
        time: frame.time,
        points,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lift::network::{LAYERS, Layer};
    use crate::{FitOptions, FrameKeyPoints, KeyPointSet, KeyPoints};

    const WRISTS: [usize; 2] = [7, 8];

    /// A network that finds the wrists `depth` behind all other points, whatever it sees.
    fn constant(depth: f32) -> Network {
        let layer = |(_, inputs, outputs): (&str, usize, usize)| Layer {
            weights: vec![0.0; inputs * outputs],
            biases: vec![0.0; outputs],
        };
        let mut layers: Vec<Layer> = LAYERS.into_iter().map(layer).collect();
        for wrist in WRISTS {
            layers[5].biases[wrist] = depth;
        }
        // Bones are sure to e⁻² metres.
        layers[5].biases[COUNT..].fill(-2.0);
        Network::new(layers).expect("shapes")
    }

    fn problem() -> Problem {
        let set = KeyPointSet::BlazePose33;
        let row = |at: usize| [100.0 + 7.0 * at as f64, 80.0 + 11.0 * at as f64, 0.9];
        let space = |at: usize| [0.01 * at as f64, 0.02 * at as f64, 0.5];
        let frame = |index| FrameKeyPoints {
            index,
            picture: (0..set.points()).map(row).collect(),
            space: (0..set.points()).map(space).collect(),
            ..FrameKeyPoints::default()
        };
        let points = KeyPoints {
            set,
            image_size: [640, 480],
            fps: 15.0,
            frames: (0..3).map(frame).collect(),
        };
        Problem::new(&points, &FitOptions::default())
    }

    #[test]
    fn bones_get_the_depths_that_are_found() {
        let mut problem = problem();
        deepen(&mut problem, &constant(0.3));
        let frame = &problem.frames[1];
        assert_eq!(frame.depths.len(), BONES.len());
        for found in &frame.depths {
            let wanted = match found.markers {
                [13, 15] | [14, 16] => 0.3,
                [15, 19] | [16, 20] => -0.3,
                _ => 0.0,
            };
            assert!((found.depth - wanted).abs() < 1e-6, "{found:?}");
            assert!((found.spread - (-2f64).exp()).abs() < 1e-6, "{found:?}");
        }
        // The wrist itself, and the thumb, which is as far behind it as before.
        assert!((frame.space[15][2] - 0.3).abs() < 1e-6);
        assert!((frame.space[21][2] - 0.3).abs() < 1e-6);
        // Directions that the depths of bones don't replace stay.
        assert!(frame.directions.iter().any(|it| it.markers == [15, 17]));
        assert!(!frame.directions.iter().any(|it| it.markers == [13, 15]));
    }
}
