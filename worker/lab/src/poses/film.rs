//! Films as a phone makes them, of people whose poses are known: a wall and a floor, light that drifts, a lens that blurs, and noise.

use crate::actor::Actor;
use crate::actor::gestures::{speak, wave};
use anyhow::Context;
use image::{Rgb, RgbImage, imageops};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use std::path::Path;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::readings::interpolate;
use yoto_capture::skeleton::transform::log_map;
use yoto_capture::{FrameImage, Shard};
use yoto_pose::lift::learn::{ClipFrame, MotionClip};
use yoto_synthetic::{calm_motion, stress_poses};

/// Frames of a film, and frames per second.
const FRAMES: usize = 60;
pub(super) const FPS: f64 = 15.0;
/// Distance of the camera, and height of the view at the person, metres.
const DISTANCE: f64 = 3.5;
const VIEW: f64 = 2.6;
/// Height of what the camera looks at, metres.
const TARGET: f64 = 0.95;
/// Width of a picture as a share of its height: phones are held upright.
const UPRIGHT: f64 = 0.75;
/// Heights of the camera above the floor in films of motions, metres.
const HEIGHTS: [f64; 3] = [1.3, 0.5, 2.1];
/// Radians to either side of the camera in a film from the front.
const SECTOR: f64 = 0.5;
/// Frames from one pose of a sport to the next.
const BETWEEN: usize = 8;
/// Largest change of the exposure, as a share.
const DRIFT: f64 = 0.08;
/// Standard deviations of the lens, pixels, and of the noise, as a share of white.
const BLUR: f32 = 0.6;
const NOISE: f64 = 0.012;
/// Share of the picture's height at which the wall meets the floor.
const SKIRTING: f64 = 0.8;

/// A film to make.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shot {
    pub motion: Motion,
    /// Height of the camera above the floor, metres.
    pub height: f64,
}

/// What a person does in a film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Motion {
    /// A walk on the spot in one whole turn, arms down.
    Turn,
    /// The same, facing the camera.
    Front,
    /// Poses with arms and legs far from the body, one after the other.
    Sport,
}

/// All films of a person.
pub(super) const SHOTS: [Shot; 5] = [
    Shot {
        motion: Motion::Turn,
        height: 1.3,
    },
    Shot {
        motion: Motion::Front,
        height: 1.3,
    },
    Shot {
        motion: Motion::Sport,
        height: 1.3,
    },
    Shot {
        motion: Motion::Turn,
        height: 0.5,
    },
    Shot {
        motion: Motion::Turn,
        height: 2.1,
    },
];

impl Motion {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Turn => "turn",
            Self::Front => "front",
            Self::Sport => "sport",
        }
    }

    fn poses(self, skeleton: &Skeleton) -> Vec<Pose> {
        match self {
            Self::Turn => calm_motion(skeleton, FRAMES, None),
            Self::Front => calm_motion(skeleton, FRAMES, Some(SECTOR)),
            Self::Sport => sport(skeleton),
        }
    }
}

/// Every third of the stress poses, and what is between them.
fn sport(skeleton: &Skeleton) -> Vec<Pose> {
    let poses = stress_poses(skeleton);
    let poses: Vec<&Pose> = poses.iter().step_by(3).map(|it| &it.pose).collect();
    let pairs = poses.windows(2).flat_map(|pair| {
        (0..BETWEEN).map(|step| interpolate(pair[0], pair[1], step as f64 / BETWEEN as f64))
    });
    pairs.collect()
}

/// A frame whose pose is known.
#[derive(Debug)]
pub(super) struct KnownFrame {
    pub pose: Pose,
    pub camera: Camera,
}

/// A film in a folder of pictures, named by their position.
#[derive(Debug)]
pub(super) struct KnownFilm {
    pub name: String,
    pub skeleton: Skeleton,
    pub fps: f64,
    pub frames: Vec<KnownFrame>,
}

