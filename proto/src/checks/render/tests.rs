use super::*;
use crate::v1::actor::Motion;
use crate::v1::{
    Actor, BodyPose, Camera, CaptureMotion, Light, MotionClip, MotionTransfer, Orbit, Scene,
    Skeleton, View, ViewList,
};

fn with(what: What) -> RenderSpec {
    RenderSpec {
        what: Some(what),
        ..RenderSpec::default()
    }
}

fn orbit(views: u32, size: u32) -> RenderSpec {
    with(What::Orbit(Orbit {
        frame: 0,
        views,
        size,
    }))
}

fn fields(spec: &RenderSpec) -> Vec<String> {
    faults(spec).into_iter().map(|it| it.field).collect()
}

fn view() -> View {
    View {
        pose: Some(BodyPose {
            rotations: vec![0.0; 72],
            translation: vec![0.0; 3],
        }),
        camera: Some(Camera {
            width: 64,
            height: 64,
            intrinsics: vec![1.0; 9],
            extrinsics: vec![0.0; 16],
        }),
    }
}

fn views(views: Vec<View>) -> RenderSpec {
    with(What::Views(ViewList { views }))
}

#[test]
fn each_bad_number_is_named() {
    assert_eq!(faults(&orbit(12, 128)), []);
    assert_eq!(fields(&orbit(0, 7)), ["orbit.views", "orbit.size"]);
    assert_eq!(fields(&orbit(10_001, 4097)), ["orbit.views", "orbit.size"]);
    assert_eq!(fields(&views(Vec::new())), ["views.views"]);
    assert_eq!(fields(&RenderSpec::default()), ["what"]);
    type Change = fn(&mut RenderSpec);
    let cases: [(Change, &str); 6] = [
        (|it| it.background = vec![1.0, 0.5], "background"),
        (|it| it.background = vec![f32::NAN; 3], "background"),
        (
            |it| (it.transparent, it.background) = (true, vec![0.0, 1.0, 0.0]),
            "background",
        ),
        (|it| it.fps = -1.0, "fps"),
        (|it| it.layer = 99, "layer"),
        (|it| it.light = Some(Light { of: None }), "light"),
    ];
    for (change, field) in cases {
        let mut spec = orbit(12, 128);
        change(&mut spec);
        assert_eq!(fields(&spec), [field]);
    }
}

#[test]
fn people_between_two_are_shares_of_them() {
    let with = |shares: &[f32], compare| RenderSpec {
        between: Some(Between {
            subject: "subjects/b".into(),
            shares: shares.to_vec(),
        }),
        compare,
        ..orbit(12, 128)
    };
    assert_eq!(faults(&with(&[0.0, 0.5, 1.0], false)), []);
    assert_eq!(fields(&with(&[], false)), ["between.shares"]);
    assert_eq!(fields(&with(&[0.5; 101], false)), ["between.shares"]);
    assert_eq!(fields(&with(&[0.5, 1.5], false)), ["between.shares[1]"]);
    assert_eq!(fields(&with(&[f32::NAN], false)), ["between.shares[0]"]);
    assert_eq!(fields(&with(&[0.5], true)), ["between"]);
    // Each person is in all pictures.
    let many = |views| RenderSpec {
        what: Some(What::Orbit(Orbit {
            frame: 0,
            views,
            size: 16,
        })),
        ..with(&[0.5; 100], false)
    };
    assert_eq!(faults(&many(100)), []);
    let found = faults(&many(10_000));
    assert_eq!(found[0].field, "between.shares");
    let message = &found[0].message;
    assert!(message.contains("1000000: at most 10000"), "{message}");
}

#[test]
fn a_fault_names_its_view_and_field() {
    assert_eq!(faults(&views(vec![view()])), []);
    let broken = |change: fn(&mut View)| {
        let mut broken = view();
        change(&mut broken);
        faults(&views(vec![view(), broken]))
    };
    let found = broken(|it| it.camera.as_mut().expect("has one").intrinsics.truncate(8));
    assert_eq!(found[0].field, "views.views[1].camera.intrinsics");
    assert_eq!(found[0].message, "8 numbers, not 9");
    let found = broken(|it| it.pose.as_mut().expect("has one").rotations[1] = f32::NAN);
    assert_eq!(found[0].field, "views.views[1].pose.rotations[1]");
    let found = broken(|it| it.camera = None);
    assert_eq!(found[0].field, "views.views[1]");
}

#[test]
fn a_motion_reaches_its_end() {
    let motion = |frame_count, frame_step, size| {
        with(What::Motion(MotionTransfer {
            frame_count,
            frame_step,
            size,
            ..MotionTransfer::default()
        }))
    };
    assert_eq!(faults(&motion(2, 1, 64)), []);
    assert_eq!(faults(&motion(0, 1, 64)), []);
    assert_eq!(fields(&motion(2, 0, 64)), ["motion.frame_step"]);
    assert_eq!(fields(&motion(10_001, 1, 64)), ["motion.frame_count"]);
    assert_eq!(fields(&motion(2, 1, scene::MAX_SIDE + 1)), ["motion.size"]);
    let until = |end_frame| {
        with(What::Motion(MotionTransfer {
            first_frame: Some(60),
            end_frame: Some(end_frame),
            frame_step: 1,
            size: 64,
            ..MotionTransfer::default()
        }))
    };
    assert_eq!(faults(&until(61)), []);
    let mut wide = until(36_000);
    if let Some(What::Motion(motion)) = &mut wide.what {
        motion.frame_count = 35_940;
    }
    assert_eq!(faults(&wide), []);
    assert_eq!(fields(&until(60)), ["motion.end_frame"]);
}

