//! The people and the models that a render needs.

use crate::v1::actor::Motion;
use crate::v1::render_spec::What;
use crate::v1::{Actor, Light, RenderSpec, light};

/// A subject whose capture a render or an export needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Need<'a> {
    /// Field of the specification, e.g. `scene.actors[1].subject`.
    pub field: String,
    /// Name of the subject.
    pub subject: &'a str,
    /// Name of the model that draws the person; the subject is needed for that person.
    pub model: &'a str,
    /// Whether the subject must have a slot in that model.
    pub slot: bool,
    /// Field and index of a frame that the capture must have.
    pub frame: Option<(String, u32)>,
}

/// The model that draws an actor of `render`.
pub fn model_of<'a>(render: &'a RenderSpec, actor: &'a Actor) -> &'a str {
    match actor.model.as_str() {
        "" => &render.model,
        own => own,
    }
}

/// The models of a scene other than the render's, each once with the field that names it first, e.g.
/// `scene.actors[1].model`.
pub fn other_models(render: &RenderSpec) -> Vec<(String, &str)> {
    let mut found: Vec<(String, &str)> = Vec::new();
    if let Some(What::Scene(scene)) = &render.what {
        for (i, actor) in scene.actors.iter().enumerate() {
            let model = model_of(render, actor);
            if model != render.model && found.iter().all(|(_, known)| *known != model) {
                found.push((format!("scene.actors[{i}].model"), model));
            }
        }
    }
    found
}

/// The people that `render` needs; a subject may appear more than once.
pub fn needs(render: &RenderSpec) -> Vec<Need<'_>> {
    let mut found = Vec::new();
    if let Some(What::Scene(scene)) = &render.what {
        for (i, actor) in scene.actors.iter().enumerate() {
            let field = |name: &str| format!("scene.actors[{i}].{name}");
            let model = model_of(render, actor);
            let mut own = shown(field("subject"), &actor.subject, model);
            if let Some(Motion::Capture(motion)) = &actor.motion {
                let first = motion.first_frame;
                let frame = first.map(|frame| (field("capture.first_frame"), frame));
                if motion.driver.is_empty() {
                    own.frame = frame;
                } else {
                    let driver = moving(field("capture.driver"), &motion.driver, model, frame);
                    found.push(driver);
                }
            }
            found.push(own);
            found.extend(lighting(
                field("light.subject"),
                actor.light.as_ref(),
                model,
            ));
        }
        return found;
    }
    let model = &*render.model;
    let mut own = shown("subject".into(), &render.subject, model);
    match &render.what {
        Some(What::Orbit(orbit)) => own.frame = Some(("orbit.frame".into(), orbit.frame)),
        Some(What::Clip(clip)) => {
            own.frame = (clip.camera_frame).map(|frame| ("clip.camera_frame".into(), frame));
        }
        Some(What::Motion(motion)) => {
            let frame = (motion.first_frame).map(|frame| ("motion.first_frame".into(), frame));
            found.push(moving("motion.driver".into(), &motion.driver, model, frame));
        }
        Some(What::Views(_) | What::Scene(_)) | None => (),
    }
    found.insert(0, own);
    let other = |it| shown("between.subject".into(), it, model);
    found.extend(render.between.iter().map(|it| other(&*it.subject)));
    if !render.bones.is_empty() {
        found.push(shown("bones".into(), &render.bones, model));
    }
    found.extend(lighting(
        "light.subject".into(),
        render.light.as_ref(),
        model,
    ));
    found
}

fn shown<'a>(field: String, subject: &'a str, model: &'a str) -> Need<'a> {
    Need {
        field,
        subject,
        model,
        slot: true,
        frame: None,
    }
}

fn moving<'a>(
    field: String,
    subject: &'a str,
    model: &'a str,
    frame: Option<(String, u32)>,
) -> Need<'a> {
    Need {
        field,
        subject,
        model,
        slot: false,
        frame,
    }
}

