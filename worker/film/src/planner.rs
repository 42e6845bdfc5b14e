//! The planner: from a specification, bodies and captures to a plan.

use crate::bodies::Bodies;
use crate::captures::Captures;
use crate::error::PlanError;
use crate::layer::Layer;
use crate::plan::Plan;
use crate::{one_person, scene};
use yoto_proto::v1::RenderSpec;
use yoto_proto::v1::render_spec::What;

/// Plans the pictures of `spec`, which [`yoto_proto::checks::render::faults`] accepts. `captures` has all that
/// [`needs`](crate::needs()) lists for the same `spec` and `bodies`.
///
/// # Errors
/// A request that does not fit its captures, and people who joined the model after the checkpoint.
pub fn plan(spec: &RenderSpec, bodies: &Bodies, captures: &Captures) -> Result<Plan, PlanError> {
    let mut plan = match &spec.what {
        None => return Err(PlanError::invalid("what", "is missing")),
        Some(What::Scene(scene)) => scene::plan(spec, scene, bodies, captures)?,
        Some(what) => one_person::plan(spec, what, bodies, captures)?,
    };
    plan.layer = Layer::new(spec.layer(), bodies, &plan.views);
    Ok(plan)
}