#[test]
fn a_quality_is_one_that_can_be_wanted() {
    let said = |want: Option<Want>| {
        let mut spec = orbit(12, 128);
        spec.quality = Some(RenderQuality { want });
        let found = faults(&spec);
        assert!(found.len() < 2, "{found:?}");
        found.into_iter().next()
    };
    assert_eq!(said(Some(Want::MaxSecondsPerFrame(0.1))), None);
    assert_eq!(said(Some(Want::MinPsnrDb(30.0))), None);
    assert_eq!(said(Some(Want::Tier("fast".into()))), None);
    for bad in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        let fault = said(Some(Want::MaxSecondsPerFrame(bad))).expect("refused");
        assert_eq!(fault.field, "quality.max_seconds_per_frame");
        let fault = said(Some(Want::MinPsnrDb(bad))).expect("refused");
        assert_eq!(fault.field, "quality.min_psnr_db");
    }
    let fault = said(Some(Want::Tier("paper".into()))).expect("a training tier");
    assert_eq!(fault.field, "quality.tier");
    let known = "full, balanced, fast, draft";
    assert!(fault.message.contains(known), "{fault:?}");
    assert_eq!(said(None).expect("nothing wanted").field, "quality");
}

#[test]
fn a_clip_s_skeleton_and_poses_fit() {
    let good = || MotionClip {
        skeleton: Some(Skeleton {
            names: vec!["root".into(), "tip".into()],
            parents: vec![-1, 0],
            rest_joints: Vec::new(),
        }),
        poses: vec![BodyPose {
            rotations: vec![0.0; 6],
            translation: vec![0.0; 3],
        }],
        size: 64,
        ..MotionClip::default()
    };
    assert_eq!(faults(&with(What::Clip(good()))), []);
    type Change = fn(&mut MotionClip);
    let cases: [(Change, &str); 6] = [
        (|it| it.size = 0, "clip.size"),
        (|it| it.poses.clear(), "clip.poses"),
        (|it| it.skeleton = None, "clip.skeleton.parents"),
        (
            |it| it.poses[0].rotations.truncate(3),
            "clip.poses[0].rotations",
        ),
        (
            |it| it.poses[0].rotations[1] = f32::NAN,
            "clip.poses[0].rotations[1]",
        ),
        (
            |it| it.skeleton.as_mut().expect("has one").parents = vec![1, 0],
            "clip.skeleton.parents[0]",
        ),
    ];
    for (change, field) in cases {
        let mut clip = good();
        change(&mut clip);
        assert_eq!(fields(&with(What::Clip(clip))), [field]);
    }
}

/// A scene by the model duo with an actor of each of `models`.
fn scene_of(models: &[&str]) -> RenderSpec {
    let actor = |model: &&str| Actor {
        motion: Some(Motion::Capture(CaptureMotion::default())),
        model: (*model).into(),
        ..Actor::default()
    };
    let scene = Scene {
        actors: models.iter().map(actor).collect(),
        width: 64,
        height: 64,
        ..Scene::default()
    };
    RenderSpec {
        model: "models/duo".into(),
        ..with(What::Scene(scene))
    }
}

#[test]
fn people_of_several_models_have_their_models_own_settings() {
    assert_eq!(faults(&scene_of(&["", "models/fog"])), []);
    assert_eq!(faults(&scene_of(&["models/fog", "models/duo"])), []);
    assert_eq!(fields(&scene_of(&["models/fog"])), ["scene.actors"]);
    let names = fields(&scene_of(&["", "fog"]));
    assert_eq!(names, ["scene.actors[1].model"]);
    let goal = |models: &[&str], tier: &str| {
        let want = Some(Want::Tier(tier.into()));
        fields(&RenderSpec {
            quality: Some(RenderQuality { want }),
            ..scene_of(models)
        })
    };
    assert_eq!(goal(&["", "models/fog"], "fast"), ["quality"]);
    assert_eq!(goal(&["", "models/fog"], "realtime"), [""; 0]);
    assert_eq!(goal(&["", "models/duo"], "fast"), [""; 0]);
}

#[test]
fn a_scene_has_actors_instead_of_a_subject() {
    let mut spec = scene_of(&[""]);
    assert_eq!(faults(&spec), []);
    spec.subject = "subjects/a".into();
    assert_eq!(fields(&spec), ["subject"]);
    spec.subject.clear();
    if let Some(What::Scene(scene)) = &mut spec.what {
        scene.actors[0].speed = 1e9;
    }
    assert_eq!(fields(&spec), ["scene.actors[0].speed"]);
}
