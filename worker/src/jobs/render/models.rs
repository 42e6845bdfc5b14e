//! The models of a render: its own, and in a scene those of other people. One alone draws its people as ever;
//! several draw together, each the people of its own.

use super::request;
use crate::jobs::{
    JobContext, JobFailure,
    checkpoint::{self, Downloaded},
};
use yoto_avatar::render::{Guest, RenderError, Rendered, Renderer, SceneView, render_together};
use yoto_capture::skeleton::transform::Vec3;
use yoto_proto::{
    names,
    render_needs::other_models,
    v1::{Checkpoint, Inputs, RenderSpec},
};

/// A model with the checkpoint that draws its people.
pub(super) struct Loaded<'a> {
    /// `models/{id}`.
    pub(super) name: &'a str,
    pub(super) renderer: Renderer,
    pub(super) found: Downloaded,
}

/// All models of a render.
pub(super) struct Models<'a> {
    pub(super) own: Loaded<'a>,
    /// Those of a scene's other people, in the order of their first actors.
    pub(super) others: Vec<Loaded<'a>>,
}

impl<'a> Models<'a> {
    /// The models that `spec` needs, each with the first complete one of its checkpoints.
    ///
    /// # Errors
    /// A model without a complete checkpoint, and faults of the store.
    pub(super) fn load(
        context: &JobContext,
        spec: &'a RenderSpec,
        inputs: &Inputs,
    ) -> Result<Self, JobFailure> {
        let others = other_models(spec);
        let load = |done: usize, name: &'a str| {
            context.report_pieces("loading", done, 1 + others.len());
            let known = request::model(spec, inputs, name).map_or(name, |it| &it.display_name);
            let checkpoints = checkpoints(spec, inputs, name);
            let (renderer, found) = checkpoint::load(context, known, checkpoints, "render")?;
            Ok(Loaded {
                name,
                renderer,
                found,
            })
        };
        let own = load(0, &spec.model)?;
        let names = others.iter().map(|(_, name)| *name).enumerate();
        let loaded = names.map(|(before, name)| load(1 + before, name));
        let others = loaded.collect::<Result<_, JobFailure>>()?;
        Ok(Self { own, others })
    }

    /// The render's own, then the others.
    pub(super) fn all(&self) -> impl Iterator<Item = &Loaded<'a>> {
        std::iter::once(&self.own).chain(&self.others)
    }
}

impl Loaded<'_> {
    /// Name of the checkpoint.
    pub(super) fn checkpoint(&self) -> String {
        names::checkpoint(self.name, self.found.manifest.step)
    }
}

/// The checkpoints of the model called `name`, the one to load first.
fn checkpoints<'a>(spec: &RenderSpec, inputs: &'a Inputs, name: &str) -> &'a [Checkpoint] {
    if name == spec.model {
        return &inputs.checkpoints;
    }
    let mut others = inputs.other_models.iter();
    let other = others.find(|it| it.model.as_ref().is_some_and(|model| model.name == name));
    other.map_or(&[], |it| &it.checkpoints)
}

/// Which model draws each actor of a view: a place among the other models, or none for the render's own.
pub(super) type PaintedBy = Vec<Option<usize>>;

/// The people of a film, each with the model that draws them.
#[derive(Clone, Copy)]
pub(super) struct Troupe<'a> {
    pub(super) models: &'a Models<'a>,
    /// The same in all views. Actors beyond its end are of the render's own model.
    pub(super) by: &'a PaintedBy,
}

impl Troupe<'_> {
    /// The renderer of actor number `place` of a view.
    fn renderer(&self, place: usize) -> &Renderer {
        let other = self.by.get(place).copied().flatten();
        let other = other.and_then(|other| self.models.others.get(other));
        &other.unwrap_or(&self.models.own).renderer
    }

    /// The positions of all joints of a view, metres.
    pub(super) fn joints(&self, view: &SceneView) -> Vec<Vec3> {
        let bodies = view.actors.iter().enumerate().map(|(place, actor)| {
            let body = self.renderer(place).skeleton(actor.slot);
            body.map_or_else(Vec::new, |body| body.posed_joints(&actor.pose))
        });
        bodies.flatten().collect()
    }

    /// Draws a view, as long as `go_on` says so.
    ///
    /// # Errors
    /// As [`Renderer::render_scene`].
    pub(super) fn draw(
        &self,
        view: &SceneView,
        go_on: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Rendered, RenderError> {
        if self.models.others.is_empty() {
            return self.models.own.renderer.render_scene(view, go_on);
        }
        let guests = view.actors.iter().enumerate().map(|(place, actor)| Guest {
            model: self.renderer(place),
            actor,
        });
        let guests: Vec<Guest<'_>> = guests.collect();
        render_together(&guests, &view.camera, view.background, go_on)
    }
}
