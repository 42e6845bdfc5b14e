//! What a plan knows of the models: who is in which slot, and their skeletons.

use crate::error::PlanError;
use crate::plan::View;
use std::collections::BTreeMap;
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::transform::Vec3;

/// The bodies of all people in a render.
#[derive(Debug, Default)]
pub struct Bodies {
    /// The render's own model first, then the other models of a scene.
    pub models: Vec<ModelBodies>,
    /// People without a capture who replace the subject: blends of two people, or the subject on the bones of
    /// another person. Each consists of slots of the render's own model, which are drawn together in one pose.
    pub unfilmed: Vec<Vec<usize>>,
}

/// The people of one model.
#[derive(Debug, Default)]
pub struct ModelBodies {
    /// `models/{id}`.
    pub name: String,
    /// Name of the checkpoint that draws them.
    pub checkpoint: String,
    /// Whether people can be lit otherwise than in their captures.
    pub has_light: bool,
    /// The people of the request that this model draws or lights.
    pub people: Vec<Person>,
    /// By slot. A person who joined the model after the checkpoint has none.
    pub skeletons: BTreeMap<usize, Skeleton>,
}

/// A person of a model.
#[derive(Debug)]
pub struct Person {
    /// `subjects/{id}`.
    pub subject: String,
    /// Their name for people.
    pub display_name: String,
    /// Slot of their identity in the model.
    pub slot: usize,
}

impl Bodies {
    /// The render's own model.
    pub(crate) fn own(&self) -> Result<&ModelBodies, PlanError> {
        let own = self.models.first();
        own.ok_or_else(|| PlanError::internal("there is no model".into()))
    }

    /// The model called `name`, with its index.
    pub(crate) fn model(&self, name: &str) -> Result<(usize, &ModelBodies), PlanError> {
        let mut models = self.models.iter().enumerate();
        let model = models.find(|(_, model)| model.name == name);
        model.ok_or_else(|| PlanError::internal(format!("{name} was not loaded")))
    }

    /// Positions of all joints of a view, metres.
    pub(crate) fn joints(&self, view: &View) -> Vec<Vec3> {
        let joints = view.actors.iter().flat_map(|actor| {
            let model = self.models.get(actor.model);
            let skeleton = model.and_then(|model| model.skeletons.get(&actor.slot));
            skeleton.map_or_else(Vec::new, |skeleton| skeleton.posed_joints(&actor.pose))
        });
        joints.collect()
    }
}

impl ModelBodies {
    fn person(&self, subject: &str) -> Result<&Person, PlanError> {
        let person = self.people.iter().find(|person| person.subject == subject);
        person.ok_or_else(|| PlanError::internal(format!("the request does not name {subject}")))
    }

    /// The slot of a person of the request.
    pub(crate) fn slot(&self, subject: &str) -> Result<usize, PlanError> {
        Ok(self.person(subject)?.slot)
    }

    /// The skeleton of a person of the request.
    pub(crate) fn skeleton(&self, subject: &str) -> Result<&Skeleton, PlanError> {
        let person = self.person(subject)?;
        let skeleton = self.skeletons.get(&person.slot);
        skeleton.ok_or_else(|| PlanError::Failed {
            code: "NO_CHECKPOINT",
            message: format!(
                "{} does not know {}: it was trained before they joined the model",
                self.checkpoint, person.display_name
            ),
        })
    }
}
