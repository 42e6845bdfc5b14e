//! People whom nobody has filmed: those between two of a model, and one on another's bones.

use super::{Film, cast::Cast, of_one, request::Request};
use crate::jobs::JobFailure;
use yoto_avatar::render::{Actor, Renderer};
use yoto_proto::v1::{Between, render_spec::What};

/// Somebody whom nobody has filmed: slots of the renderer that are in the picture together, in one pose.
pub(super) type Made = Vec<usize>;

/// Adds everybody to `renderer` whom the request wants between its subject and the one of `between`.
pub(super) fn add(
    mut renderer: Renderer,
    request: &Request<'_>,
    between: &Between,
) -> Result<(Renderer, Vec<Made>), JobFailure> {
    let from = slot(request, &request.spec.subject, "subject")?;
    let to = slot(request, &between.subject, "between.subject")?;
    let mut all = Vec::new();
    for share in &between.shares {
        let (grown, made) = renderer
            .with_blend(from, to, *share)
            .map_err(|error| JobFailure::invalid("render", "between", error.to_string()))?;
        renderer = grown;
        all.push(made);
    }
    Ok((renderer, all))
}

/// Adds the request's subject on the bones of the subject `bones` to `renderer`.
pub(super) fn on_bones(
    renderer: Renderer,
    request: &Request<'_>,
    bones: &str,
) -> Result<(Renderer, Vec<Made>), JobFailure> {
    let refused = |message: String| JobFailure::invalid("render", "bones", message);
    let wearer = slot(request, &request.spec.subject, "subject")?;
    let whose = slot(request, bones, "bones")?;
    let skeleton = renderer.skeleton(whose).cloned();
    let skeleton = skeleton.ok_or_else(|| refused(renderer.absence(whose).to_string()))?;
    let (renderer, made) = renderer
        .with_bones(wearer, &skeleton)
        .map_err(|error| refused(error.to_string()))?;
    Ok((renderer, vec![vec![made]]))
}

fn slot(request: &Request<'_>, subject: &str, field: &str) -> Result<usize, JobFailure> {
    let slot = request.slot(subject);
    slot.ok_or_else(|| JobFailure::invalid("render", field, "it names nobody of the model"))
}

/// The pictures of `what` of everybody who was `made`, one after the other. Nobody has filmed them.
pub(super) fn film(cast: &Cast<'_>, what: &What, made: &[Made]) -> Result<Film, JobFailure> {
    let mut all: Option<Film> = None;
    for slots in made {
        let [first, others @ ..] = slots.as_slice() else {
            continue;
        };
        let mut film = of_one(cast, what, Some(*first))?;
        film.truths = super::Truths::none();
        for view in &mut film.views {
            let also = |slot: &usize| {
                view.actors.first().map(|it| Actor {
                    slot: *slot,
                    ..it.clone()
                })
            };
            let also: Vec<Actor> = others.iter().filter_map(also).collect();
            view.actors.extend(also);
        }
        match &mut all {
            None => all = Some(film),
            Some(all) => all.views.extend(film.views),
        }
    }
    all.ok_or_else(|| JobFailure::invalid("render", "between.shares", "there is none"))
}
