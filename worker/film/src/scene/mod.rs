//! Scenes: several people in one picture, in a world of their own.

mod actor;
mod camera;
mod clock;
mod placement;

use crate::bodies::Bodies;
use crate::captures::Captures;
use crate::error::PlanError;
use crate::layer::Layer;
use crate::plan::{FPS, MAX_FPS, Plan, View, background, wanted_fps};
use crate::shadow::from_above;
use crate::surroundings::Surroundings;
use actor::AnimatedActor;
use yoto_proto::checks::scene::MAX_PICTURES;
use yoto_proto::render_needs::model_of;
use yoto_proto::v1::{FilmRange, RenderSpec, Scene};

pub(crate) use actor::driver;

/// Rounding of a film's length, frames.
const ROUNDING: f64 = 1e-6;

/// Plans all pictures of `scene`.
pub(crate) fn plan(
    spec: &RenderSpec,
    scene: &Scene,
    bodies: &Bodies,
    captures: &Captures,
) -> Result<Plan, PlanError> {
    let mut actors = Vec::new();
    for (i, actor) in scene.actors.iter().enumerate() {
        let field = format!("scene.actors[{i}]");
        let (index, model) = bodies.model(model_of(spec, actor))?;
        actors.push(AnimatedActor::new(actor, &field, index, model, captures)?);
    }
    let natural = actors.iter().find_map(AnimatedActor::fps);
    let natural = natural.map(|fps| fps as f32);
    let fps = wanted_fps(spec).or(natural).unwrap_or(FPS).min(MAX_FPS);
    let times = times(scene.seconds, fps, &actors)?;
    let cameras = camera::cameras(scene, &actors, &times)?;
    let range = scene.pictures.unwrap_or_default();
    let surroundings = Surroundings::new(scene, background(spec));
    let background = match surroundings {
        Some(_) => [0.0; 3],
        None => background(spec),
    };
    let views = chosen(times.len(), &range)?.into_iter().map(|frame| {
        let mut view = View {
            actors: actors.iter().map(|actor| actor.at(times[frame])).collect(),
            camera: cameras[frame].clone(),
            background,
            shadow: None,
        };
        if scene.shadow {
            view.shadow = from_above(&bodies.joints(&view));
        }
        view
    });
    Ok(Plan {
        views: views.collect(),
        layer: Layer::Colours,
        surroundings,
        truth: None,
        fps: fps / range.step.max(1) as f32,
    })
}

/// The frames of a film of `count` pictures that `range` chooses; it may reach beyond the film's end.
fn chosen(count: usize, range: &FilmRange) -> Result<Vec<usize>, PlanError> {
    let FilmRange { first, step, .. } = *range;
    let refused = |field: &str, message: String| {
        PlanError::invalid(&format!("scene.pictures.{field}"), message)
    };
    if first as usize >= count {
        return Err(refused(
            "first",
            format!("{first}: the film has {count} pictures"),
        ));
    }
    let mut frames: Vec<usize> = (first as usize..count)
        .step_by(step.max(1) as usize)
        .collect();
    // The number of pictures of a film is not known before.
    if range.count > 0 {
        frames.truncate(range.count as usize);
    }
    Ok(frames)
}

/// The times of the frames of a film of `seconds`, or with 0 of one that ends with the last motion.
fn times(seconds: f64, fps: f32, actors: &[AnimatedActor]) -> Result<Vec<f64>, PlanError> {
    let rate = f64::from(fps);
    let count = if seconds > 0.0 {
        (seconds * rate).round().max(1.0)
    } else {
        let ends = actors
            .iter()
            .map(|actor| (actor.clock.end(), actor.clock.repeat));
        let frames = ends.map(|(end, repeat)| {
            let frames = (end * rate + ROUNDING).floor();
            // The frame at the end of a round is the first one of the next.
            if repeat { frames } else { frames + 1.0 }
        });
        frames.fold(1.0, f64::max)
    };
    if count > f64::from(MAX_PICTURES) {
        let message = format!("{count} pictures: 1 to {MAX_PICTURES} are allowed");
        return Err(PlanError::invalid("scene.seconds", message));
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
        let chosen = |first, count, step| super::chosen(10, &FilmRange { first, count, step });
        assert_eq!(chosen(0, 0, 0).expect("all").len(), 10);
        assert_eq!(chosen(4, 2, 3).expect("two"), [4, 7]);
        assert_eq!(chosen(4, 9, 3).expect("two"), [4, 7]);
        let Err(PlanError::Invalid(violations)) = chosen(10, 0, 1) else {
            panic!("there is no such picture");
        };
        assert_eq!(violations[0].field, "scene.pictures.first");
    }
}
