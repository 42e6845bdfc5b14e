//! The captures that a plan reads.

use crate::bodies::{Bodies, ModelBodies};
use crate::light::{LightSource, source_for_actor, source_for_one_person};
use crate::one_person::world;
use crate::scene::driver;
use crate::truth::repeats_own_motion;
use yoto_proto::render_needs::model_of;
use yoto_proto::v1::actor::Motion;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{Actor, RenderSpec};

/// A capture that a plan reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CaptureNeed<'a> {
    /// The model whose poses of the capture are meant: training refines them.
    pub model: &'a str,
    /// Name of the subject.
    pub subject: &'a str,
    /// Whether the plan keeps the pictures, and not the track alone.
    pub pictures: bool,
}

/// The captures that [`plan`](crate::plan()) reads for `spec`, each once. Far fewer than
/// [`yoto_proto::render_needs::needs`] may be enough: listed views and the motions of files come without any.
pub fn needs<'a>(spec: &'a RenderSpec, bodies: &Bodies) -> Vec<CaptureNeed<'a>> {
    let mut needs = Needs(Vec::new());
    match &spec.what {
        None => (),
        Some(What::Scene(scene)) => {
            for actor in &scene.actors {
                needs.add_actor(spec, actor, bodies);
            }
        }
        Some(what) => needs.add_one_person(spec, what, bodies),
    }
    needs.0
}

struct Needs<'a>(Vec<CaptureNeed<'a>>);

impl<'a> Needs<'a> {
    fn add(&mut self, model: &'a str, subject: &'a str, pictures: bool) {
        let mut known = self.0.iter_mut();
        match known.find(|need| (need.model, need.subject) == (model, subject)) {
            Some(need) => need.pictures |= pictures,
            None => self.0.push(CaptureNeed {
                model,
                subject,
                pictures,
            }),
        }
    }

    fn add_one_person(&mut self, spec: &'a RenderSpec, what: &'a What, bodies: &Bodies) {
        let model = &*spec.model;
        let world = world(spec, what);
        match what {
            What::Views(_) | What::Scene(_) => (),
            What::Orbit(_) | What::Clip(_) => self.add(model, world, false),
            What::Motion(motion) => {
                let pictures = bodies.unfilmed.is_empty() && repeats_own_motion(spec, motion);
                self.add(model, world, pictures);
            }
        }
        if has_light(bodies, model)
            && let LightSource::Capture(subject) = source_for_one_person(spec, world)
        {
            self.add(model, world, false);
            self.add(model, subject, false);
        }
    }

    fn add_actor(&mut self, spec: &'a RenderSpec, actor: &'a Actor, bodies: &Bodies) {
        let model = model_of(spec, actor);
        if let Some(Motion::Capture(motion)) = &actor.motion {
            self.add(model, driver(actor, motion), false);
        }
        if has_light(bodies, model)
            && let LightSource::Capture(subject) = source_for_actor(actor)
        {
            self.add(model, subject, false);
        }
    }
}

fn has_light(bodies: &Bodies, model: &str) -> bool {
    let model = bodies.model(model);
    model.is_ok_and(|(_, ModelBodies { has_light, .. })| *has_light)
}
