//! People in poses that no film shows, beside their truth: each is filmed in a turn with arms down, a model learns from the films, and
//! every pose of [`stress_poses`] is rendered from two sides. The same is done from eight sides in the pose of the first frame. Of people
//! who come with a film, there is only what the model makes of them.

mod near;
mod outline;
mod sheet;
mod table;

pub use near::Near;

pub use outline::Outline;

use crate::actor::Actor;
use crate::captures::{CaptureSource, read_sources};
use crate::display::Screen;
use crate::one_camera::HeldOut;
use crate::training::{self, pick_device};
use anyhow::{Context, ensure};
use near::Closeup;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Arc;
use yoto_avatar::config::{ModelConfig, Setting};
use yoto_avatar::evaluate::{Protocol, compare};
use yoto_avatar::render::{RenderView, Renderer};
use yoto_avatar::train::{Budget, Trainer};
use yoto_body::learn::BodyMesh;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::transform::dot;
use yoto_media::picture_file;
use yoto_proto::protocols::HELD_OUT;
use yoto_proto::smpl::drop_parts;
use yoto_proto::tiers::VARIANTS;
use yoto_proto::v1::Progress;
use yoto_synthetic::{SyntheticPerson, calm_motion, stress_poses};

/// Seed of the synthetic people.
const CAST_SEED: u64 = 7;
/// Directions of the cameras of poses, degrees to the left of the front; pose i has those with the indices i and i + 2.
const AROUND: [f64; 4] = [60.0, 150.0, 240.0, 330.0];
/// Cameras of the sides.
const SIDES: usize = 8;
/// Distance and height of the cameras, and height of the view at the person, metres: raised arms are in the picture.
const DISTANCE: f64 = 3.2;
const HEIGHT: f64 = 1.47;
const VIEW: f64 = 2.9;
/// Height of what the cameras look at, metres.
const TARGET: f64 = 0.92;
/// Stride of a film's frames that are not learned, as in other measurements.
const HELD_OUT_EVERY: usize = 20;
/// The file with all figures.
pub const FILE: &str = "stress.json";

/// Settings of a stress test.
#[derive(Debug, Clone)]
pub struct StressOptions {
    /// Number of synthetic people.
    pub people: usize,
    /// Bodies that are filmed as well.
    pub bodies: Vec<BodyMesh>,
    /// Captures of people.
    pub captures: Vec<CaptureSource>,
    /// Whether tracks have no fingers and faces though those of the bodies move.
    pub hide_parts: bool,
    /// Radians to either side of the camera that a film shows; all sides if absent.
    pub sector: Option<f64>,
    /// Longest side of the pictures, pixels.
    pub size: u32,
    /// Steps per person.
    pub steps: u64,
    /// Quality tier.
    pub tier: String,
    /// Settings in place of the tier's.
    pub settings: Vec<Setting>,
    /// Random seed.
    pub seed: u64,
    /// Folder for the figures and the sheets.
    pub out: PathBuf,
}

/// `stress.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stress {
    /// One entry per person.
    pub people: Vec<Person>,
}

/// Figures of a person.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Person {
    /// Their name.
    pub name: String,
    /// Two pictures per pose; none of somebody who came with a film.
    pub poses: Vec<Figures>,
    /// Eight pictures of the first pose of the film, from the front to the left around the person.
    pub sides: Vec<Figures>,
    /// The hands of bodies with fingers.
    #[serde(default)]
    pub hands: Near,
    /// The faces of bodies that have one.
    #[serde(default)]
    pub face: Near,
}

/// Figures of a picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Name of the pose.
    pub pose: String,
    /// Direction of the camera, degrees to the left of the front.
    pub degrees: f64,
    /// PSNR inside the box around the person, dB.
    pub psnr: f64,
    /// The outline.
    pub outline: Outline,
}

/// Trains, measures, and writes `stress.json` and two sheets per person.
///
/// # Errors
/// The first failure: nobody to film, settings that are refused, training that diverges, a file that can't be written.
pub fn run(options: &StressOptions, screen: &dyn Screen) -> anyhow::Result<Stress> {
    let actors = actors(options, screen)?;
    ensure!(
        !actors.is_empty(),
        "nobody to film: give people, bodies or captures"
    );
    let films = actors.iter().enumerate();
    let films = films.map(|(slot, it)| it.film(slot, options.size, options.sector));
    let mut films = films.collect::<anyhow::Result<Vec<_>>>()?;
    if options.hide_parts {
        for film in &mut films {
            drop_parts(&mut Arc::make_mut(&mut film.shard).track);
        }
    }
    let picked = pick_device(screen);
    let config = ModelConfig::named(&options.tier, VARIANTS[0].0)?.with(&options.settings)?;
    let budget = Budget::Steps(options.steps * actors.len() as u64);
    let settings = training::options(budget, options.size, options.seed, None);
    let mut trainer = Trainer::new(config, settings, films, &picked.device)?;
    let mut display = screen.begin("training");
    training::train_to_the_end(&mut trainer, &mut *display)?;
    display.finish(&format!("{} steps", trainer.progress().step));
    let renderer = trainer.renderer();
    let mut display = screen.begin("poses");
    let mut people = Vec::new();
    for (slot, actor) in actors.iter().enumerate() {
        display.progress(&Progress {
            phase: actor.name.clone(),
            ..Progress::default()
        });
        people.push(person(&renderer, slot, actor, options)?);
    }
    display.finish(&format!("{} people", people.len()));
    let stress = Stress { people };
    let path = options.out.join(FILE);
    let json = serde_json::to_vec_pretty(&stress).context("encoding the figures")?;
    std::fs::write(&path, json).with_context(|| format!("writing {}", path.display()))?;
    Ok(stress)
}

