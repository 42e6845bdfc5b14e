//! Whether a job's order is well-formed, by itself. What the catalogue must hold for it
//! is checked in [`super::queue`].

use crate::error::RequestError;
use prost::Message;
use yoto_proto::{
    pose_track::{MAX_JOINTS, MAX_SIDE, Skeleton},
    protocols, tiers,
    v1::{
        BodyPose, Camera, EvaluateSpec, JobSpec, MotionClip, MotionTransfer, Orbit, RenderQuality,
        RenderSpec, TradeoffSpec, TrainSpec, View, Violation, render_quality::Want,
        render_spec::What,
    },
};

/// Longest encoded order: a job must fit into a message beside its result.
const MAX_SPEC_BYTES: usize = 8 << 20;
/// Longest side of a rendered picture, pixels.
const MAX_RENDER_SIDE: u32 = 4096;
/// Shortest side that SSIM can be measured at, pixels.
const MIN_EVALUATE_SIDE: u32 = 16;
/// Most pictures of one render job.
const MAX_PICTURES: u32 = 10_000;
/// Most pictures that a trade-off is measured on, and most renders of each.
const MAX_TRADEOFF_VIEWS: u32 = 64;
const MAX_TRADEOFF_REPEATS: u32 = 32;
/// Fastest animation, frames a second.
const MAX_FPS: f32 = 120.0;
/// Shortest pause between two checkpoints of a training, seconds: each is written whole.
const MIN_CHECKPOINT_SECONDS: f64 = 0.1;
/// Longest training budget: 90 days.
const MAX_TRAIN_SECONDS: f64 = 90.0 * 86_400.0;

type Checked = Result<(), RequestError>;

fn ensure(holds: bool, field: &str, message: impl FnOnce() -> String) -> Checked {
    if holds {
        Ok(())
    } else {
        Err(RequestError::invalid(field, message()))
    }
}

/// Orders have a size, too.
pub fn check_size(spec: &JobSpec) -> Checked {
    let bytes = spec.encoded_len();
    ensure(bytes <= MAX_SPEC_BYTES, "spec", || {
        format!("{bytes} bytes; at most {MAX_SPEC_BYTES} are allowed, so split the job")
    })
}

/// Budget and sizes of a training.
pub fn check_train(train: &TrainSpec) -> Checked {
    ensure(
        train.seconds.is_finite() && (0.0..=MAX_TRAIN_SECONDS).contains(&train.seconds),
        "spec.train.seconds",
        || format!("{} is not between 0 and {MAX_TRAIN_SECONDS}", train.seconds),
    )?;
    ensure(
        train.seconds > 0.0 || train.steps > 0,
        "spec.train.seconds",
        || "a training needs a budget: seconds or steps above 0".into(),
    )?;
    ensure(
        i64::try_from(train.steps).is_ok(),
        "spec.train.steps",
        || format!("{} steps never end", train.steps),
    )?;
    ensure(
        train.image_size <= MAX_SIDE,
        "spec.train.image_size",
        || format!("{} is above {MAX_SIDE}", train.image_size),
    )?;
    ensure(
        train.checkpoint_seconds == 0.0
            || (train.checkpoint_seconds.is_finite()
                && train.checkpoint_seconds >= MIN_CHECKPOINT_SECONDS),
        "spec.train.checkpoint_seconds",
        || {
            format!(
                "{} is neither 0 nor at least {MIN_CHECKPOINT_SECONDS}",
                train.checkpoint_seconds
            )
        },
    )
}

