//! Examples to learn from: people who move as somebody did, seen by a random camera and by a detector that errs as measured.

mod camera;
mod detector;
mod motion;

use super::points::{BLAZE, COUNT, HIPS, mirrored};
use super::window::{MOMENTS, NOW, Sighting, window};
use crate::KeyPointSet;
use crate::forward::Posed;
use crate::markers::Markers;
use crate::parameters::{ATTACHMENTS, Shared};
use crate::rotation::matvec;
use crate::skeleton::{COUNT as JOINTS, GROUP_SPREAD};
use rand::{Rng, RngExt};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{Mat3, add};

use camera::RandomCamera;
use motion::RandomMotion;

pub use detector::{DetectorErrors, ErrorFilm};
pub use motion::{ClipFrame, MotionClip};

/// The longer side of the pictures, pixels. Windows don't depend on it.
const LONGER: f64 = 1000.0;
/// Share of the examples that are at the start or end of a film.
const CUT: f64 = 0.25;
/// Share of the examples whose legs the picture cuts off.
const BUST: f64 = 0.08;
/// Share of the examples whose detector does not guess depth, and of these, those whose detector has no points of hands and feet.
const FLAT: f64 = 0.2;
const SPARSE: f64 = 0.5;
/// Places of hands and feet.
const ENDS: [usize; 6] = [9, 10, 17, 18, 19, 20];
/// Share of the points that a detector does not see.
const UNSEEN: f64 = 0.02;

/// An example.
#[derive(Clone, Debug)]
pub struct Example {
    /// `[INPUTS]`.
    pub inputs: Vec<f32>,
    /// Depth of each point from the middle of the hips, metres, away from the camera.
    pub depths: [f32; COUNT],
}

/// Draws examples from motions.
#[derive(Debug)]
pub struct Examples {
    clips: Vec<MotionClip>,
    /// Frames before each clip.
    starts: Vec<usize>,
    frames: usize,
    markers: Markers,
    errors: DetectorErrors,
}

impl Examples {
    /// Examples of `clips`, seen with `errors`.
    pub fn new(clips: Vec<MotionClip>, errors: DetectorErrors) -> Self {
        let mut frames = 0;
        let starts = clips.iter().map(|clip| {
            frames += clip.frames.len();
            frames - clip.frames.len()
        });
        Self {
            starts: starts.collect(),
            frames,
            clips,
            markers: Markers::of(KeyPointSet::BlazePose33),
            errors,
        }
    }

    /// A random example; `None` without any frame.
    pub fn draw(&self, random: &mut impl Rng) -> Option<Example> {
        if self.frames == 0 {
            return None;
        }
        let motion = RandomMotion::draw(self, random);
        let shared = self.body(random);
        let camera = RandomCamera::draw(random);
        let at = |moment: f64| motion.at(moment);
        let root = at(0.0)?.root;
        let errors = self.errors.draw(random)?;
        let mut film = Vec::with_capacity(MOMENTS.len());
        let mut depths = [0.0; COUNT];
        let cut = random.random::<f64>() < CUT;
        let end = if cut {
            random.random_range(0.0..1.0)
        } else {
            9.0
        };
        let is_start = random.random::<bool>();
        let is_bust = random.random::<f64>() < BUST;
        let is_flat = random.random::<f64>() < FLAT;
        let is_sparse = is_flat && random.random::<f64>() < SPARSE;
        for (index, moment) in MOMENTS.into_iter().enumerate() {
            let beyond = if is_start {
                -moment > end
            } else {
                moment > end
            };
            let Some(seen) = at(moment).filter(|_| !beyond) else {
                continue;
            };
            let stance = camera.stance(&seen, root);
            let posed = Posed::new(&stance, &shared);
            let points: [Vec3; COUNT] = BLAZE.map(|marker| {
                let marker = &self.markers.markers[marker];
                posed.marker(marker, &shared)
            });
            let hips = 0.5 * (points[HIPS[0]][2] + points[HIPS[1]][2]);
            if index == NOW {
                depths = points.map(|point| (point[2] - hips) as f32);
            }
            let Some(detected) = errors.detect(points, camera.focal, moment, random) else {
                continue;
            };
            film.push(Sighting {
                time: moment,
                points: std::array::from_fn(|place| {
                    let mut point = detected[place];
                    let is_cut = is_bust && place > HIPS[1];
                    let is_missing = is_sparse && ENDS.contains(&place);
                    if is_flat {
                        point[3] = 0.0;
                    }
                    if is_cut || is_missing || random.random::<f64>() < UNSEEN {
                        point[2] = 0.0;
                    }
                    point
                }),
            });
        }
        let now = film.iter().position(|seen| seen.time == MOMENTS[NOW])?;
        // Half of the examples are mirrored, so that both sides are learned alike.
        if random.random::<bool>() {
            film = film.iter().map(Sighting::mirrored).collect();
            depths = std::array::from_fn(|place| depths[mirrored(place)]);
        }
        Some(Example {
            inputs: window(&film, now, LONGER),
            depths,
        })
    }

    /// A random moment of a clip.
    fn moment(&self, random: &mut impl Rng) -> (&MotionClip, f64) {
        let frame = random.random_range(0..self.frames);
        let clip = self.starts.partition_point(|start| *start <= frame) - 1;
        (&self.clips[clip], (frame - self.starts[clip]) as f64)
    }

