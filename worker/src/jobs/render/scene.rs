//! Scenes: several people in one picture, in a world of their own.

mod camera;
mod clock;
mod place;
mod player;

use super::{FPS, Film, cast::Cast, surroundings::Surroundings, truth::Truths};
use crate::{jobs::JobFailure, media::animation::MAX_FPS};
use player::Player;
use yoto_avatar::render::SceneView;
use yoto_proto::{
    checks::scene::MAX_PICTURES,
    render_needs::model_of,
    v1::{FilmRange, Scene},
};

/// Rounding of a film's length, frames.
const ROUNDING: f64 = 1e-6;

/// All pictures of `scene`, with the casts of the render's own model and of all `others`.
pub(super) fn film(own: &Cast<'_>, others: &[Cast<'_>], scene: &Scene) -> Result<Film, JobFailure> {
    let request = own.request;
    let (mut players, mut models) = (Vec::new(), Vec::new());
    for (i, actor) in scene.actors.iter().enumerate() {
        let field = format!("scene.actors[{i}]");
        let model = model_of(request.spec, actor);
        let other = others.iter().position(|cast| cast.model == model);
        let cast = other.and_then(|other| others.get(other)).unwrap_or(own);
        players.push(Player::new(actor, &field, cast)?);
        models.push(other);
    }
    let natural = players.iter().find_map(Player::fps).map(|fps| fps as f32);
    let fps = request.fps.or(natural).unwrap_or(FPS).min(MAX_FPS);
    let times = times(scene.seconds, fps, &players)?;
    let cameras = camera::cameras(scene, &players, &times)?;
    let range = scene.pictures.unwrap_or_default();
    let pictures = pictures(times.len(), &range)?.into_iter();
    let pictures = pictures.map(|at| (times[at], cameras[at].clone()));
    let (colour, transparent) = (request.background, request.spec.transparent);
    let surroundings = Surroundings::new(scene, colour, transparent)?;
    let views = pictures.map(|(time, camera)| SceneView {
        actors: players.iter().map(|player| player.actor(time)).collect(),
        camera,
        background: match surroundings {
            Some(_) => [0.0; 3],
            None => colour,
        },
    });
    Ok(Film {
        views: views.collect(),
        models,
        surroundings,
        truths: Truths::none(),
        fps: fps / range.step.max(1) as f32,
    })
}

/// Places in a film of `count` pictures of those in `range`, which may go on beyond its end.
fn pictures(count: usize, range: &FilmRange) -> Result<Vec<usize>, JobFailure> {
    let FilmRange { first, step, .. } = *range;
    let refused = |field: &str, message: String| {
        JobFailure::invalid("render", &format!("scene.pictures.{field}"), message)
    };
    if first as usize >= count {
        return Err(refused(
            "first",
            format!("{first}: the film has {count} pictures"),
        ));
    }
    let mut places: Vec<usize> = (first as usize..count)
        .step_by(step.max(1) as usize)
        .collect();
    // Nobody knows before how many pictures a film has.
    if range.count > 0 {
        places.truncate(range.count as usize);
    }
    Ok(places)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_chooses_pictures_that_the_film_has() {
        let chosen = |first, count, step| pictures(10, &FilmRange { first, count, step });
        assert_eq!(chosen(0, 0, 0).expect("all").len(), 10);
        assert_eq!(chosen(4, 2, 3).expect("two"), [4, 7]);
        assert_eq!(chosen(4, 9, 3).expect("two"), [4, 7]);
        let Err(JobFailure::Invalid(found)) = chosen(10, 0, 1) else {
            panic!("there is no such picture");
        };
        assert_eq!(found[0].field, "scene.pictures.first");
    }
}