/// Pictures, background and speed of a render.
pub fn check_render(render: &RenderSpec) -> Checked {
    let in_unit = |value: &f32| (0.0..=1.0).contains(value);
    ensure(
        matches!(render.background.len(), 0 | 3) && render.background.iter().all(in_unit),
        "spec.render.background",
        || "a background is empty, or three numbers from 0 to 1".into(),
    )?;
    ensure(
        (0.0..=MAX_FPS).contains(&render.fps),
        "spec.render.fps",
        || format!("{} is not between 0 and {MAX_FPS}", render.fps),
    )?;
    render.quality.as_ref().map_or(Ok(()), check_quality)?;
    match &render.what {
        Some(What::Views(list)) => {
            check_count("spec.render.views.views", list.views.len() as u64)?;
            let mut views = list.views.iter().enumerate();
            views.try_for_each(|(i, view)| {
                check_view(&format!("spec.render.views.views[{i}]"), view)
            })
        }
        Some(What::Orbit(Orbit { views, size, .. })) => {
            check_count("spec.render.orbit.views", u64::from(*views))?;
            check_side("spec.render.orbit.size", *size)
        }
        Some(What::Clip(clip)) => check_clip(clip),
        Some(What::Motion(MotionTransfer {
            frame_count,
            frame_step,
            size,
            ..
        })) => {
            // 0 stands for all that are left; the worker, which knows how many, bounds them.
            if *frame_count > 0 {
                check_count("spec.render.motion.frame_count", u64::from(*frame_count))?;
            }
            ensure(*frame_step > 0, "spec.render.motion.frame_step", || {
                "a step of 0 never gets to the next frame".into()
            })?;
            check_side("spec.render.motion.size", *size)
        }
        None => Err(RequestError::invalid(
            "spec.render",
            "says nothing to render",
        )),
    }
}

/// What is wanted of a frame, in numbers that somebody can want.
fn check_quality(quality: &RenderQuality) -> Checked {
    let above_zero = |name: &str, value: f64| {
        let field = format!("spec.render.quality.{name}");
        ensure(value.is_finite() && value > 0.0, &field, || {
            format!("{value} is not a number above 0")
        })
    };
    match &quality.want {
        Some(Want::MaxSecondsPerFrame(value)) => above_zero("max_seconds_per_frame", *value),
        Some(Want::MinPsnrDb(value)) => above_zero("min_psnr_db", *value),
        Some(Want::Tier(tier)) => ensure(
            tiers::is_render_tier(tier),
            "spec.render.quality.tier",
            || {
                let shown: String = tier.chars().take(80).collect();
                let known = tiers::render_tiers();
                format!("there is no render quality '{shown}'; qualities: {known}")
            },
        ),
        None => Err(RequestError::invalid(
            "spec.render.quality",
            "says nothing that is wanted",
        )),
    }
}

fn check_tradeoff(tradeoff: &TradeoffSpec) -> Checked {
    for (name, value, most) in [
        ("views", tradeoff.views, MAX_TRADEOFF_VIEWS),
        ("repeats", tradeoff.repeats, MAX_TRADEOFF_REPEATS),
    ] {
        let field = format!("spec.evaluate.tradeoff.{name}");
        ensure(value <= most, &field, || format!("{value} is above {most}"))?;
    }
    Ok(())
}

fn check_clip(clip: &MotionClip) -> Checked {
    let field = "spec.render.clip";
    check_count(&format!("{field}.poses"), clip.poses.len() as u64)?;
    check_side(&format!("{field}.size"), clip.size)?;
    let message = clip.skeleton.clone().unwrap_or_default();
    let invalid = |fault: &Violation| {
        RequestError::invalid(format!("{field}.{}", fault.field), fault.message.clone())
    };
    let mut skeleton = Skeleton::from_proto(message).map_err(|fault| invalid(&fault))?;
    let joints = skeleton.parents.len();
    if skeleton.rest_joints.is_empty() {
        skeleton.rest_joints = vec![[0.0; 3]; joints];
    }
    if let Some(fault) = skeleton.check().first() {
        return Err(invalid(fault));
    }
    clip.poses.iter().enumerate().try_for_each(|(i, pose)| {
        let field = format!("{field}.poses[{i}]");
        check_pose(&field, pose)?;
        ensure(
            pose.rotations.len() == 3 * joints,
            &format!("{field}.rotations"),
            || format!("{} numbers for {joints} joints", pose.rotations.len()),
        )
    })
}

