//! How the pose model errs: its key points in pictures of bodies that move as people did, beside the truth.

use super::film::{FPS, photo, staged};
use crate::actor::Actor;
use crate::display::Screen;
use anyhow::{Context, ensure};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::Path;
use yoto_body::learn::BodyMesh;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::transform::{Mat3, apply, matmul};
use yoto_capture::skeleton::{Mat34, Skeleton, Vec3};
use yoto_landmarks::{PoseModel, Watcher};
use yoto_pose::KeyPointSet;
use yoto_pose::lift::learn::{DetectorErrors, ErrorFilm, MotionClip, places};
use yoto_pose::lift::{COUNT, HIPS, POINTS};

/// Lean and noise beside the measured errors, so that a network does not learn these by heart (docs/research/poses.md).
const LEAN: f64 = 0.1;
const NOISE: [f64; 2] = [0.005, 0.02];

/// Whom to look at, and how.
#[derive(Debug)]
pub struct DetectorOptions<'a> {
    /// Bodies, each of which does the motions in turn.
    pub bodies: Vec<BodyMesh>,
    /// Motions.
    pub motions: Vec<MotionClip>,
    /// Height of the pictures, pixels.
    pub size: u32,
    /// The pose model.
    pub model: &'a Path,
}

/// Errors of the pose model, as a file.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct MeasuredErrors {
    /// `[COUNT]`, depth that is told per depth that is there.
    pub slopes: Vec<f64>,
    /// Frames per second.
    pub fps: f64,
    /// Films: per frame and point the error in the picture in extents of the body, x and y, the confidence, and the depth that is told
    /// beyond the slope, metres; nothing for a frame in which the body is not found, or found the wrong way round.
    pub films: Vec<Vec<Option<Vec<[f64; 4]>>>>,
}

impl MeasuredErrors {
    /// The errors in the form to learn from.
    ///
    /// # Errors
    /// If the file has other points.
    pub fn errors(self) -> anyhow::Result<DetectorErrors> {
        let points = || format!("a pose model with other than {COUNT} points was measured");
        let film = |frames: Vec<Option<Vec<[f64; 4]>>>| {
            let frame = |frame: Option<Vec<[f64; 4]>>| match frame {
                Some(frame) => Ok(Some(frame.try_into().ok().with_context(points)?)),
                None => anyhow::Ok(None),
            };
            anyhow::Ok(ErrorFilm {
                frames: frames.into_iter().map(frame).collect::<Result<_, _>>()?,
            })
        };
        Ok(DetectorErrors {
            slopes: self.slopes.try_into().ok().with_context(points)?,
            lean: LEAN,
            noise: NOISE,
            fps: self.fps,
            films: self.films.into_iter().map(film).collect::<Result<_, _>>()?,
        })
    }
}

/// A frame as it is, and as it is seen.
struct Pair {
    /// Pixels and depth from the middle of the hips, metres.
    exact: [Vec3; COUNT],
    /// The same, with the confidence last.
    seen: [[f64; 4]; COUNT],
}

