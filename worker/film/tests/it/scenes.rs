//! Renders of several people.

use crate::people::{ANN, BEN, FIELDS, FRAMES, People, SPLATS};
use yoto_film::{Light, PlanError};
use yoto_proto::v1::actor::Motion;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{Actor, CaptureMotion, FilmRange, RenderSpec, Scene};

fn actor(subject: &str, model: &str, driver: &str) -> Actor {
    Actor {
        subject: subject.into(),
        model: model.into(),
        motion: Some(Motion::Capture(CaptureMotion {
            driver: driver.into(),
            ..CaptureMotion::default()
        })),
        ..Actor::default()
    }
}

fn spec(scene: Scene) -> RenderSpec {
    RenderSpec {
        model: FIELDS.into(),
        what: Some(What::Scene(Scene {
            width: 40,
            height: 30,
            ..scene
        })),
        ..RenderSpec::default()
    }
}

#[test]
fn everybody_is_drawn_by_their_model_and_stands_on_the_ground() {
    let people = People::of(&[FIELDS, SPLATS]);
    let ben = Actor {
        at: vec![1.5, -0.5],
        ..actor(BEN, SPLATS, ANN)
    };
    let spec = spec(Scene {
        actors: vec![actor(ANN, "", ""), ben],
        shadow: true,
        ..Scene::default()
    });
    // The same capture twice: each model has refined its poses. Splats are lit as in their own capture.
    assert_eq!(
        people.needs(&spec),
        [(ANN, false), (ANN, false), (BEN, false)]
    );
    let plan = people.plan(&spec).expect("a plan");
    assert_eq!(plan.views.len(), FRAMES);
    for view in &plan.views {
        let [ann, ben] = view.actors.as_slice() else {
            panic!("two people");
        };
        assert_eq!((ann.model, ann.slot, ann.light), (0, 3, Light::Own));
        assert_eq!((ben.model, ben.slot), (1, 5));
        assert!(matches!(ben.light, Light::Of { slot: 5, .. }));
        assert_eq!((view.camera.width, view.camera.height), (40, 30));
        let above = view.shadow.as_ref().expect("a shadow");
        assert!(above.centre()[1] > 50.0, "{:?}", above.centre());
    }
    let surroundings = plan.surroundings.expect("the ground of the shadow");
    assert!(surroundings.backdrop.is_none());
}

#[test]
fn a_range_of_a_film_is_a_part_of_its_plan() {
    let people = People::of(&[FIELDS]);
    let scene = Scene {
        actors: vec![actor(ANN, "", "")],
        ..Scene::default()
    };
    let whole = people.plan(&spec(scene.clone())).expect("a plan");
    let part = |first| {
        let range = FilmRange {
            first,
            count: 2,
            step: 2,
        };
        people.plan(&spec(Scene {
            pictures: Some(range),
            ..scene.clone()
        }))
    };
    let some = part(1).expect("a plan");
    assert_eq!(some.views.len(), 2);
    for (view, expected) in some.views.iter().zip([&whole.views[1], &whole.views[3]]) {
        assert_eq!(view.camera, expected.camera);
        assert_eq!(view.actors[0].pose, expected.actors[0].pose);
        assert_eq!(view.shadow, None);
    }
    assert_eq!((whole.fps, some.fps), (15.0, 7.5));
    let Err(PlanError::Invalid(violations)) = part(FRAMES as u32) else {
        panic!("there is no such picture");
    };
    assert_eq!(violations[0].field, "scene.pictures.first");
}

#[test]
fn an_actor_without_a_motion_is_named() {
    let people = People::of(&[FIELDS]);
    let still = Actor {
        motion: None,
        ..actor(BEN, "", "")
    };
    let spec = spec(Scene {
        actors: vec![actor(ANN, "", ""), still],
        ..Scene::default()
    });
    let Err(PlanError::Invalid(violations)) = people.plan(&spec) else {
        panic!("refused");
    };
    assert_eq!(violations[0].field, "scene.actors[1]");
}
