//! The request's numbers, checked before a checkpoint is downloaded.

use crate::{
    jobs::{JobFailure, shard},
    media::animation::MAX_FPS,
};
use std::ops::RangeInclusive;
use yoto_avatar::render::SceneView;
use yoto_proto::{
    pose_track::violation,
    render_needs::needs,
    scene,
    v1::{Inputs, RenderSpec, Violation, render_spec::What},
};

/// Sides of a picture, pixels.
pub(super) const SIDES: RangeInclusive<u32> = scene::SIDES;
/// Pictures of one job.
pub(super) const VIEWS: RangeInclusive<u32> = 1..=scene::MAX_PICTURES;

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
        let Some(what) = &spec.what else {
            return Err(JobFailure::invalid(
                "render",
                "what",
                "views, an orbit, a motion or a scene is needed",
            ));
        };
        let violations = check(spec, what);
        if !violations.is_empty() {
            return Err(JobFailure::Invalid(violations));
        }
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

/// Faults of the numbers, by field.
fn check(spec: &RenderSpec, what: &What) -> Vec<Violation> {
    let mut found = Vec::new();
    let mut need = |good: bool, field: &str, message: String| {
        if !good {
            found.push(violation("OUT_OF_RANGE", "render", None, field, message));
        }
    };
    let counted = |count: u32| {
        format!(
            "{count} pictures: {} to {} are allowed",
            VIEWS.start(),
            VIEWS.end()
        )
    };
    let sized = |side: u32| {
        format!(
            "{side} pixels: {} to {} are allowed",
            SIDES.start(),
            SIDES.end()
        )
    };
    match what {
        What::Views(list) => {
            let count = u32::try_from(list.views.len()).unwrap_or(u32::MAX);
            need(VIEWS.contains(&count), "views", counted(count));
        }
        What::Orbit(orbit) => {
            need(
                VIEWS.contains(&orbit.views),
                "orbit.views",
                counted(orbit.views),
            );
            need(SIDES.contains(&orbit.size), "orbit.size", sized(orbit.size));
        }
        What::Clip(clip) => {
            let count = u32::try_from(clip.poses.len()).unwrap_or(u32::MAX);
            need(VIEWS.contains(&count), "clip.poses", counted(count));
            need(SIDES.contains(&clip.size), "clip.size", sized(clip.size));
        }
        What::Scene(scene) => {
            for (field, message) in scene::faults(scene) {
                need(false, &format!("scene.{field}"), message);
            }
        }
        What::Motion(motion) => {
            // 0 means all remaining frames.
            let count = motion.frame_count;
            need(
                count == 0 || VIEWS.contains(&count),
                "motion.frame_count",
                counted(count),
            );
            need(
                SIDES.contains(&motion.size),
                "motion.size",
                sized(motion.size),
            );
        }
    }
    for (field, message) in spec
        .light
        .iter()
        .flat_map(|it| scene::light_faults("light", it))
        .chain(scene::layer_faults(spec))
    {
        need(false, &field, message);
    }
    let colour = &spec.background;
    let visible = colour.iter().all(|value| (0.0..=1.0).contains(value));
    need(
        visible && [0, 3].contains(&colour.len()),
        "background",
        format!("{colour:?}: nothing, or three numbers from 0 to 1"),
    );
    need(
        !spec.transparent || colour.iter().all(|value| *value == 0.0),
        "background",
        format!("{colour:?}: a transparent picture has none"),
    );
    let fps = spec.fps;
    need(
        (0.0..=MAX_FPS).contains(&fps),
        "fps",
        format!("{fps} is not between 0 and {MAX_FPS}"),
    );
    found
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
    use yoto_proto::v1::{
        Actor, CaptureMotion, IdentitySlot, Model, MotionTransfer, Orbit, Scene, ViewList,
        actor::Motion,
    };

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
    fn each_bad_number_is_named() {
        assert_eq!(fields(&orbit(0, 7)), ["orbit.views", "orbit.size"]);
        assert_eq!(fields(&orbit(10_001, 4097)), ["orbit.views", "orbit.size"]);
        let motion = MotionTransfer {
            frame_count: 10_001,
            size: 128,
            ..MotionTransfer::default()
        };
        assert_eq!(
            fields(&RenderSpec {
                what: Some(What::Motion(motion)),
                ..orbit(1, 8)
            }),
            ["motion.frame_count"]
        );
        let none = Some(What::Views(ViewList::default()));
        assert_eq!(
            fields(&RenderSpec {
                what: none,
                ..orbit(1, 8)
            }),
            ["views"]
        );
        assert_eq!(
            fields(&RenderSpec {
                what: None,
                ..orbit(1, 8)
            }),
            ["what"]
        );
        assert_eq!(
            fields(&RenderSpec {
                background: vec![1.0, 0.5],
                ..orbit(1, 8)
            }),
            ["background"]
        );
        assert_eq!(
            fields(&RenderSpec {
                background: vec![f32::NAN; 3],
                ..orbit(1, 8)
            }),
            ["background"]
        );
        assert_eq!(
            fields(&RenderSpec {
                fps: -1.0,
                ..orbit(1, 8)
            }),
            ["fps"]
        );
        assert_eq!(
            fields(&RenderSpec {
                subject: "subjects/b".into(),
                ..orbit(1, 8)
            }),
            ["subject"]
        );
        let mut scene = Scene {
            actors: vec![Actor {
                subject: "subjects/a".into(),
                motion: Some(Motion::Capture(CaptureMotion::default())),
                ..Actor::default()
            }],
            width: 8,
            height: 8,
            ..Scene::default()
        };
        let of = |scene: &Scene| RenderSpec {
            what: Some(What::Scene(scene.clone())),
            ..RenderSpec::default()
        };
        assert_eq!(fields(&of(&scene)), [""; 0]);
        scene.actors[0].subject = "subjects/b".into();
        assert_eq!(fields(&of(&scene)), ["scene.actors[0].subject"]);
        scene.width = 7;
        assert_eq!(fields(&of(&scene)), ["scene.width"]);
    }
}
