//! Whether a job's order is well-formed, by itself. What the catalogue must hold for it
//! is checked in [`super::queue`].

use crate::error::RequestError;
use prost::Message;
use yoto_proto::{
    pose_track::{MAX_JOINTS, MAX_SIDE, Skeleton},
    protocols,
    scene::{self, MAX_PICTURES},
    tiers,
    v1::{
        BodyPose, Camera, EvaluateSpec, JobSpec, MotionClip, MotionTransfer, Orbit, RenderQuality,
        RenderSpec, Scene, TradeoffSpec, TrainSpec, View, Violation, actor::Motion,
        render_quality::Want, render_spec::What, scene_camera::Path,
    },
};

/// Longest encoded order: a job must fit into a message beside its result.
const MAX_SPEC_BYTES: usize = 8 << 20;
/// Longest side of a rendered picture, pixels.
const MAX_RENDER_SIDE: u32 = 4096;
/// Shortest side of training images and of rendered pictures, pixels.
const MIN_SIDE: u32 = 8;
/// Shortest side for SSIM, pixels.
const MIN_EVALUATE_SIDE: u32 = 16;
/// Most pictures of a trade-off measurement, and most renders of each.
const MAX_TRADEOFF_VIEWS: u32 = 64;
const MAX_TRADEOFF_REPEATS: u32 = 32;
/// Fastest animation, frames per second.
const MAX_FPS: f32 = 120.0;
/// Shortest interval between two checkpoints of a training, seconds: each is written in full.
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

/// Size of a spec.
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
        i64::try_from(train.steps).is_ok(),
        "spec.train.steps",
        || format!("{} steps are too many", train.steps),
    )?;
    ensure(
        train.image_size == 0 || (MIN_SIDE..=MAX_SIDE).contains(&train.image_size),
        "spec.train.image_size",
        || {
            let size = train.image_size;
            format!("{size} pixels: 0, or {MIN_SIDE} to {MAX_SIDE}")
        },
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
        || "a background is empty or three numbers from 0 to 1".into(),
    )?;
    ensure(
        !render.transparent || render.background.iter().all(|value| *value == 0.0),
        "spec.render.background",
        || "a transparent picture has no background".into(),
    )?;
    ensure(
        (0.0..=MAX_FPS).contains(&render.fps),
        "spec.render.fps",
        || format!("{} is not between 0 and {MAX_FPS}", render.fps),
    )?;
    render.quality.as_ref().map_or(Ok(()), check_quality)?;
    refuse(scene::layer_faults(render), "spec.render")?;
    if let Some(light) = &render.light {
        refuse(scene::light_faults("light", light), "spec.render")?;
    }
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
        Some(What::Clip(clip)) => {
            check_side("spec.render.clip.size", clip.size)?;
            check_clip("spec.render.clip", clip)
        }
        Some(What::Scene(scene)) => {
            let no_light = render.light.is_none();
            ensure(no_light, "spec.render.light", || {
                "the actors of a scene have their own".into()
            })?;
            ensure(render.subject.is_empty(), "spec.render.subject", || {
                "a scene has actors instead".into()
            })?;
            check_scene(scene)
        }
        Some(What::Motion(MotionTransfer {
            frame_count,
            frame_step,
            size,
            ..
        })) => {
            // 0 means all remaining frames; the worker, which knows their number, limits them.
            if *frame_count > 0 {
                check_count("spec.render.motion.frame_count", u64::from(*frame_count))?;
            }
            ensure(*frame_step > 0, "spec.render.motion.frame_step", || {
                "a step of 0 never reaches the next frame".into()
            })?;
            check_side("spec.render.motion.size", *size)
        }
        None => Err(RequestError::invalid(
            "spec.render",
            "has nothing to render",
        )),
    }
}

/// The goal for a frame, within valid ranges.
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
        None => Err(RequestError::invalid("spec.render.quality", "has no goal")),
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

/// The first of `faults` of what is at `field`.
fn refuse(faults: Vec<scene::Fault>, field: &str) -> Checked {
    match faults.into_iter().next() {
        Some((name, message)) => Err(RequestError::invalid(format!("{field}.{name}"), message)),
        None => Ok(()),
    }
}

fn check_scene(scene: &Scene) -> Checked {
    let field = "spec.render.scene";
    refuse(scene::faults(scene), field)?;
    for (i, actor) in scene.actors.iter().enumerate() {
        if let Some(Motion::Clip(clip)) = &actor.motion {
            check_clip(&format!("{field}.actors[{i}].clip"), clip)?;
        }
    }
    let path = scene.camera.as_ref().and_then(|it| it.path.as_ref());
    let Some(Path::Cameras(list)) = path else {
        return Ok(());
    };
    let mut cameras = list.cameras.iter().enumerate();
    cameras.try_for_each(|(i, camera)| {
        check_camera(&format!("{field}.camera.cameras.cameras[{i}]"), camera)
    })
}

fn check_clip(field: &str, clip: &MotionClip) -> Checked {
    check_count(&format!("{field}.poses"), clip.poses.len() as u64)?;
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

/// Protocol and size of an evaluation, without repeated subjects.
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
    ensure((MIN_SIDE..=MAX_RENDER_SIDE).contains(&side), field, || {
        format!("{side} pixels: {MIN_SIDE} to {MAX_RENDER_SIDE} are allowed")
    })
}

fn check_view(field: &str, view: &View) -> Checked {
    let (Some(pose), Some(camera)) = (&view.pose, &view.camera) else {
        return Err(RequestError::invalid(
            field,
            "a view needs a pose and a camera",
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
mod tests;
