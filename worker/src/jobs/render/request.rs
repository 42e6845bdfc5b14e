//! The request's numbers, checked before a checkpoint is downloaded.

use crate::jobs::{JobFailure, shard};
use yoto_proto::checks::render;
use yoto_proto::render_needs::needs;
use yoto_proto::v1::{Model, RenderSpec};
use yoto_proto::worker::v1::Inputs;

/// A valid request.
#[derive(Debug)]
pub(super) struct Request<'a> {
    pub(super) spec: &'a RenderSpec,
    /// Slots of everybody who is shown or lights others, by model and subject.
    slots: Vec<([&'a str; 2], usize)>,
}

impl<'a> Request<'a> {
    pub(super) fn new(spec: &'a RenderSpec, inputs: &Inputs) -> Result<Self, JobFailure> {
        JobFailure::refuse("render", render::faults(spec))?;
        if spec.what.is_none() {
            return Err(JobFailure::invalid("render", "what", "is missing"));
        }
        let mut slots = Vec::new();
        for need in needs(spec).into_iter().filter(|need| need.slot) {
            let model = model(spec, inputs, need.model);
            let known = model.map_or(&[][..], |model| &model.slots);
            let Some(slot) = known.iter().find(|slot| slot.subject == need.subject) else {
                let person = shard::person(inputs, need.subject);
                let model = model.map_or(need.model, |model| &model.display_name);
                let message = format!("{person} is not in {model}");
                return Err(JobFailure::invalid("render", &need.field, message));
            };
            slots.push(([need.model, need.subject], slot.slot as usize));
        }
        Ok(Self { spec, slots })
    }

    /// The slot of `subject` in the render's own model.
    pub(super) fn slot(&self, subject: &str) -> Option<usize> {
        let mut slots = self.slots_in(&self.spec.model);
        slots.find(|it| it.0 == subject).map(|(_, slot)| slot)
    }

    /// The people that `model` draws or lights for the request, with their slots. A person may come more than
    /// once.
    pub(super) fn slots_in(&self, model: &str) -> impl Iterator<Item = (&'a str, usize)> {
        let of_model = self
            .slots
            .iter()
            .filter(move |([name, _], _)| *name == model);
        of_model.map(|([_, subject], slot)| (*subject, *slot))
    }
}

/// The model called `name`, one of those that `spec` needs.
pub(super) fn model<'a>(spec: &RenderSpec, inputs: &'a Inputs, name: &str) -> Option<&'a Model> {
    if name == spec.model {
        return inputs.model.as_ref();
    }
    let mut others = inputs
        .other_models
        .iter()
        .filter_map(|it| it.model.as_ref());
    others.find(|model| model.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::actor::Motion;
    use yoto_proto::v1::render_spec::What;
    use yoto_proto::v1::{Actor, CaptureMotion, IdentitySlot, Model, Orbit, Scene};
    use yoto_proto::worker::v1::OtherModel;

    fn orbit(views: u32, size: u32) -> RenderSpec {
        RenderSpec {
            subject: "subjects/a".into(),
            what: Some(What::Orbit(Orbit {
                frame: 0,
                views,
                size,
            })),
            ..RenderSpec::default()
        }
    }

    fn inputs() -> Inputs {
        let slot = IdentitySlot {
            slot: 4,
            subject: "subjects/a".into(),
            trained: true,
        };
        let model = Model {
            slots: vec![slot],
            ..Model::default()
        };
        Inputs {
            model: Some(model),
            ..Inputs::default()
        }
    }

    fn fields(spec: &RenderSpec) -> Vec<String> {
        match Request::new(spec, &inputs()) {
            Err(JobFailure::Invalid(found)) => found.into_iter().map(|v| v.field).collect(),
            Err(other) => panic!("{other:?}"),
            Ok(_) => Vec::new(),
        }
    }

    fn actor(subject: &str, model: &str) -> Actor {
        Actor {
            subject: subject.into(),
            model: model.into(),
            motion: Some(Motion::Capture(CaptureMotion::default())),
            ..Actor::default()
        }
    }

    fn scene_of(actors: Vec<Actor>) -> RenderSpec {
        let scene = Scene {
            actors,
            width: 8,
            height: 8,
            ..Scene::default()
        };
        RenderSpec {
            what: Some(What::Scene(scene)),
            ..RenderSpec::default()
        }
    }

    #[test]
    fn a_good_request_gets_its_slot() {
        let spec = orbit(12, 128);
        let inputs = inputs();
        let request = Request::new(&spec, &inputs).expect("good");
        assert_eq!(request.slot("subjects/a"), Some(4));
    }

    #[test]
    fn an_order_that_its_checks_refuse_is_refused() {
        assert_eq!(fields(&orbit(0, 7)), ["orbit.views", "orbit.size"]);
    }

    #[test]
    fn everybody_has_a_slot_in_the_model_that_draws_them() {
        let mut inputs = inputs();
        let slot = |slot, subject: &str| IdentitySlot {
            slot,
            subject: subject.into(),
            trained: true,
        };
        inputs.other_models = vec![OtherModel {
            model: Some(Model {
                name: "models/fog".into(),
                slots: vec![slot(1, "subjects/a"), slot(2, "subjects/b")],
                ..Model::default()
            }),
            checkpoints: Vec::new(),
        }];
        let with = |last: Actor| {
            let [duo, fog] = ["", "models/fog"].map(|model| actor("subjects/a", model));
            scene_of(vec![duo, fog, last])
        };
        let spec = with(actor("subjects/b", "models/fog"));
        let request = Request::new(&spec, &inputs).expect("good");
        assert_eq!(request.slot("subjects/a"), Some(4));
        let fog: Vec<_> = request.slots_in("models/fog").collect();
        assert_eq!(fog, [("subjects/a", 1), ("subjects/b", 2)]);
        for stranger in [
            actor("subjects/b", ""),
            actor("subjects/c", "models/fog"),
            actor("subjects/a", "models/ice"),
        ] {
            let Err(JobFailure::Invalid(found)) = Request::new(&with(stranger), &inputs).map(drop)
            else {
                panic!("no such slot");
            };
            assert_eq!(found[0].field, "scene.actors[2].subject");
        }
    }

    #[test]
    fn everybody_who_is_shown_has_a_slot() {
        let stranger = RenderSpec {
            subject: "subjects/b".into(),
            ..orbit(1, 8)
        };
        assert_eq!(fields(&stranger), ["subject"]);
        let with = |subject: &str| scene_of(vec![actor(subject, "")]);
        assert_eq!(fields(&with("subjects/a")), [""; 0]);
        assert_eq!(fields(&with("subjects/b")), ["scene.actors[0].subject"]);
    }
}