fn actors(options: &StressOptions, screen: &dyn Screen) -> anyhow::Result<Vec<Actor>> {
    let cast = SyntheticPerson::cast(options.people.max(1), CAST_SEED);
    let people = cast.into_iter().take(options.people);
    let people = people.map(Actor::synthetic);
    let bodies = options.bodies.iter().cloned();
    let bodies = bodies.map(|body| Ok(Actor::mesh(body)));
    let protocol = Protocol::named(HELD_OUT)?;
    let films = read_sources(
        &options.captures,
        options.size,
        HeldOut::Every(HELD_OUT_EVERY),
        protocol,
        screen,
    )?;
    let films = films.into_iter().map(Actor::filmed);
    people.chain(bodies).chain(films).collect()
}

/// The height of the lowest joint at rest, metres.
fn floor(skeleton: &Skeleton) -> f64 {
    let heights = skeleton.rest.iter().map(|joint| joint[1]);
    heights.fold(f64::INFINITY, f64::min)
}

/// The camera that looks from `degrees` to the left of the front at somebody on a `floor`, with pictures of `size` x `size` pixels.
fn camera(degrees: f64, size: u32, floor: f64) -> Camera {
    let angle = degrees.to_radians();
    let above = |height: f64, [x, z]: [f64; 2]| [x, floor + height, z];
    let eye = above(HEIGHT, [DISTANCE * angle.sin(), DISTANCE * angle.cos()]);
    let target = above(TARGET, [0.0, 0.0]);
    let focal = f64::from(size) * DISTANCE / VIEW;
    Camera::look_at(eye, target, [0.0, 1.0, 0.0], focal, size, size)
}

fn person(
    renderer: &Renderer,
    slot: usize,
    actor: &Actor,
    options: &StressOptions,
) -> anyhow::Result<Person> {
    let measure = |name: &str, pose: &Pose, degrees: f64| {
        let camera = camera(degrees, options.size, floor(&actor.skeleton));
        picture(renderer, slot, actor, (name, pose), (degrees, &camera))
            .with_context(|| format!("{}, {name}", actor.name))
    };
    let (mut poses, mut cells) = (Vec::new(), Vec::new());
    for (index, it) in stress_poses(&actor.skeleton).iter().enumerate() {
        for around in [index, index + 2] {
            let (figures, cell) = measure(it.name, &it.pose, AROUND[around % AROUND.len()])?;
            poses.extend(figures);
            if around == index {
                cells.push(cell);
            }
        }
    }
    sheet::write(&options.out.join(format!("{}.png", actor.name)), &cells)?;
    let (mut sides, mut cells) = (Vec::new(), Vec::new());
    let film = calm_motion(&actor.skeleton, 1, options.sector);
    for side in 0..SIDES {
        let degrees = 360.0 * side as f64 / SIDES as f64;
        let (figures, cell) = measure("filmed", &film[0], degrees)?;
        sides.extend(figures);
        cells.push(cell);
    }
    let path = options.out.join(format!("{}-sides.png", actor.name));
    sheet::write(&path, &cells)?;
    let near = Closeup {
        renderer,
        slot,
        actor,
        options,
    };
    Ok(Person {
        name: actor.name.clone(),
        poses,
        sides,
        hands: near.hands()?,
        face: near.face()?,
    })
}

/// Figures of the person in a pose from a camera, and both pictures.
fn picture(
    renderer: &Renderer,
    slot: usize,
    actor: &Actor,
    (name, pose): (&str, &Pose),
    (degrees, camera): (f64, &Camera),
) -> anyhow::Result<(Option<Figures>, sheet::Cell)> {
    let mut shown = pose.clone();
    let joints = renderer.skeleton(slot).map_or(0, Skeleton::joints);
    shown.rotations.truncate(joints);
    let rendered = renderer.render(&RenderView {
        slot,
        pose: shown,
        camera: camera.clone(),
        background: [0.0; 3],
    })?;
    let size = (rendered.width, rendered.height);
    let rgb = rendered.to_rgb8();
    let shown = picture_file::rgb(name, size.0, size.1, &rgb)?;
    let Some(truth) = actor.render(pose, camera) else {
        return Ok((None, vec![shown]));
    };
    let score = compare(&truth, &rgb, size)?;
    let psnr = score.psnr_mask_box;
    let psnr = psnr.context("the person is not in the picture")?;
    let root = actor.skeleton.posed_joints(pose)[0];
    let forward = [camera.e[2][0], camera.e[2][1], camera.e[2][2]];
    let depth = dot(forward, root) + camera.e[2][3];
    let figures = Figures {
        pose: name.to_owned(),
        degrees,
        psnr,
        outline: Outline::of(&truth, &rendered.alpha, camera.k[0][0] / depth),
    };
    let truth = picture_file::rgb(name, size.0, size.1, &truth.rgb)?;
    Ok((Some(figures), vec![truth, shown]))
}