/// Protocol and size of an evaluation, and nobody named twice.
pub fn check_evaluate(evaluate: &EvaluateSpec) -> Checked {
    let protocol = evaluate.protocol.as_str();
    ensure(
        protocol.is_empty() || protocols::is_protocol(protocol),
        "spec.evaluate.protocol",
        || {
            let known = tiers::listed(protocols::PROTOCOLS);
            format!("there is no protocol '{protocol}'; protocols: {known}")
        },
    )?;
    ensure(
        matches!(protocol, "" | protocols::HELD_OUT),
        "spec.evaluate.protocol",
        || {
            format!(
                "'{protocol}' compares with what further cameras saw, which the service does not \
                 store; measure with a capture folder at hand, or by '{}'",
                protocols::HELD_OUT
            )
        },
    )?;
    evaluate.tradeoff.as_ref().map_or(Ok(()), check_tradeoff)?;
    let size = evaluate.image_size;
    ensure(
        size == 0 || (MIN_EVALUATE_SIDE..=MAX_RENDER_SIDE).contains(&size),
        "spec.evaluate.image_size",
        || format!("{size} is neither 0 nor {MIN_EVALUATE_SIDE} to {MAX_RENDER_SIDE} pixels"),
    )?;
    for (i, subject) in evaluate.subjects.iter().enumerate() {
        ensure(
            !evaluate
                .subjects
                .iter()
                .take(i)
                .any(|other| other == subject),
            &format!("spec.evaluate.subjects[{i}]"),
            || format!("{subject} is named twice"),
        )?;
    }
    Ok(())
}

fn check_count(field: &str, count: u64) -> Checked {
    ensure(
        (1..=u64::from(MAX_PICTURES)).contains(&count),
        field,
        || format!("{count} pictures; 1 to {MAX_PICTURES} are allowed"),
    )
}

fn check_side(field: &str, side: u32) -> Checked {
    ensure((1..=MAX_RENDER_SIDE).contains(&side), field, || {
        format!("{side} is not between 1 and {MAX_RENDER_SIDE} pixels")
    })
}

fn check_view(field: &str, view: &View) -> Checked {
    let (Some(pose), Some(camera)) = (&view.pose, &view.camera) else {
        return Err(RequestError::invalid(
            field,
            "a view has a pose and a camera",
        ));
    };
    check_pose(&format!("{field}.pose"), pose)?;
    check_camera(&format!("{field}.camera"), camera)
}

fn check_pose(field: &str, pose: &BodyPose) -> Checked {
    let numbers = pose.rotations.len();
    ensure(
        numbers > 0 && numbers.is_multiple_of(3) && numbers <= 3 * MAX_JOINTS,
        &format!("{field}.rotations"),
        || format!("{numbers} numbers; a pose has 3 for each of 1 to {MAX_JOINTS} joints"),
    )?;
    ensure(
        pose.translation.len() == 3,
        &format!("{field}.translation"),
        || format!("{} numbers, not 3", pose.translation.len()),
    )?;
    let finite = pose
        .rotations
        .iter()
        .chain(&pose.translation)
        .all(|value| value.is_finite());
    ensure(finite, field, || "holds numbers that are not finite".into())
}

fn check_camera(field: &str, camera: &Camera) -> Checked {
    check_side(&format!("{field}.width"), camera.width)?;
    check_side(&format!("{field}.height"), camera.height)?;
    ensure(
        camera.intrinsics.len() == 9,
        &format!("{field}.intrinsics"),
        || format!("{} numbers, not 9", camera.intrinsics.len()),
    )?;
    ensure(
        camera.extrinsics.len() == 16,
        &format!("{field}.extrinsics"),
        || format!("{} numbers, not 16", camera.extrinsics.len()),
    )?;
    let finite = camera
        .intrinsics
        .iter()
        .chain(&camera.extrinsics)
        .all(|value| value.is_finite());
    ensure(finite, field, || "holds numbers that are not finite".into())
}

#[cfg(test)]
mod tests {
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
        for seconds in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
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
}
