//! The models of a render: its own, and in a scene those of other people.

use super::request::{self, Request};
use super::unfilmed;
use crate::jobs::checkpoint::{self, Downloaded};
use crate::jobs::{JobContext, JobFailure, shard};
use std::collections::{BTreeMap, BTreeSet};
use yoto_avatar::render::{
    ModelActor, RenderError, RenderSettings, Rendered, Renderer, SceneView, render_together,
};
use yoto_film::{Bodies, ModelBodies, Person, View};
use yoto_proto::names;
use yoto_proto::render_needs::other_models;
use yoto_proto::v1::{Checkpoint, RenderSpec};
use yoto_proto::worker::v1::Inputs;

/// A model with the checkpoint that draws its people.
pub(super) struct Model<'a> {
    /// `models/{id}`.
    pub(super) name: &'a str,
    pub(super) renderer: Renderer,
    pub(super) downloaded: Downloaded,
}

/// All models of a render.
pub(super) struct Models<'a> {
    pub(super) own: Model<'a>,
    /// Those of a scene's other people, in the order of their first actors.
    others: Vec<Model<'a>>,
    /// As [`Bodies::unfilmed`].
    unfilmed: Vec<Vec<usize>>,
}

impl<'a> Models<'a> {
    /// The models that `request` needs, each with the first complete one of its checkpoints.
    ///
    /// # Errors
    /// A model without a complete checkpoint, and faults of the store.
    pub(super) fn load(
        context: &JobContext,
        request: &Request<'a>,
        inputs: &Inputs,
    ) -> Result<Self, JobFailure> {
        let spec = request.spec;
        let others = other_models(spec);
        let load = |done: usize, name: &'a str| {
            context.report_pieces("loading", done, 1 + others.len());
            let known = request::model(spec, inputs, name).map_or(name, |it| &it.display_name);
            let checkpoints = checkpoints(spec, inputs, name);
            let (renderer, downloaded) = checkpoint::load(context, known, checkpoints, "render")?;
            Ok(Model {
                name,
                renderer,
                downloaded,
            })
        };
        let mut own = load(0, &spec.model)?;
        let names = others.iter().map(|(_, name)| *name).enumerate();
        let loaded = names.map(|(before, name)| load(1 + before, name));
        let others = loaded.collect::<Result<_, JobFailure>>()?;
        let unfilmed;
        (own.renderer, unfilmed) = unfilmed::add(own.renderer, request)?;
        Ok(Self {
            own,
            others,
            unfilmed,
        })
    }

    /// The render's own, then the others.
    pub(super) fn all(&self) -> impl Iterator<Item = &Model<'a>> {
        std::iter::once(&self.own).chain(&self.others)
    }

    /// Whether a scene has people of other models.
    pub(super) fn several(&self) -> bool {
        !self.others.is_empty()
    }

    /// The model with the `index` among all.
    fn at(&self, index: usize) -> Result<&Model<'a>, RenderError> {
        let model = self.all().nth(index);
        model.ok_or(RenderError::NoSuchModel(index))
    }

    /// The model called `name`; the render's own if no other has the name.
    pub(super) fn named(&self, name: &str) -> &Model<'a> {
        let other = self.others.iter().find(|model| model.name == name);
        other.unwrap_or(&self.own)
    }

    /// Replaces the settings of the render's own model.
    pub(super) fn set(&mut self, settings: &RenderSettings) -> Result<(), JobFailure> {
        let set = self.own.renderer.set(settings);
        set.map_err(|error| JobFailure::failed("TRADEOFF", "the chosen settings", &error))
    }

    /// Computes what does not depend on poses for the people in `views`, once for all pictures.
    pub(super) fn prepare(&self, views: &[View]) -> Result<(), JobFailure> {
        let actors = views.iter().flat_map(|view| &view.actors);
        let people: BTreeSet<(usize, usize)> = actors.map(|it| (it.model, it.slot)).collect();
        let mut people = people.into_iter();
        let prepared =
            people.try_for_each(|(model, slot)| self.at(model)?.renderer.prepare([slot]));
        prepared.map_err(|error| JobFailure::failed("INTERNAL", "preparing the people", &error))
    }

    /// What a plan needs to know of the models.
    pub(super) fn bodies(&self, request: &Request<'_>, inputs: &Inputs) -> Bodies {
        let mut models: Vec<ModelBodies> =
            self.all().map(|it| it.bodies(request, inputs)).collect();
        if let Some(own) = models.first_mut() {
            for slot in self.unfilmed.iter().flatten() {
                let skeleton = self.own.renderer.skeleton(*slot).cloned();
                own.skeletons.extend(skeleton.map(|it| (*slot, it)));
            }
        }
        Bodies {
            models,
            unfilmed: self.unfilmed.clone(),
        }
    }

    /// Draws a view, as long as `keep_going` says so. One model draws its people in one pass; several draw together.
    ///
    /// # Errors
    /// As [`Renderer::render_scene`].
    pub(super) fn draw(
        &self,
        view: &View,
        keep_going: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Rendered, RenderError> {
        let scene = scene_view(view);
        if self.others.is_empty() {
            return self.own.renderer.render_scene(&scene, keep_going);
        }
        let people = view.actors.iter().map(|actor| {
            let model = &self.at(actor.model)?.renderer;
            Ok(ModelActor { model, actor })
        });
        let people = people.collect::<Result<Vec<ModelActor<'_>>, RenderError>>()?;
        render_together(&people, &scene.camera, scene.background, keep_going)
    }
}

impl Model<'_> {
    /// Name of the checkpoint.
    pub(super) fn checkpoint(&self) -> String {
        names::checkpoint(self.name, self.downloaded.manifest.step)
    }

    /// The people of `request` that this model draws or lights.
    fn bodies(&self, request: &Request<'_>, inputs: &Inputs) -> ModelBodies {
        let people = request.slots_in(self.name);
        let people: Vec<Person> = people
            .map(|(subject, slot)| Person {
                subject: subject.into(),
                display_name: shard::person(inputs, subject).into(),
                slot,
            })
            .collect();
        let skeletons: BTreeMap<_, _> = people
            .iter()
            .filter_map(|it| Some((it.slot, self.renderer.skeleton(it.slot)?.clone())))
            .collect();
        ModelBodies {
            name: self.name.into(),
            checkpoint: self.downloaded.checkpoint.name.clone(),
            has_light: self.renderer.has_light(),
            people,
            skeletons,
        }
    }
}

/// `view` as the renderer takes it.
pub(super) fn scene_view(view: &View) -> SceneView {
    SceneView {
        actors: view.actors.clone(),
        camera: view.camera.clone(),
        background: view.background,
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
