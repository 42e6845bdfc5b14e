//! People without a capture: blends of two people of a model, and a person on the bones of another one.

use super::request::Request;
use crate::jobs::JobFailure;
use yoto_avatar::render::Renderer;
use yoto_proto::v1::Between;

/// Adds the people without a capture that replace the request's subject to `renderer`. Returns the slots of
/// each person, which are drawn together in one pose. Empty if the request shows its subject.
pub(super) fn add(
    renderer: Renderer,
    request: &Request<'_>,
) -> Result<(Renderer, Vec<Vec<usize>>), JobFailure> {
    match &request.spec.between {
        Some(between) => add_blends(renderer, request, between),
        None if request.spec.bones.is_empty() => Ok((renderer, Vec::new())),
        None => add_on_bones(renderer, request, &request.spec.bones),
    }
}

/// Adds a person for each share between the request's subject and the one of `between`.
fn add_blends(
    mut renderer: Renderer,
    request: &Request<'_>,
    between: &Between,
) -> Result<(Renderer, Vec<Vec<usize>>), JobFailure> {
    let from = slot(request, &request.spec.subject, "subject")?;
    let to = slot(request, &between.subject, "between.subject")?;
    let mut people = Vec::new();
    for share in &between.shares {
        let (with_blend, slots) = renderer
            .with_blend(from, to, *share)
            .map_err(|error| JobFailure::invalid("render", "between", error.to_string()))?;
        renderer = with_blend;
        people.push(slots);
    }
    Ok((renderer, people))
}

/// Adds the request's subject on the bones of the subject `bones`.
fn add_on_bones(
    renderer: Renderer,
    request: &Request<'_>,
    bones: &str,
) -> Result<(Renderer, Vec<Vec<usize>>), JobFailure> {
    let refused = |message: String| JobFailure::invalid("render", "bones", message);
    let subject = slot(request, &request.spec.subject, "subject")?;
    let other = slot(request, bones, "bones")?;
    let skeleton = renderer.skeleton(other).cloned();
    let skeleton = skeleton.ok_or_else(|| refused(renderer.absence(other).to_string()))?;
    let (renderer, slot) = renderer
        .with_bones(subject, &skeleton)
        .map_err(|error| refused(error.to_string()))?;
    Ok((renderer, vec![vec![slot]]))
}

fn slot(request: &Request<'_>, subject: &str, field: &str) -> Result<usize, JobFailure> {
    let slot = request.slot(subject);
    slot.ok_or_else(|| JobFailure::invalid("render", field, "it names no person of the model"))
}
