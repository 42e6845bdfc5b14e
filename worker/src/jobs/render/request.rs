//! The request's numbers, checked before a checkpoint is downloaded.

use crate::jobs::{JobFailure, shard};
use yoto_avatar::render::SceneView;
use yoto_proto::{
    checks::render,
    render_needs::needs,
    v1::{Inputs, RenderSpec, render_spec::What},
};

/// A valid request.
#[derive(Debug)]
pub(super) struct Request<'a> {
    pub(super) spec: &'a RenderSpec,
    pub(super) what: &'a What,
    /// Slots of everybody who is shown or lights others, by subject.
    slots: Vec<(&'a str, usize)>,
    pub(super) background: [f32; 3],
    /// Frames per second of the animation, if the request says it.
    pub(super) fps: Option<f32>,
}

impl<'a> Request<'a> {
    pub(super) fn new(spec: &'a RenderSpec, inputs: &Inputs) -> Result<Self, JobFailure> {
        JobFailure::refuse("render", render::faults(spec))?;
        let Some(what) = &spec.what else {
            return Err(JobFailure::invalid("render", "what", "is missing"));
        };
        let model = inputs.model.iter().flat_map(|model| &model.slots);
        let mut slots = Vec::new();
        for need in needs(spec).into_iter().filter(|need| need.slot) {
            let slot = model.clone().find(|slot| slot.subject == need.subject);
            let Some(slot) = slot else {
                let person = shard::person(inputs, need.subject);
                let message = format!("{person} is not in {}", shard::model(inputs));
                return Err(JobFailure::invalid("render", &need.field, message));
            };
            slots.push((need.subject, slot.slot as usize));
        }
        Ok(Self {
            spec,
            what,
            slots,
            background: spec.background.as_slice().try_into().unwrap_or([0.0; 3]),
            fps: (spec.fps != 0.0).then_some(spec.fps),
        })
    }

    /// The slot of somebody whom the request shows, or whose light.
    pub(super) fn slot(&self, subject: &str) -> Option<usize> {
        let known = self.slots.iter().find(|(name, _)| *name == subject);
        known.map(|(_, slot)| *slot)
    }
}

/// An animation has one size.
pub(super) fn same_size(views: &[SceneView]) -> Result<(), JobFailure> {
    let size = |view: &SceneView| (view.camera.width, view.camera.height);
    match views.iter().position(|view| size(view) != size(&views[0])) {
        None => Ok(()),
        Some(odd) => Err(JobFailure::invalid(
            "render",
            &format!("views[{odd}].camera"),
            "every view of an animation must have the size of the first",
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::{Actor, CaptureMotion, IdentitySlot, Model, Orbit, Scene, actor::Motion};

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

    #[test]
    fn a_good_request_gets_its_slot_and_defaults() {
        let spec = orbit(12, 128);
        let inputs = inputs();
        let request = Request::new(&spec, &inputs).expect("good");
        assert_eq!(
            (request.slot("subjects/a"), request.background, request.fps),
            (Some(4), [0.0; 3], None)
        );
    }

    #[test]
    fn an_order_that_its_checks_refuse_is_refused() {
        assert_eq!(fields(&orbit(0, 7)), ["orbit.views", "orbit.size"]);
    }

    #[test]
    fn everybody_who_is_shown_has_a_slot() {
        let stranger = RenderSpec {
            subject: "subjects/b".into(),
            ..orbit(1, 8)
        };
        assert_eq!(fields(&stranger), ["subject"]);
        let with = |subject: &str| {
            let actor = Actor {
                subject: subject.into(),
                motion: Some(Motion::Capture(CaptureMotion::default())),
                ..Actor::default()
            };
            let scene = Scene {
                actors: vec![actor],
                width: 8,
                height: 8,
                ..Scene::default()
            };
            RenderSpec {
                what: Some(What::Scene(scene)),
                ..RenderSpec::default()
            }
        };
        assert_eq!(fields(&with("subjects/a")), [""; 0]);
        assert_eq!(fields(&with("subjects/b")), ["scene.actors[0].subject"]);
    }
}