fn lighting<'a>(field: String, light: Option<&'a Light>, model: &'a str) -> Option<Need<'a>> {
    match light?.of.as_ref()? {
        light::Of::Subject(subject) => Some(shown(field, subject, model)),
        light::Of::Neutral(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1::{Actor, CaptureMotion, MotionTransfer, Scene};

    fn light(subject: &str) -> Option<Light> {
        let of = Some(light::Of::Subject(subject.into()));
        Some(Light { of })
    }

    fn listed(render: &RenderSpec) -> Vec<(String, &str, bool, Option<u32>)> {
        let needs = needs(render).into_iter();
        needs
            .map(|it| (it.field, it.subject, it.slot, it.frame.map(|it| it.1)))
            .collect()
    }

    #[test]
    fn a_motion_needs_its_subject_its_driver_and_the_light() {
        let render = RenderSpec {
            subject: "subjects/a".into(),
            what: Some(What::Motion(MotionTransfer {
                driver: "subjects/b".into(),
                first_frame: Some(7),
                ..MotionTransfer::default()
            })),
            light: light("subjects/c"),
            ..RenderSpec::default()
        };
        let expected = [
            ("subject".to_owned(), "subjects/a", true, None),
            ("motion.driver".to_owned(), "subjects/b", false, Some(7)),
            ("light.subject".to_owned(), "subjects/c", true, None),
        ];
        assert_eq!(listed(&render), expected);
    }

    #[test]
    fn a_scene_needs_all_of_its_actors_and_their_drivers() {
        let capture = |driver: &str, frame| {
            Some(Motion::Capture(CaptureMotion {
                driver: driver.into(),
                first_frame: frame,
                ..CaptureMotion::default()
            }))
        };
        let actor = |subject: &str, motion| Actor {
            subject: subject.into(),
            motion,
            ..Actor::default()
        };
        let mut second = actor("subjects/b", capture("subjects/c", Some(9)));
        second.light = light("subjects/a");
        let scene = Scene {
            actors: vec![actor("subjects/a", capture("", Some(3))), second],
            ..Scene::default()
        };
        let render = RenderSpec {
            what: Some(What::Scene(scene)),
            ..RenderSpec::default()
        };
        let at = |index: usize, name: &str| format!("scene.actors[{index}].{name}");
        let expected = [
            (at(0, "subject"), "subjects/a", true, Some(3)),
            (at(1, "capture.driver"), "subjects/c", false, Some(9)),
            (at(1, "subject"), "subjects/b", true, None),
            (at(1, "light.subject"), "subjects/a", true, None),
        ];
        assert_eq!(listed(&render), expected);
    }

    #[test]
    fn people_of_a_scene_are_those_of_their_own_models() {
        let actor = |subject: &str, model: &str| Actor {
            subject: subject.into(),
            model: model.into(),
            light: light("subjects/c"),
            ..Actor::default()
        };
        let models = ["models/fog", "", "models/duo", "models/ice", "models/fog"];
        let actors = models.map(|model| actor("subjects/a", model));
        let render = RenderSpec {
            model: "models/duo".into(),
            what: Some(What::Scene(Scene {
                actors: actors.into(),
                ..Scene::default()
            })),
            ..RenderSpec::default()
        };
        let at = |index: usize| format!("scene.actors[{index}].model");
        let others = [(at(0), "models/fog"), (at(3), "models/ice")];
        assert_eq!(other_models(&render), others);
        let models: Vec<&str> = needs(&render).iter().map(|it| it.model).collect();
        let each = ["fog", "duo", "duo", "ice", "fog"].map(|it| format!("models/{it}"));
        let each = each.iter().flat_map(|it| [it.as_str(); 2]);
        assert_eq!(models, each.collect::<Vec<_>>());
        assert_eq!(other_models(&RenderSpec::default()), []);
    }
}
