//! Examples to learn from: people who move as somebody did, seen by a random camera and by a detector that errs as measured.

use super::points::{BLAZE, COUNT, HIPS, mirrored};
use super::window::{MOMENTS, NOW, Sighting, window};
use crate::KeyPointSet;
use crate::forward::Posed;
use crate::markers::Markers;
use crate::parameters::{ATTACHMENTS, Shared, Stance};
use crate::rotation::{matmul, matvec, slerp};
use crate::skeleton::{COUNT as JOINTS, GROUP_SPREAD};
use rand::{Rng, RngExt};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{Mat3, add, rodrigues, scale, sub};

pub use super::detector::{DetectorErrors, ErrorFilm};

/// A body that faces the camera: its x to the picture's right, its y up, its z towards the camera.
const FACING: Mat3 = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
/// The longer side of the pictures, pixels. Windows don't depend on it.
const LONGER: f64 = 1000.0;
/// Mean and standard deviation of the logarithm of the focal length in longer sides.
const FOCAL: [f64; 2] = [0.18, 0.22];
/// Mean and standard deviation of the camera's downward pitch, radians, and its limits.
const PITCH: [f64; 2] = [0.05, 0.16];
const PITCH_RANGE: [f64; 2] = [-0.5, 0.7];
/// Standard deviation of the camera's roll, radians.
const ROLL: f64 = 0.03;
/// Range of the body's height in the picture, in longer sides, and of the place of its root from the middle.
const SHARE: [f64; 2] = [0.3, 0.95];
const PLACE: [f64; 2] = [0.25, 0.12];
/// Height of an average body, metres.
const HEIGHT: f64 = 1.75;
/// Range of a motion's speed, as multiples of that of the clip.
const SPEED: [f64; 2] = [0.7, 1.4];
/// Share of the examples whose upper body moves as in another clip, and of those, whose left arm moves as in a third.
const MIXED: f64 = 0.5;
const MIXED_ARM: f64 = 0.3;
/// Joints above the waist, and those of the left arm.
const UPPER: [usize; 15] = [3, 6, 9, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23];
const LEFT_ARM: [usize; 5] = [13, 16, 18, 20, 22];
/// Standard deviation of a joint's rotation from the clip's, the same in all frames, radians.
const HABIT: f64 = 0.08;
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

/// A motion, facing +z in the rest pose, which is a T-pose.
#[derive(Clone, Debug)]
pub struct MotionClip {
    /// Frames per second.
    pub fps: f64,
    /// Frames in order.
    pub frames: Vec<ClipFrame>,
}

/// A frame of a motion.
#[derive(Clone, Debug)]
pub struct ClipFrame {
    /// Rotations of SMPL's 24 joints relative to their parents.
    pub rotations: [Mat3; JOINTS],
    /// Place of the root, y up, metres for an average body.
    pub root: Vec3,
}

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

impl MotionClip {
    /// The frame at the place `at`, between two; `None` outside of the clip.
    fn at(&self, at: f64) -> Option<ClipFrame> {
        let (first, share) = (at.floor(), at - at.floor());
        if first < 0.0 {
            return None;
        }
        let before = self.frames.get(first as usize)?;
        if share < 1e-6 {
            return Some(before.clone());
        }
        let after = self.frames.get(first as usize + 1)?;
        Some(ClipFrame {
            rotations: std::array::from_fn(|joint| {
                slerp(&before.rotations[joint], &after.rotations[joint], share)
            }),
            root: add(before.root, scale(sub(after.root, before.root), share)),
        })
    }
}

/// A motion around a moment: that of a clip, or parts of several.
struct RandomMotion<'a> {
    whole: (&'a MotionClip, f64),
    /// Clips whose joints replace those of the whole body.
    parts: Vec<((&'a MotionClip, f64), &'static [usize])>,
    speed: f64,
    /// Rotations of the joints before those of the clip.
    habits: [Mat3; JOINTS],
}

impl<'a> RandomMotion<'a> {
    fn draw(examples: &'a Examples, random: &mut impl Rng) -> Self {
        let whole = examples.moment(random);
        let mut parts: Vec<((&MotionClip, f64), &'static [usize])> = Vec::new();
        if random.random::<f64>() < MIXED {
            parts.push((examples.moment(random), &UPPER));
            if random.random::<f64>() < MIXED_ARM {
                parts.push((examples.moment(random), &LEFT_ARM));
            }
        }
        Self {
            whole,
            parts,
            speed: random.random_range(SPEED[0]..SPEED[1]),
            habits: std::array::from_fn(|joint| {
                let spread = if joint == 0 { 0.0 } else { HABIT };
                rodrigues(std::array::from_fn(|_| spread * normal(random)))
            }),
        }
    }

    /// The frame `after` seconds; `None` outside of a clip.
    fn at(&self, after: f64) -> Option<ClipFrame> {
        let at = |(clip, frame): (&MotionClip, f64)| clip.at(frame + after * self.speed * clip.fps);
        let mut frame = at(self.whole)?;
        for (part, joints) in &self.parts {
            let part = at(*part)?;
            for &joint in *joints {
                frame.rotations[joint] = part.rotations[joint];
            }
        }
        for (rotation, habit) in frame.rotations.iter_mut().zip(&self.habits) {
            *rotation = matmul(habit, rotation);
        }
        Some(frame)
    }
}

/// A camera, and where the person is before it.
struct RandomCamera {
    rotation: Mat3,
    focal: f64,
    place: Vec3,
}

impl RandomCamera {
    fn draw(random: &mut impl Rng) -> Self {
        let focal = LONGER * (FOCAL[0] + FOCAL[1] * normal(random)).exp();
        let pitch = (PITCH[0] + PITCH[1] * normal(random)).clamp(PITCH_RANGE[0], PITCH_RANGE[1]);
        let roll = ROLL * normal(random);
        let yaw = random.random_range(0.0..std::f64::consts::TAU);
        let turned = matmul(&FACING, &rodrigues([0.0, yaw, 0.0]));
        let rotation = matmul(
            &rodrigues([0.0, 0.0, roll]),
            &matmul(&rodrigues([pitch, 0.0, 0.0]), &turned),
        );
        let depth = focal * HEIGHT / (LONGER * random.random_range(SHARE[0]..SHARE[1]));
        let [x, y] = PLACE.map(|most| random.random_range(-most..most) * LONGER * depth / focal);
        Self {
            rotation,
            focal,
            place: [x, y, depth],
        }
    }

    /// The stance of `frame` before the camera; `origin` is where the person is in the middle of the window.
    fn stance(&self, frame: &ClipFrame, origin: Vec3) -> Stance {
        let mut rotations = frame.rotations;
        rotations[0] = matmul(&self.rotation, &rotations[0]);
        Stance {
            rotations,
            root: add(self.place, matvec(&self.rotation, sub(frame.root, origin))),
        }
    }
}

/// A number with the standard normal distribution, by Box and Muller.
pub(super) fn normal(random: &mut impl Rng) -> f64 {
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
    use crate::lift::window::INPUTS;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

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
        let frame = &example.inputs[NOW * (4 * COUNT + 3)..];
        std::array::from_fn(|place| frame[4 * place + 3])
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
