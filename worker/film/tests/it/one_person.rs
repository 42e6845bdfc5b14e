//! Renders of one person.

use crate::people::{ANN, BEN, FIELDS, FRAMES, People, SIDE, SPLATS};
use yoto_capture::camera::{Camera, Pose};
use yoto_film::{Captures, Layer, Light, PlanError, plan};
use yoto_proto::checks::scene::MAX_PICTURES;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    self, BodyPose, MotionClip, MotionTransfer, Orbit, RenderSpec, View, ViewList, light,
};

fn spec(model: &str, what: What) -> RenderSpec {
    RenderSpec {
        model: model.into(),
        subject: ANN.into(),
        what: Some(what),
        ..RenderSpec::default()
    }
}

fn motion(driver: &str) -> What {
    What::Motion(MotionTransfer {
        driver: driver.into(),
        frame_step: 2,
        size: SIDE,
        ..MotionTransfer::default()
    })
}

fn orbit(frame: u32) -> What {
    What::Orbit(Orbit {
        frame,
        views: 4,
        size: 32,
    })
}

fn light(of: light::Of) -> Option<v1::Light> {
    Some(v1::Light { of: Some(of) })
}

/// The pose of frame number `frame` of Ann's capture.
fn pose(people: &People, frame: usize) -> Pose {
    Pose::from_frame(&people.shard(ANN).track.frames[frame]).expect("a pose")
}

#[test]
fn listed_views_need_no_capture() {
    let people = People::of(&[FIELDS]);
    let track = &people.shard(ANN).track;
    let camera = Camera::from_frame(&track.frames[1], track.image_size).expect("a camera");
    let rotations = pose(&people, 1).rotations.concat();
    let view = View {
        pose: Some(BodyPose {
            rotations,
            translation: vec![0.5, 0.0, 0.0],
        }),
        camera: Some(camera.to_proto()),
    };
    let spec = RenderSpec {
        background: vec![1.0, 0.5, 0.0],
        ..spec(FIELDS, What::Views(ViewList { views: vec![view] }))
    };
    assert_eq!(people.needs(&spec), []);
    let plan = people.plan(&spec).expect("a plan");
    let [view] = plan.views.as_slice() else {
        panic!("one view");
    };
    assert_eq!(view.camera, camera);
    assert_eq!(view.background, [1.0, 0.5, 0.0]);
    assert_eq!((view.actors[0].model, view.actors[0].slot), (0, 3));
    assert_eq!(view.actors[0].pose.translation, [0.5, 0.0, 0.0]);
    assert_eq!((plan.fps, plan.layer), (15.0, Layer::Colours));
}

#[test]
fn an_orbit_needs_the_track_of_its_subject() {
    let people = People::of(&[FIELDS]);
    let frame = people.shard(ANN).track.frames[2].index;
    let spec = spec(FIELDS, orbit(frame));
    assert_eq!(people.needs(&spec), [(ANN, false)]);
    let plan = people.plan(&spec).expect("a plan");
    assert_eq!(plan.views.len(), 4);
    for view in &plan.views {
        assert_eq!((view.camera.width, view.camera.height), (32, 32));
        assert_eq!(view.actors[0].pose, pose(&people, 2));
    }
}

#[test]
fn a_clip_needs_the_track_of_its_subject() {
    let people = People::of(&[FIELDS]);
    let track = &people.shard(ANN).track;
    let skeleton = v1::Skeleton {
        names: track.skeleton.names.clone(),
        parents: track.skeleton.parents.clone(),
        rest_joints: track.skeleton.rest_joints.concat(),
    };
    let poses = [0, 3].map(|frame| {
        let Pose {
            rotations,
            translation,
        } = pose(&people, frame);
        BodyPose {
            rotations: rotations.concat(),
            translation: translation.to_vec(),
        }
    });
    let clip = MotionClip {
        skeleton: Some(skeleton),
        poses: poses.to_vec(),
        size: 48,
        ..MotionClip::default()
    };
    let spec = spec(FIELDS, What::Clip(clip));
    assert_eq!(people.needs(&spec), [(ANN, false)]);
    let plan = people.plan(&spec).expect("a plan");
    assert_eq!(plan.views.len(), 2);
    let camera = &plan.views[0].camera;
    assert_eq!(camera.width.max(camera.height), 48);
    let begins = plan.views[0].actors[0].pose.translation;
    assert_eq!(begins, pose(&people, 0).translation);
}

#[test]
fn another_person_s_motion_comes_with_the_subject_s_own_light_where_there_is_one() {
    for (model, captures) in [
        (FIELDS, &[(BEN, false)][..]),
        (SPLATS, &[(BEN, false), (ANN, false)]),
    ] {
        let people = People::of(&[model]);
        let spec = spec(model, motion(BEN));
        assert_eq!(people.needs(&spec), captures);
        let plan = people.plan(&spec).expect("a plan");
        assert_eq!(plan.views.len(), FRAMES / 2);
        assert_eq!(plan.fps, 7.5, "every second frame");
        assert!(plan.truth.is_none());
        let lit = plan.views[0].actors[0].light;
        match model {
            FIELDS => assert_eq!(lit, Light::Own),
            _ => assert!(matches!(lit, Light::Of { slot: 3, .. }), "{lit:?}"),
        }
    }
}

