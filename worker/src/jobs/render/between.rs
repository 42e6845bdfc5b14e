//! People between two of a model: the same pictures of a row of mixtures.

use super::{Film, cast::Cast, of_one, request::Request};
use crate::jobs::JobFailure;
use yoto_avatar::render::Renderer;
use yoto_proto::v1::{Between, render_spec::What};

/// Adds everybody to `renderer` whom the request wants between its subject and the one of `between`; their
/// slots.
pub(super) fn add(
    mut renderer: Renderer,
    request: &Request<'_>,
    between: &Between,
) -> Result<(Renderer, Vec<usize>), JobFailure> {
    let slot = |subject: &str| {
        let slot = request.slot(subject);
        slot.ok_or_else(|| JobFailure::invalid("render", "between", "it names nobody"))
    };
    let (from, to) = (slot(&request.spec.subject)?, slot(&between.subject)?);
    let mut slots = Vec::new();
    for share in &between.shares {
        let (grown, slot) = renderer
            .with_blend(from, to, *share)
            .map_err(|error| JobFailure::invalid("render", "between", error.to_string()))?;
        renderer = grown;
        slots.push(slot);
    }
    Ok((renderer, slots))
}

/// The pictures of `what` of each mixture, whose `slots` are given, one mixture after the other. Nobody has
/// filmed them.
pub(super) fn film(cast: &Cast<'_>, what: &What, slots: &[usize]) -> Result<Film, JobFailure> {
    let mut all: Option<Film> = None;
    for slot in slots {
        let mut film = of_one(cast, what, Some(*slot))?;
        film.truths = super::Truths::none();
        match &mut all {
            None => all = Some(film),
            Some(all) => all.views.extend(film.views),
        }
    }
    all.ok_or_else(|| JobFailure::invalid("render", "between.shares", "there is none"))
}
