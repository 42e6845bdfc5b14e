//! Refused specs, and the field of each refusal.

use super::*;

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
    let what = Some(What::Views(yoto_proto::v1::ViewList { views }));
    RenderSpec {
        what,
        ..RenderSpec::default()
    }
}

#[test]
fn a_fault_names_its_view_and_field() {
    check_render(&views(vec![view()])).expect("a good view passes");
    let mut broken = view();
    broken.camera.as_mut().expect("has one").intrinsics.pop();
    let error = check_render(&views(vec![view(), broken])).expect_err("8 intrinsics");
    assert_eq!(
        error.to_string(),
        "spec.render.views.views[1].camera.intrinsics: 8 numbers, not 9"
    );
    let mut broken = view();
    broken.pose.as_mut().expect("has one").rotations[1] = f32::NAN;
    assert!(check_render(&views(vec![broken])).is_err());
    assert!(check_render(&views(Vec::new())).is_err());
}

#[test]
fn a_quality_is_one_that_can_be_wanted() {
    let with = |want: Option<Want>| {
        let spec = RenderSpec {
            quality: Some(RenderQuality { want }),
            ..views(vec![view()])
        };
        check_render(&spec).map_err(|error| error.to_string())
    };
    assert_eq!(with(Some(Want::MaxSecondsPerFrame(0.1))), Ok(()));
    assert_eq!(with(Some(Want::MinPsnrDb(30.0))), Ok(()));
    assert_eq!(with(Some(Want::Tier("fast".into()))), Ok(()));
    for bad in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        let error = with(Some(Want::MaxSecondsPerFrame(bad))).expect_err("refused");
        assert!(
            error.starts_with("spec.render.quality.max_seconds_per_frame: "),
            "{error}"
        );
        let error = with(Some(Want::MinPsnrDb(bad))).expect_err("refused");
        assert!(
            error.starts_with("spec.render.quality.min_psnr_db: "),
            "{error}"
        );
    }
    let error = with(Some(Want::Tier("paper".into()))).expect_err("a training tier");
    assert!(error.starts_with("spec.render.quality.tier: "), "{error}");
    assert!(error.contains("full, balanced, fast, draft"), "{error}");
    let error = with(None).expect_err("nothing wanted");
    assert!(error.starts_with("spec.render.quality: "), "{error}");
}

#[test]
fn an_evaluation_is_one_that_the_service_can_do() {
    let with = |change: fn(&mut EvaluateSpec)| {
        let mut spec = EvaluateSpec::default();
        change(&mut spec);
        check_evaluate(&spec).map_err(|error| error.to_string())
    };
    assert_eq!(with(|_| {}), Ok(()));
    assert_eq!(with(|spec| spec.protocol = "held-out".into()), Ok(()));
    type Change = fn(&mut EvaluateSpec);
    let cases: [(Change, &str); 6] = [
        (
            |spec| {
                spec.tradeoff = Some(TradeoffSpec {
                    views: 65,
                    repeats: 0,
                })
            },
            "spec.evaluate.tradeoff.views: 65 is above",
        ),
        (
            |spec| {
                spec.tradeoff = Some(TradeoffSpec {
                    views: 0,
                    repeats: 33,
                })
            },
            "spec.evaluate.tradeoff.repeats: 33 is above",
        ),
        (
            |spec| spec.protocol = "zju".into(),
            "spec.evaluate.protocol: there is no",
        ),
        (
            |spec| spec.protocol = "zju-all".into(),
            "spec.evaluate.protocol: 'zju-all' compares",
        ),
        (
            |spec| spec.image_size = 8,
            "spec.evaluate.image_size: 8 is neither",
        ),
        (
            |spec| spec.subjects = vec!["subjects/a".into(); 2],
            "spec.evaluate.subjects[1]: subjects/a is named twice",
        ),
    ];
    for (change, expected) in cases {
        let error = with(change).expect_err(expected);
        assert!(error.starts_with(expected), "{error}");
    }
}

