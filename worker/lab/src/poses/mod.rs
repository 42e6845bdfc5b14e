//! What a film alone tells of poses: people whose poses are known are filmed as a phone films, the pose model and the fit look at the
//! pictures, and what they find is compared with the truth.

mod detector;
mod error;
mod film;
mod table;

pub use detector::{DetectorOptions, MeasuredErrors, measure};
pub use error::FilmErrors;

use crate::actor::Actor;
use crate::display::Screen;
use anyhow::{Context, ensure};
use film::{KnownFilm, SHOTS, of_actor, of_capture, of_motion};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::Instant;
use yoto_body::learn::BodyMesh;
use yoto_capture::CaptureFolder;
use yoto_capture::skeleton::smpl::has_joints;
use yoto_import::{Format, Options, read};
use yoto_pose::lift::learn::MotionClip;
use yoto_synthetic::SyntheticPerson;

/// Seed of the synthetic people.
const CAST_SEED: u64 = 7;
/// The file with all figures.
pub const FILE: &str = "poses.json";

/// Whose poses are looked for, and how.
#[derive(Debug, Clone)]
pub struct PosesOptions {
    /// Bodies to film.
    pub bodies: Vec<BodyMesh>,
    /// Number of synthetic people to film.
    pub people: usize,
    /// Captures with exact poses and masks, whose people are put before a wall.
    pub captures: Vec<PathBuf>,
    /// Motions, each of which every person does in turn, in place of the usual films.
    pub motions: Vec<MotionClip>,
    /// Height of the pictures of films that are made, pixels.
    pub size: u32,
    /// Settings by which the films are read.
    pub import: Options,
    /// Folder for the figures and the films.
    pub out: PathBuf,
}

/// `poses.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Poses {
    /// One entry per film.
    pub films: Vec<FilmErrors>,
    /// Seconds per frame that the search and the fit take.
    pub seconds_per_frame: f64,
}

/// Films people, finds their poses, and writes `poses.json`.
///
/// # Errors
/// The first failure: nobody to film, a capture that can't be read or has other joints, a film in which nobody is found, a file that can't
/// be written.
pub fn run(options: &PosesOptions, screen: &dyn Screen) -> anyhow::Result<Poses> {
    let cast = SyntheticPerson::cast(options.people.max(1), CAST_SEED);
    let people = cast.into_iter().take(options.people).map(Actor::synthetic);
    let bodies = options.bodies.iter().cloned();
    let bodies = bodies.map(|body| Ok(Actor::mesh(body)));
    let actors: Vec<Actor> = people.chain(bodies).collect::<anyhow::Result<_>>()?;
    let mut measured = Measured::default();
    for (position, clip) in options.motions.iter().enumerate() {
        let Some(actor) = actors.get(position % actors.len().max(1)) else {
            break;
        };
        let folder = made(&options.out.join(format!("{}-{position}", actor.name)))?;
        let known = of_motion(actor, clip, position, options.size, &folder)?;
        measured.add(&known, &folder, &options.import, screen)?;
    }
    let shots = if options.motions.is_empty() {
        &SHOTS[..]
    } else {
        &[]
    };
    for actor in &actors {
        for &shot in shots {
            let name = format!("{}-{}-{}", actor.name, shot.motion.name(), shot.height);
            let folder = made(&options.out.join(name))?;
            let known = of_actor(actor, shot, options.size, &folder)?;
            measured.add(&known, &folder, &options.import, screen)?;
        }
    }
    for capture in &options.captures {
        let name = capture.file_name().unwrap_or_default().to_string_lossy();
        let shard = CaptureFolder::open(capture).and_then(|it| it.shard());
        let shard = shard.with_context(|| format!("the capture {}", capture.display()))?;
        let folder = made(&options.out.join(&*name))?;
        let known = of_capture(&name, &shard, &folder)?;
        ensure!(
            has_joints(&known.skeleton),
            "{name}: the skeleton does not have the 24 joints of SMPL, with which poses are compared"
        );
        measured.add(&known, &folder, &options.import, screen)?;
    }
    ensure!(
        !measured.films.is_empty(),
        "nobody to film: give people, bodies or captures"
    );
    let poses = Poses {
        seconds_per_frame: measured.seconds / measured.frames as f64,
        films: measured.films,
    };
    let path = options.out.join(FILE);
    let json = serde_json::to_vec_pretty(&poses).context("encoding the figures")?;
    std::fs::write(&path, json).with_context(|| format!("writing {}", path.display()))?;
    Ok(poses)
}

fn made(folder: &Path) -> anyhow::Result<PathBuf> {
    std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    Ok(folder.to_owned())
}

/// What was measured so far.
#[derive(Default)]
struct Measured {
    films: Vec<FilmErrors>,
    seconds: f64,
    frames: usize,
}

impl Measured {
    /// Finds the poses of the film `known`, whose pictures are in `folder`.
    fn add(
        &mut self,
        known: &KnownFilm,
        folder: &Path,
        import: &Options,
        screen: &dyn Screen,
    ) -> anyhow::Result<()> {
        let began = Instant::now();
        let options = Options {
            fps: Some(known.fps),
            ..import.clone()
        };
        let found = read(Format::FILM, folder, &options).with_context(|| known.name.clone())?;
        self.seconds += began.elapsed().as_secs_f64();
        self.frames += known.frames.len();
        let errors = FilmErrors::of(known, &found.track)?;
        screen.note(&format!("{}: {:.0} mm", errors.film, errors.joints_mm));
        self.films.push(errors);
        Ok(())
    }
}
