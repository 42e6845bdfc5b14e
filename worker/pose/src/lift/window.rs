//! What the network sees: the key points of a frame and of the moments around it.

use super::points::{COUNT, HIPS, mirrored};

/// Seconds from the frame, of the moments that the network sees.
pub(crate) const MOMENTS: [f64; 13] = [
    -1.0, -0.6, -0.35, -0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0,
];
/// Index of the frame itself.
pub(crate) const NOW: usize = 6;
/// Numbers per point: x and y from the middle of the hips in extents of the body, confidence, and the detector's depth from the
/// middle of the hips, metres.
const PER_POINT: usize = 4;
/// Numbers per moment: those of the points, the displacement of the hips from the frame itself, and 1 where the film has a frame.
const PER_MOMENT: usize = PER_POINT * COUNT + 3;
/// Numbers that the network sees: those of the moments, then the place of the hips from the picture's middle and the extent, as shares
/// of the picture's longer side.
pub const INPUTS: usize = MOMENTS.len() * PER_MOMENT + 3;
/// The place among the inputs of the depth that the detector tells of the point at `place`, in the frame itself.
pub fn told_depth(place: usize) -> usize {
    NOW * PER_MOMENT + PER_POINT * place + PER_POINT - 1
}

/// Largest gap in a film that is bridged, seconds.
const GAP: f64 = 0.34;
/// Confidence below which a point is not seen.
const LEAST: f64 = 0.1;

/// The points of a frame as a detector sees them.
#[derive(Clone, Debug)]
pub struct Sighting {
    /// Seconds.
    pub time: f64,
    /// x and y in pixels from the picture's middle, confidence, and depth in metres from any origin.
    pub points: [[f64; 4]; COUNT],
}

impl Sighting {
    /// The longer side of the box around the points that are seen, pixels.
    fn extent(&self) -> f64 {
        let side = |axis: usize| {
            let seen = self.points.iter().filter(|point| point[2] >= LEAST);
            let [least, most] = seen.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], point| {
                [a.min(point[axis]), b.max(point[axis])]
            });
            most - least
        };
        side(0).max(side(1))
    }

    /// The middle of the hips: x, y and depth.
    fn hips(&self) -> [f64; 3] {
        let [a, b] = HIPS.map(|place| self.points[place]);
        [0, 1, 3].map(|i| 0.5 * (a[i] + b[i]))
    }

    /// What a mirror shows.
    pub(crate) fn mirrored(&self) -> Self {
        Self {
            time: self.time,
            points: std::array::from_fn(|place| {
                let [x, y, sure, depth] = self.points[mirrored(place)];
                [-x, y, sure, depth]
            }),
        }
    }
}

/// What the network sees around the frame `at` of a film, `[INPUTS]`. `longer` is the pictures' longer side, pixels.
pub fn window(film: &[Sighting], at: usize, longer: f64) -> Vec<f32> {
    let mut inputs = Vec::with_capacity(INPUTS);
    let Some(now) = film.get(at) else {
        inputs.resize(INPUTS, 0.0);
        return inputs;
    };
    let (extent, origin) = (now.extent().max(1.0), now.hips());
    for (moment, after) in MOMENTS.iter().enumerate() {
        let seen = match moment {
            NOW => Some(now.clone()),
            _ => at_time(film, at, now.time + after),
        };
        let Some(seen) = seen else {
            inputs.resize(inputs.len() + PER_MOMENT, 0.0);
            continue;
        };
        let hips = seen.hips();
        for [x, y, sure, depth] in seen.points {
            let point = [
                (x - hips[0]) / extent,
                (y - hips[1]) / extent,
                sure,
                depth - hips[2],
            ];
            let point = if sure < LEAST { [0.0; 4] } else { point };
            inputs.extend(point.map(|value| value as f32));
        }
        let moved = [0, 1].map(|axis| ((hips[axis] - origin[axis]) / extent) as f32);
        inputs.extend([moved[0], moved[1], 1.0]);
    }
    let place = [origin[0], origin[1], extent].map(|value| (value / longer) as f32);
    inputs.extend(place);
    inputs
}

/// The points at `time`, between those of the frames around it; `None` outside of the film and in a long gap.
fn at_time(film: &[Sighting], near: usize, time: f64) -> Option<Sighting> {
    let mut after = near;
    while after > 0 && film[after].time >= time {
        after -= 1;
    }
    while film.get(after)?.time < time {
        after += 1;
    }
    let end = &film[after];
    if end.time - time < 1e-9 {
        return Some(end.clone());
    }
    let start = &film[after.checked_sub(1)?];
    let span = end.time - start.time;
    let share = (time - start.time) / span;
    (span <= GAP).then(|| Sighting {
        time,
        points: std::array::from_fn(|place| {
            let (a, b) = (start.points[place], end.points[place]);
            if a[2] < LEAST || b[2] < LEAST {
                return if share < 0.5 { a } else { b };
            }
            std::array::from_fn(|i| a[i] + share * (b[i] - a[i]))
        }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film() -> Vec<Sighting> {
        let seen = |frame: usize| Sighting {
            time: frame as f64 / 15.0,
            points: std::array::from_fn(|place| {
                let x = place as f64 + frame as f64;
                [x, 2.0 * place as f64, 1.0, 0.01 * x]
            }),
        };
        (0..40).map(seen).collect()
    }

    #[test]
    fn points_between_frames_are_interpolated_and_none_are_beyond_the_film() {
        let film = film();
        let seen = at_time(&film, 20, 20.5 / 15.0).expect("in the film");
        assert!((seen.points[3][0] - 23.5).abs() < 1e-9, "{seen:?}");
        let seen = at_time(&film, 20, 18.0 / 15.0).expect("in the film");
        assert!((seen.points[3][0] - 21.0).abs() < 1e-9, "{seen:?}");
        assert!(at_time(&film, 20, -0.1).is_none());
        assert!(at_time(&film, 20, 3.0).is_none());
    }

    #[test]
    fn a_gap_is_not_bridged() {
        let film: Vec<Sighting> = film()
            .into_iter()
            .filter(|seen| !(0.5..1.0).contains(&seen.time))
            .collect();
        assert!(at_time(&film, 3, 0.7).is_none());
    }

    #[test]
    fn what_is_seen_does_not_depend_on_the_pictures_resolution() {
        let film = film();
        let doubled: Vec<Sighting> = (film.iter())
            .map(|seen| Sighting {
                time: seen.time,
                points: seen.points.map(|[x, y, c, z]| [2.0 * x, 2.0 * y, c, z]),
            })
            .collect();
        let (one, two) = (window(&film, 20, 100.0), window(&doubled, 20, 200.0));
        assert_eq!(one.len(), INPUTS);
        for (a, b) in one.iter().zip(&two) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
    }
}
