//! How a detector errs, as measured.

use super::normal;
use crate::lift::points::{COUNT, HIPS};
use rand::{Rng, RngExt};
use yoto_capture::skeleton::Vec3;

/// Parts of the body whose errors are drawn separately: trunk and head, arms, legs. Few films are measured, and the network would learn
/// these films' errors by heart.
const PARTS: [&[usize]; 3] = [
    &[0, 1, 2, 3, 4, 11, 12],
    &[5, 6, 7, 8, 9, 10],
    &[13, 14, 15, 16, 17, 18, 19, 20],
];
/// Range of the size of errors, as multiples of those that were measured.
const GAIN: [f64; 2] = [0.3, 1.4];

/// Errors that were measured on films. A random moment of them is drawn for each part of the body, so that errors last as long as in the
/// films, and are as alike between the part's points.
#[derive(Clone, Debug)]
pub struct DetectorErrors {
    /// Depth that is told per depth that is there.
    pub slopes: [f64; COUNT],
    /// Standard deviation of the lean of the body that a detector tells, radians: what the parts' errors have in common.
    pub lean: f64,
    /// Standard deviations of errors that differ from frame to frame: in the picture, extents of the body, and in depth, metres.
    pub noise: [f64; 2],
    /// Frames per second of the films.
    pub fps: f64,
    /// The films.
    pub films: Vec<ErrorFilm>,
}

/// The errors in a film.
#[derive(Clone, Debug)]
pub struct ErrorFilm {
    /// Per frame and point: the error in the picture in extents of the body, x and y, the confidence, and the depth that is told beyond the
    /// slope, metres; `None` for a frame without errors to learn from.
    pub frames: Vec<Option<[[f64; 4]; COUNT]>>,
}

/// Errors of all parts around a moment.
pub(super) struct RandomErrors<'a> {
    errors: &'a DetectorErrors,
    parts: [RandomPart<'a>; PARTS.len()],
    lean: f64,
}

/// A moment in a film of errors.
struct RandomPart<'a> {
    film: &'a ErrorFilm,
    frame: f64,
    /// Frames per second, negative for errors in reverse.
    rate: f64,
    /// Factors of the errors.
    gain: [f64; 4],
}

impl DetectorErrors {
    /// Random errors; `None` without films.
    pub(super) fn draw(&self, random: &mut impl Rng) -> Option<RandomErrors<'_>> {
        let mut part = || {
            let film = self
                .films
                .get(random.random_range(0..self.films.len().max(1)))?;
            let mut sign = || if random.random::<bool>() { 1.0 } else { -1.0 };
            let [across, down, depth, rate] = [sign(), sign(), sign(), sign()];
            let gain = random.random_range(GAIN[0]..GAIN[1]);
            Some(RandomPart {
                frame: random.random_range(0..film.frames.len().max(1)) as f64,
                film,
                rate: rate * self.fps,
                gain: [gain * across, gain * down, 1.0, gain * depth],
            })
        };
        Some(RandomErrors {
            errors: self,
            parts: [part()?, part()?, part()?],
            lean: self.lean * normal(random),
        })
    }
}

impl RandomErrors<'_> {
    /// x and y in pixels from the picture's middle, confidence, and depth in metres, of `points` in the camera's axes, `after` seconds
    /// later; `None` if the detector finds nobody then.
    pub(super) fn detect(
        &self,
        points: [Vec3; COUNT],
        focal: f64,
        after: f64,
        random: &mut impl Rng,
    ) -> Option<[[f64; 4]; COUNT]> {
        let hips: [f64; 3] =
            std::array::from_fn(|axis| 0.5 * (points[HIPS[0]][axis] + points[HIPS[1]][axis]));
        let pixels = points.map(|[x, y, z]| [x, y].map(|at| focal * at / z.max(0.1)));
        let range = |axis: usize| {
            let values = || pixels.iter().map(move |point| point[axis]);
            let least = values().fold(f64::INFINITY, f64::min);
            values().fold(f64::NEG_INFINITY, f64::max) - least
        };
        let extent = range(0).max(range(1));
        let mut seen = [[0.0; 4]; COUNT];
        for (part, places) in self.parts.iter().zip(PARTS) {
            let errors = part.at(after)?;
            for &place in places {
                let [across, down, sure, depth] = errors[place];
                let off =
                    [across, down].map(|by| extent * (by + self.errors.noise[0] * normal(random)));
                let [_, y, z] = points[place];
                let lean = self.lean * (y - hips[1]);
                seen[place] = [
                    pixels[place][0] + off[0],
                    pixels[place][1] + off[1],
                    sure,
                    self.errors.slopes[place] * (z - hips[2])
                        + depth
                        + lean
                        + self.errors.noise[1] * normal(random),
                ];
            }
        }
        Some(seen)
    }
}

impl RandomPart<'_> {
    /// The errors `after` seconds; `None` where there are none.
    fn at(&self, after: f64) -> Option<[[f64; 4]; COUNT]> {
        let last = self.film.frames.len().checked_sub(1)? as f64;
        // Beyond an end, the film goes on backwards.
        let at = (self.frame + after * self.rate).abs();
        let at = (last - (last - at).abs()).clamp(0.0, last);
        let share = at.fract();
        let before = self.film.frames.get(at as usize)?.as_ref()?;
        let next = self.film.frames.get(at.ceil() as usize)?.as_ref()?;
        Some(std::array::from_fn(|place| {
            let (a, b) = (before[place], next[place]);
            std::array::from_fn(|i| self.gain[i] * (a[i] + share * (b[i] - a[i])))
        }))
    }
}