#[test]
fn numbers_that_never_end_are_refused() {
    let motion = |frame_step, size| RenderSpec {
        what: Some(What::Motion(MotionTransfer {
            frame_count: 2,
            frame_step,
            size,
            ..MotionTransfer::default()
        })),
        ..RenderSpec::default()
    };
    check_render(&motion(1, 64)).expect("a good motion passes");
    assert!(check_render(&motion(0, 64)).is_err());
    assert!(check_render(&motion(1, MAX_RENDER_SIDE + 1)).is_err());
    for seconds in [f64::NAN, f64::INFINITY, -1.0] {
        assert!(
            check_train(&TrainSpec {
                seconds,
                ..TrainSpec::default()
            })
            .is_err()
        );
    }
    assert!(
        check_train(&TrainSpec {
            steps: 10,
            ..TrainSpec::default()
        })
        .is_ok()
    );
    assert!(
        check_train(&TrainSpec::default()).is_ok(),
        "without a budget a training runs as long as its tier's schedule"
    );
}

#[test]
fn a_clip_s_skeleton_and_poses_fit() {
    let good = || MotionClip {
        skeleton: Some(yoto_proto::v1::Skeleton {
            names: vec!["root".into(), "tip".into()],
            parents: vec![-1, 0],
            rest_joints: Vec::new(),
        }),
        poses: vec![BodyPose {
            rotations: vec![0.0; 6],
            translation: vec![0.0; 3],
        }],
        size: 64,
        follow: false,
        fps: 0.0,
        camera_frame: None,
    };
    let check = |clip| {
        let what = Some(What::Clip(clip));
        check_render(&RenderSpec {
            what,
            ..RenderSpec::default()
        })
    };
    check(good()).expect("a good clip passes");
    let cases: [fn(&mut MotionClip); 6] = [
        |clip| clip.size = 0,
        |clip| clip.poses.clear(),
        |clip| clip.skeleton = None,
        |clip| clip.poses[0].rotations.truncate(3),
        |clip| clip.poses[0].rotations[1] = f32::NAN,
        |clip| {
            if let Some(skeleton) = &mut clip.skeleton {
                skeleton.parents = vec![1, 0];
            }
        },
    ];
    for (case, break_it) in cases.into_iter().enumerate() {
        let mut broken = good();
        break_it(&mut broken);
        assert!(check(broken).is_err(), "case {case}");
    }
}

#[test]
fn a_scene_is_checked_with_its_actors_motions_and_cameras() {
    use yoto_proto::v1::{Actor, CameraList, CaptureMotion, Light, SceneCamera};
    let scene = || Scene {
        actors: vec![Actor {
            motion: Some(Motion::Capture(CaptureMotion::default())),
            ..Actor::default()
        }],
        width: 64,
        height: 64,
        ..Scene::default()
    };
    let spec = |scene| RenderSpec {
        what: Some(What::Scene(scene)),
        ..RenderSpec::default()
    };
    let said = |spec: &RenderSpec| check_render(spec).map_err(|error| error.to_string());
    assert_eq!(said(&spec(scene())), Ok(()));
    let refused = |spec: &RenderSpec, field: &str| {
        let error = said(spec).expect_err(field);
        assert!(
            error.starts_with(&format!("spec.render.{field}: ")),
            "{error}"
        );
    };
    let mut fast = scene();
    fast.actors[0].speed = 1e9;
    refused(&spec(fast), "scene.actors[0].speed");
    let mut unposed = scene();
    unposed.actors[0].motion = Some(Motion::Clip(MotionClip {
        poses: vec![BodyPose::default()],
        fps: 30.0,
        ..MotionClip::default()
    }));
    refused(&spec(unposed), "scene.actors[0].clip.skeleton.parents");
    let mut blind = scene();
    let list = CameraList {
        cameras: vec![Camera::default()],
    };
    blind.camera = Some(SceneCamera {
        path: Some(Path::Cameras(list)),
    });
    (blind.width, blind.height) = (0, 0);
    refused(&spec(blind), "scene.camera.cameras.cameras[0].width");
    let mut named = spec(scene());
    named.subject = "subjects/a".into();
    refused(&named, "subject");
    let mut lit = spec(scene());
    lit.light = Some(Light { of: None });
    refused(&lit, "light");
}