/// Films `actor` with pictures `size` pixels high into `folder`.
pub(super) fn of_actor(
    actor: &Actor,
    shot: Shot,
    size: u32,
    folder: &Path,
) -> anyhow::Result<KnownFilm> {
    let rest = &actor.skeleton.rest;
    let floor = rest
        .iter()
        .map(|joint| joint[1])
        .fold(f64::INFINITY, f64::min);
    let focal = f64::from(size) * DISTANCE / VIEW;
    let width = (f64::from(size) * UPRIGHT).round() as u32;
    let (eye, target) = (
        [0.0, floor + shot.height, DISTANCE],
        [0.0, floor + TARGET, 0.0],
    );
    let camera = Camera::look_at(eye, target, [0.0, 1.0, 0.0], focal, width, size);
    let name = format!(
        "{}, {} from {} m",
        actor.name,
        shot.motion.name(),
        shot.height
    );
    filmed(
        actor,
        shot.motion.poses(&actor.skeleton),
        &camera,
        name,
        folder,
    )
}

fn filmed(
    actor: &Actor,
    poses: Vec<Pose>,
    camera: &Camera,
    name: String,
    folder: &Path,
) -> anyhow::Result<KnownFilm> {
    let mut frames = Vec::new();
    for (position, mut pose) in poses.into_iter().enumerate() {
        wave(&mut pose, position as f64 / FPS);
        speak(&mut pose, position as f64 / FPS);
        let person = actor
            .render(&pose, camera)
            .context("a person without a truth")?;
        save(&person, position, folder)?;
        frames.push(KnownFrame {
            pose,
            camera: camera.clone(),
        });
    }
    Ok(KnownFilm {
        name,
        skeleton: actor.skeleton.clone(),
        fps: FPS,
        frames,
    })
}

/// Films `actor` moving as `clip` does, the `position`-th of several, with pictures `size` pixels high into `folder`. Cameras differ in
/// height and direction, and stand as far away as they must to see the whole motion.
pub(super) fn of_motion(
    actor: &Actor,
    clip: &MotionClip,
    position: usize,
    size: u32,
    folder: &Path,
) -> anyhow::Result<KnownFilm> {
    let (poses, camera) = staged(actor, clip, position, size);
    let name = format!("{}, motion {position}", actor.name);
    filmed(actor, poses, &camera, name, folder)
}

/// The poses of [`of_motion`], and its camera.
pub(super) fn staged(
    actor: &Actor,
    clip: &MotionClip,
    position: usize,
    size: u32,
) -> (Vec<Pose>, Camera) {
    let step = ((clip.fps / FPS).round() as usize).max(1);
    let first = clip.frames.len().saturating_sub(FRAMES * step) / 2;
    let frames = clip.frames.iter().skip(first).step_by(step).take(FRAMES);
    let poses: Vec<Pose> = frames.map(|frame| moved(&actor.skeleton, frame)).collect();
    let joints = |pose: &Pose| actor.skeleton.posed_joints(pose);
    let all: Vec<[f64; 3]> = poses.iter().flat_map(joints).collect();
    let range = |axis: usize| {
        let values = || all.iter().map(move |joint| joint[axis]);
        let least = values().fold(f64::INFINITY, f64::min);
        [least, values().fold(f64::NEG_INFINITY, f64::max)]
    };
    let [x, y, z] = [range(0), range(1), range(2)];
    let middle = [x, y, z].map(|[least, most]| 0.5 * (least + most));
    let width = (x[1] - x[0]).max(z[1] - z[0]) / UPRIGHT;
    let view = (width + 0.7).max(y[1] - y[0] + 0.9);
    let distance = DISTANCE * (view / VIEW).max(1.0);
    let height = HEIGHTS[position % HEIGHTS.len()];
    let yaw = TAU * (position as f64 * 0.381_966).fract();
    let eye = [
        middle[0] + distance * yaw.sin(),
        y[0] + height,
        middle[2] + distance * yaw.cos(),
    ];
    let focal = f64::from(size) * distance / view;
    let wide = (f64::from(size) * UPRIGHT).round() as u32;
    let camera = Camera::look_at(eye, middle, [0.0, 1.0, 0.0], focal, wide, size);
    (poses, camera)
}