/// Measures the errors.
///
/// # Errors
/// Nobody to look at, or a pose model that can't be read.
pub fn measure(options: DetectorOptions, screen: &dyn Screen) -> anyhow::Result<MeasuredErrors> {
    ensure!(
        !options.bodies.is_empty() && !options.motions.is_empty(),
        "nobody to look at: give bodies and motions"
    );
    let bodies = options.bodies.into_iter();
    let actors: Vec<Actor> = bodies.map(Actor::mesh).collect();
    let mut films = Vec::new();
    for (position, clip) in options.motions.iter().enumerate() {
        let actor = &actors[position % actors.len()];
        let (poses, camera) = staged(actor, clip, position, options.size);
        let photos: Vec<_> = poses
            .par_iter()
            .enumerate()
            .filter_map(|(at, pose)| Some(photo(&actor.render(pose, &camera)?, at)))
            .collect();
        let mut watcher = Watcher::new(PoseModel::open(options.model)?);
        let mut film = Vec::new();
        for (at, (pose, photo)) in poses.iter().zip(&photos).enumerate() {
            let size = [photo.width() as usize, photo.height() as usize];
            let seen = watcher.look(at, photo.as_raw(), size)?;
            let exact = exact(&actor.skeleton, pose, &camera);
            film.push(seen.map(|seen| Pair {
                exact,
                seen: POINTS.map(|point| {
                    let ([x, y, _, sure], [_, _, z, _]) = (seen.picture[point], seen.space[point]);
                    [x, y, z, sure].map(f64::from)
                }),
            }));
        }
        let found = film.iter().flatten().count();
        screen.note(&format!(
            "{}, motion {position}: {found} frames",
            actor.name
        ));
        films.push(film);
    }
    let frames = || {
        films
            .iter()
            .flatten()
            .flatten()
            .filter(|pair| pair.is_right())
    };
    let slope = |place: usize| {
        let sum = |of: &dyn Fn(&Pair) -> f64| frames().map(of).sum::<f64>();
        let told = |pair: &Pair| pair.seen[place][2] - pair.told_hips();
        sum(&|pair| told(pair) * pair.exact[place][2])
            / sum(&|pair| pair.exact[place][2].powi(2)).max(1e-9)
    };
    let slopes: Vec<f64> = (0..COUNT).map(slope).collect();
    let errors = |pair: &Option<Pair>| {
        Some(pair.as_ref()?)
            .filter(|it| it.is_right())
            .map(|it| it.errors(&slopes))
    };
    Ok(MeasuredErrors {
        fps: FPS,
        films: films
            .iter()
            .map(|film| film.iter().map(errors).collect())
            .collect(),
        slopes,
    })
}

impl Pair {
    /// The depth of the middle of the hips that is told, metres.
    fn told_hips(&self) -> f64 {
        HIPS.iter().map(|hip| 0.5 * self.seen[*hip][2]).sum()
    }

    /// Whether the body is found the right way round, which the fit of poses corrects by the motion otherwise.
    fn is_right(&self) -> bool {
        let off = |other: fn(usize) -> usize| {
            (0..COUNT)
                .map(|place| {
                    let ([x, y, ..], [u, v, _]) = (self.seen[other(place)], self.exact[place]);
                    (x - u).hypot(y - v)
                })
                .sum::<f64>()
        };
        let hips = self.told_hips();
        let depth = |place: usize| (self.seen[place][2] - hips) * self.exact[place][2];
        off(|place| place) < off(yoto_pose::lift::mirrored)
            && (0..COUNT).map(depth).sum::<f64>() > 0.0
    }

    fn errors(&self, slopes: &[f64]) -> Vec<[f64; 4]> {
        let range = |axis: usize| {
            let values = || self.exact.iter().map(move |point| point[axis]);
            let least = values().fold(f64::INFINITY, f64::min);
            values().fold(f64::NEG_INFINITY, f64::max) - least
        };
        let (extent, hips) = (range(0).max(range(1)).max(1.0), self.told_hips());
        let error = |place: usize| {
            let ([x, y, z, sure], [u, v, depth]) = (self.seen[place], self.exact[place]);
            let error = [
                (x - u) / extent,
                (y - v) / extent,
                sure,
                z - hips - slopes[place] * depth,
            ];
            error.map(|value| (1e4 * value).round() / 1e4)
        };
        (0..COUNT).map(error).collect()
    }
}

/// Pixels and depth of the points of a body.
fn exact(skeleton: &Skeleton, pose: &Pose, camera: &Camera) -> [Vec3; COUNT] {
    let e: Mat34 = [camera.e[0], camera.e[1], camera.e[2]];
    let linear = |m: &Mat34| -> Mat3 { std::array::from_fn(|r| std::array::from_fn(|c| m[r][c])) };
    let world = skeleton.world_transforms(pose);
    let joints =
        std::array::from_fn(|joint| apply(&e, std::array::from_fn(|axis| world[joint][axis][3])));
    let rotations = std::array::from_fn(|joint| matmul(&linear(&e), &linear(&world[joint])));
    let all = places(KeyPointSet::BlazePose33, &joints, &rotations);
    let hips = HIPS.map(|hip| all[POINTS[hip]][2]);
    POINTS.map(|point| {
        let [x, y, z] = all[point];
        let pixel = |axis: usize, at: f64| camera.k[axis][axis] * at / z + camera.k[axis][2];
        [pixel(0, x), pixel(1, y), z - 0.5 * (hips[0] + hips[1])]
    })
}