    /// A random body.
    fn body(&self, random: &mut impl Rng) -> Shared {
        let mut shared = Shared::average(&self.markers, LONGER);
        for (value, spread) in shared.values.iter_mut().zip(GROUP_SPREAD) {
            *value += spread * normal(random);
        }
        let offsets = shared.values[ATTACHMENTS..].iter_mut();
        let spreads = self.markers.attachments.iter().flat_map(|it| it.spread);
        for (value, spread) in offsets.zip(spreads) {
            *value += spread * normal(random);
        }
        shared
    }
}

/// A number with the standard normal distribution, by Box and Muller.
fn normal(random: &mut impl Rng) -> f64 {
    let (a, b): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}

/// Where a person's key points are, in the axes of their joints: `joints` are SMPL's 24, `rotations` theirs. The order is that of `set`.
pub fn places(set: KeyPointSet, joints: &[Vec3; JOINTS], rotations: &[Mat3; JOINTS]) -> Vec<Vec3> {
    let markers = Markers::of(set);
    let place = |marker: &crate::markers::Marker| {
        let [x, y, z] = markers.attachments[marker.attachment].offset;
        let offset = matvec(&rotations[marker.joint], [marker.side * x, y, z]);
        add(joints[marker.joint], offset)
    };
    markers.markers.iter().map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lift::window::{INPUTS, told_depth};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use yoto_capture::skeleton::transform::rodrigues;

    fn errors(depth: f64) -> DetectorErrors {
        DetectorErrors {
            slopes: [1.0; COUNT],
            lean: 0.0,
            noise: [0.0; 2],
            fps: 15.0,
            films: vec![ErrorFilm {
                frames: vec![Some([[0.0, 0.0, 1.0, depth]; COUNT]); 40],
            }],
        }
    }

    /// Somebody who raises the left arm and walks off.
    fn clip() -> MotionClip {
        let frame = |at: usize| {
            let share = at as f64 / 60.0;
            let mut rotations = [rodrigues([0.0; 3]); JOINTS];
            rotations[16] = rodrigues([0.0, 0.0, 1.2 * share]);
            rotations[18] = rodrigues([0.0, -1.0, 0.0]);
            ClipFrame {
                rotations,
                root: [0.0, 0.9, 2.0 * share],
            }
        };
        MotionClip {
            fps: 30.0,
            frames: (0..60).map(frame).collect(),
        }
    }

    fn drawn(examples: &Examples, count: u64) -> Vec<Example> {
        (0..count)
            .filter_map(|seed| examples.draw(&mut ChaCha8Rng::seed_from_u64(seed)))
            .collect()
    }

    /// The depths among the inputs of the frame itself.
    fn told(example: &Example) -> [f32; COUNT] {
        std::array::from_fn(|place| example.inputs[told_depth(place)])
    }

    #[test]
    fn a_detector_without_errors_tells_the_depth_that_is_to_be_found() {
        let examples = Examples::new(vec![clip()], errors(0.0));
        let drawn = drawn(&examples, 60);
        assert!(drawn.len() > 50, "{}", drawn.len());
        let mut seen = 0;
        for example in &drawn {
            assert_eq!(example.inputs.len(), INPUTS);
            for (told, exact) in told(example).into_iter().zip(example.depths) {
                if told != 0.0 {
                    assert!((told - exact).abs() < 1e-5, "{told} {exact}");
                    seen += 1;
                }
            }
        }
        assert!(seen > 20 * COUNT, "{seen}");
        assert!(
            drawn.iter().any(|it| told(it) == [0.0; COUNT]),
            "some detectors tell no depth"
        );
    }

    #[test]
    fn errors_of_the_detector_are_seen_and_do_not_change_what_is_to_be_found() {
        let [exact, wrong] = [0.0, 0.1].map(|depth| {
            let mut errors = errors(depth);
            // The hips stay, from which depths count.
            for hip in HIPS {
                for frame in errors.films[0].frames.iter_mut().flatten() {
                    frame[hip][3] = 0.0;
                }
            }
            drawn(&Examples::new(vec![clip()], errors), 30)
        });
        let mut differ = 0;
        for (exact, wrong) in exact.iter().zip(&wrong) {
            assert_eq!(exact.depths, wrong.depths);
            let pairs = told(exact).into_iter().zip(told(wrong));
            // Errors are drawn smaller and larger, and with either sign.
            differ += pairs
                .filter(|(a, b)| (0.02..0.2).contains(&(b - a).abs()))
                .count();
        }
        assert!(differ > 10 * (COUNT - 4), "{differ}");
    }

    #[test]
    fn places_are_those_of_the_body() {
        let mut joints = [[0.0; 3]; JOINTS];
        joints[18] = [0.5, 1.4, 0.1];
        joints[15] = [0.0, 1.6, 0.0];
        let turned = [rodrigues([0.0, std::f64::consts::PI, 0.0]); JOINTS];
        let places = places(KeyPointSet::BlazePose33, &joints, &turned);
        assert_eq!(places[13], [0.5, 1.4, 0.1]);
        // The nose is before the head, which looks back.
        assert!(places[0][2] < -0.1, "{:?}", places[0]);
    }
}