/// The pose of a motion's frame on another body.
fn moved(skeleton: &Skeleton, frame: &ClipFrame) -> Pose {
    let rotations = frame.rotations.iter();
    let root = skeleton.rest.first().copied().unwrap_or_default();
    Pose {
        rotations: rotations.map(|it| log_map(it).map(|v| v as f32)).collect(),
        translation: std::array::from_fn(|axis| (frame.root[axis] - root[axis]) as f32),
    }
}

/// Puts the person of a capture before a wall, and writes the pictures into `folder`.
pub(super) fn of_capture(name: &str, shard: &Shard, folder: &Path) -> anyhow::Result<KnownFilm> {
    let track = &shard.track;
    let mut frames = Vec::new();
    for (position, frame) in track.frames.iter().enumerate() {
        save(&shard.image(position), position, folder)?;
        frames.push(KnownFrame {
            pose: Pose::from_frame(frame)?,
            camera: Camera::from_frame(frame, track.image_size)?,
        });
    }
    Ok(KnownFilm {
        name: name.to_owned(),
        skeleton: Skeleton::from_track(&track.skeleton)?,
        fps: track.fps,
        frames,
    })
}

/// Writes the picture of a `person` before a wall.
fn save(person: &FrameImage, position: usize, folder: &Path) -> anyhow::Result<()> {
    let path = folder.join(format!("{position:06}.png"));
    photo(person, position)
        .save(&path)
        .with_context(|| format!("writing {}", path.display()))
}

/// The picture of a `person` before a wall.
pub(super) fn photo(person: &FrameImage, position: usize) -> RgbImage {
    let (width, height) = (person.width, person.height);
    let exposure = 1.0 + DRIFT * (TAU * position as f64 / 37.0).sin();
    let mut picture = RgbImage::new(width as u32, height as u32);
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        let at = y as usize * width + x as usize;
        let behind = 1.0 - f64::from(person.mask[at]) / 255.0;
        let wall = wall(f64::from(x) / height as f64, f64::from(y) / height as f64);
        *pixel = Rgb(std::array::from_fn(|channel| {
            let own = f64::from(person.rgb[3 * at + channel]) / 255.0;
            (255.0 * exposure * (own + behind * wall[channel]))
                .round()
                .clamp(0.0, 255.0) as u8
        }));
    }
    let mut picture = imageops::blur(&picture, BLUR);
    let mut random = ChaCha8Rng::seed_from_u64(position as u64);
    for value in picture.iter_mut() {
        let noisy = f64::from(*value) + 255.0 * NOISE * normal(&mut random);
        *value = noisy.round().clamp(0.0, 255.0) as u8;
    }
    picture
}

/// The colour of what is behind the person, at a place in shares of the picture's height.
fn wall(x: f64, y: f64) -> [f64; 3] {
    if y > SKIRTING {
        let board = 0.02 * (9.0 * TAU * (x + 0.3 * y)).sin();
        return [0.46, 0.36, 0.27].map(|value| value + board);
    }
    let light = 0.9 - 0.25 * y + 0.02 * (3.0 * TAU * x).sin();
    [0.72, 0.74, 0.7].map(|value| value * light)
}

/// A number with about the standard normal distribution: a sum of uniform ones.
fn normal(random: &mut ChaCha8Rng) -> f64 {
    (0..4).map(|_| random.random::<f64>() - 0.5).sum::<f64>() * 3f64.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_its_deviation_and_repeats() {
        let drawn = || -> Vec<f64> {
            let mut random = ChaCha8Rng::seed_from_u64(3);
            (0..10_000).map(|_| normal(&mut random)).collect()
        };
        let all = drawn();
        let mean = all.iter().sum::<f64>() / 1e4;
        let square = all.iter().map(|it| it * it).sum::<f64>() / 1e4;
        assert!(
            mean.abs() < 0.04 && (square - 1.0).abs() < 0.06,
            "{mean} {square}"
        );
        assert_eq!(all, drawn());
    }
}
