//! Scenes: several people in one picture, in a world of their own.

mod camera;
mod clock;
mod place;
mod player;

use super::{FPS, Film, cast::Cast, surroundings::Surroundings, truth::Truths};
use crate::{jobs::JobFailure, media::animation::MAX_FPS};
use player::Player;
use yoto_avatar::render::SceneView;
use yoto_proto::{checks::scene::MAX_PICTURES, v1::Scene};

/// Rounding of a film's length, frames.
const ROUNDING: f64 = 1e-6;

/// All pictures of `scene`.
pub(super) fn film(cast: &Cast<'_>, scene: &Scene) -> Result<Film, JobFailure> {
    let players = scene.actors.iter().enumerate();
    let players = players.map(|(i, actor)| {
        let field = format!("scene.actors[{i}]");
        Player::new(actor, &field, cast)
    });
    let players = players.collect::<Result<Vec<_>, _>>()?;
    let natural = players.iter().find_map(Player::fps).map(|fps| fps as f32);
    let fps = cast.request.fps.or(natural).unwrap_or(FPS).min(MAX_FPS);
    let times = times(scene.seconds, fps, &players)?;
    let cameras = camera::cameras(scene, &players, &times)?;
    let pictures = times.iter().zip(cameras);
    let request = cast.request;
    let (colour, transparent) = (request.background, request.spec.transparent);
    let surroundings = Surroundings::new(scene, colour, transparent)?;
    let views = pictures.map(|(time, camera)| SceneView {
        actors: players.iter().map(|player| player.actor(*time)).collect(),
        camera,
        background: match surroundings {
            Some(_) => [0.0; 3],
            None => colour,
        },
    });
    Ok(Film {
        views: views.collect(),
        surroundings,
        truths: Truths::none(),
        fps,
    })
}

/// The times of the frames of a film of `seconds`, or with 0 of one that ends with the last motion.
fn times(seconds: f64, fps: f32, players: &[Player]) -> Result<Vec<f64>, JobFailure> {
    let rate = f64::from(fps);
    let count = if seconds > 0.0 {
        (seconds * rate).round().max(1.0)
    } else {
        let ends = players
            .iter()
            .map(|player| (player.clock.end(), player.clock.repeat));
        let frames = ends.map(|(end, repeat)| {
            let frames = (end * rate + ROUNDING).floor();
            // The frame at the end of a round is the first one of the next.
            if repeat { frames } else { frames + 1.0 }
        });
        frames.fold(1.0, f64::max)
    };
    if count > f64::from(MAX_PICTURES) {
        let message = format!("{count} pictures: 1 to {MAX_PICTURES} are allowed");
        return Err(JobFailure::invalid("render", "scene.seconds", message));
    }
    Ok((0..count as usize)
        .map(|frame| frame as f64 / rate)
        .collect())
}
