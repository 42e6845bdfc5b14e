//! The people whom a render needs.

use crate::v1::{Light, RenderSpec, actor::Motion, light, render_spec::What};

/// A subject whose capture a render or an export needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Need<'a> {
    /// Field of the specification, e.g. `scene.actors[1].subject`.
    pub field: String,
    /// Name of the subject.
    pub subject: &'a str,
    /// Whether the subject must have a slot in the model.
    pub slot: bool,
    /// Field and index of a frame that the capture must have.
    pub frame: Option<(String, u32)>,
}

/// Everybody whom `render` needs; a subject may come more than once.
pub fn needs(render: &RenderSpec) -> Vec<Need<'_>> {
    let mut found = Vec::new();
    if let Some(What::Scene(scene)) = &render.what {
        for (i, actor) in scene.actors.iter().enumerate() {
            let field = |name: &str| format!("scene.actors[{i}].{name}");
            let mut own = shown(field("subject"), &actor.subject);
            if let Some(Motion::Capture(motion)) = &actor.motion {
                let first = motion.first_frame;
                let frame = first.map(|frame| (field("capture.first_frame"), frame));
                if motion.driver.is_empty() {
                    own.frame = frame;
                } else {
                    let driver = moving(field("capture.driver"), &motion.driver, frame);
                    found.push(driver);
                }
            }
            found.push(own);
            found.extend(lighting(field("light.subject"), actor.light.as_ref()));
        }
        return found;
    }
    let mut own = shown("subject".into(), &render.subject);
    match &render.what {
        Some(What::Orbit(orbit)) => own.frame = Some(("orbit.frame".into(), orbit.frame)),
        Some(What::Clip(clip)) => {
            own.frame = (clip.camera_frame).map(|frame| ("clip.camera_frame".into(), frame));
        }
        Some(What::Motion(motion)) => {
            let frame = (motion.first_frame).map(|frame| ("motion.first_frame".into(), frame));
            found.push(moving("motion.driver".into(), &motion.driver, frame));
        }
        Some(What::Views(_) | What::Scene(_)) | None => (),
    }
    found.insert(0, own);
    found.extend((render.between.iter()).map(|it| shown("between.subject".into(), &it.subject)));
    if !render.bones.is_empty() {
        found.push(shown("bones".into(), &render.bones));
    }
    found.extend(lighting("light.subject".into(), render.light.as_ref()));
    found
}

fn shown(field: String, subject: &str) -> Need<'_> {
    Need {
        field,
        subject,
        slot: true,
        frame: None,
    }
}

fn moving(field: String, subject: &str, frame: Option<(String, u32)>) -> Need<'_> {
    Need {
        field,
        subject,
        slot: false,
        frame,
    }
}

fn lighting(field: String, light: Option<&Light>) -> Option<Need<'_>> {
    match light?.of.as_ref()? {
        light::Of::Subject(subject) => Some(shown(field, subject)),
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
        let at = |place: usize, name: &str| format!("scene.actors[{place}].{name}");
        let expected = [
            (at(0, "subject"), "subjects/a", true, Some(3)),
            (at(1, "capture.driver"), "subjects/c", false, Some(9)),
            (at(1, "subject"), "subjects/b", true, None),
            (at(1, "light.subject"), "subjects/a", true, None),
        ];
        assert_eq!(listed(&render), expected);
    }
}