#[test]
fn one_s_own_motion_over_black_has_a_truth() {
    let people = People::of(&[FIELDS]);
    let own = spec(FIELDS, motion(ANN));
    assert_eq!(people.needs(&own), [(ANN, true)]);
    let plan = people.plan(&own).expect("a plan");
    let size = (plan.views[1].camera.width, plan.views[1].camera.height);
    let truth = plan.truth.expect("was filmed").picture(1, size);
    let filmed = people.shard(ANN).image(2).resized(SIDE);
    assert_eq!(truth, Some(filmed.rgb));
    let white = RenderSpec {
        background: vec![1.0; 3],
        ..own
    };
    assert_eq!(people.needs(&white), [(ANN, false)]);
    assert!(people.plan(&white).expect("a plan").truth.is_none());
}

#[test]
fn people_who_were_never_filmed_are_shown_one_after_the_other() {
    let mut people = People::of(&[FIELDS]);
    let model = &mut people.bodies.models[0];
    for (new, like) in [(6, 3), (7, 3), (8, 5)] {
        let skeleton = model.skeletons[&like].clone();
        model.skeletons.insert(new, skeleton);
    }
    people.bodies.unfilmed = vec![vec![6, 7], vec![8]];
    let spec = spec(FIELDS, motion(ANN));
    assert_eq!(people.needs(&spec), [(ANN, false)], "there is no truth");
    let plan = people.plan(&spec).expect("a plan");
    let slots = plan.views.iter().map(|view| {
        let slots = view.actors.iter().map(|actor| actor.slot);
        slots.collect::<Vec<_>>()
    });
    let slots: Vec<_> = slots.collect();
    let expected = [vec![vec![6, 7]; FRAMES / 2], vec![vec![8]; FRAMES / 2]].concat();
    assert_eq!(slots, expected);
    assert_eq!(
        plan.views[0].actors[0].pose, plan.views[0].actors[1].pose,
        "in one pose"
    );
}

#[test]
fn requested_light_needs_the_captures_that_it_depends_on() {
    let people = People::of(&[SPLATS]);
    let frame = people.shard(ANN).track.frames[0].index;
    let lit = |of| RenderSpec {
        light: light(of),
        ..spec(SPLATS, orbit(frame))
    };
    let neutral = lit(light::Of::Neutral(true));
    assert_eq!(people.needs(&neutral), [(ANN, false)]);
    let plan = people.plan(&neutral).expect("a plan");
    assert_eq!(plan.views[0].actors[0].light, Light::Neutral);
    let by_ben = lit(light::Of::Subject(BEN.into()));
    assert_eq!(people.needs(&by_ben), [(ANN, false), (BEN, false)]);
    let plan = people.plan(&by_ben).expect("a plan");
    let light = plan.views[0].actors[0].light;
    assert!(matches!(light, Light::Of { slot: 5, .. }), "{light:?}");
    let fields = People::of(&[FIELDS]);
    let refused = RenderSpec {
        model: FIELDS.into(),
        ..by_ben
    };
    let Err(PlanError::Invalid(violations)) = fields.plan(&refused) else {
        panic!("fields have no light");
    };
    assert_eq!(violations[0].field, "light");
}

#[test]
fn depths_reach_from_the_nearest_to_the_farthest_person() {
    let people = People::of(&[FIELDS]);
    let frame = people.shard(ANN).track.frames[0].index;
    let spec = RenderSpec {
        layer: v1::Layer::Depth.into(),
        ..spec(FIELDS, orbit(frame))
    };
    let plan = people.plan(&spec).expect("a plan");
    let [near, far] = plan.layer.range().expect("a depth");
    assert!(0.5 < near && near + 1.0 < far && far < 10.0, "{near} {far}");
}

#[test]
fn what_a_checkpoint_or_the_caller_lacks_is_named() {
    let mut people = People::of(&[FIELDS]);
    let frame = people.shard(ANN).track.frames[0].index;
    let spec = spec(FIELDS, orbit(frame));
    let nothing = Captures::default();
    let Err(PlanError::Failed { code, message }) = plan(&spec, &people.bodies, &nothing) else {
        panic!("the capture is missing");
    };
    assert_eq!(code, "INTERNAL");
    assert!(message.contains(ANN), "{message}");
    people.bodies.models[0].skeletons.clear();
    let Err(PlanError::Failed { code, message }) = people.plan(&spec) else {
        panic!("the skeleton is missing");
    };
    assert_eq!(code, "NO_CHECKPOINT");
    assert!(message.contains("does not know ann"), "{message}");
}

#[test]
fn a_motion_with_too_many_pictures_is_refused_before_they_are_planned() {
    let mut people = People::of(&[FIELDS]);
    let spec = spec(FIELDS, motion(BEN));
    people.bodies.unfilmed = vec![vec![3]; MAX_PICTURES as usize / (FRAMES / 2)];
    assert!(people.plan(&spec).is_ok());
    people.bodies.unfilmed.push(vec![3]);
    let Err(PlanError::Invalid(violations)) = people.plan(&spec) else {
        panic!("too many");
    };
    assert_eq!(violations[0].field, "motion.frame_count");
    let message = &violations[0].message;
    assert!(message.contains("at most 10000"), "{message}");
}
