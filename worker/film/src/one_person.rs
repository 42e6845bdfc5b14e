//! Pictures of one person: listed views, an orbit, a motion of a capture or one from a file.

use crate::bodies::{Bodies, ModelBodies};
use crate::captures::Captures;
use crate::error::PlanError;
use crate::layer::Layer;
use crate::plan::{Actor, FPS, Light, MAX_FPS, Plan, View, background, wanted_fps};
use crate::shot::Shot;
use crate::truth::Truth;
use crate::{clip, light, motion, orbit, views};
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Skeleton;
use yoto_proto::checks::render::too_many;
use yoto_proto::v1::RenderSpec;
use yoto_proto::v1::render_spec::What;

/// All pictures of one person.
struct Shots {
    shots: Vec<Shot>,
    truth: Option<Truth>,
    fps: f32,
}

/// Plans the pictures of the subject. Unfilmed people replace the subject and follow each other.
pub(crate) fn plan(
    spec: &RenderSpec,
    what: &What,
    bodies: &Bodies,
    captures: &Captures,
) -> Result<Plan, PlanError> {
    let model = bodies.own()?;
    let skeleton = model.skeleton(&spec.subject)?;
    let subject = [model.slot(&spec.subject)?];
    let people: Vec<&[usize]> = match bodies.unfilmed.as_slice() {
        [] => vec![&subject],
        unfilmed => unfilmed.iter().map(Vec::as_slice).collect(),
    };
    let mut plan = Plan {
        views: Vec::new(),
        layer: Layer::Colours,
        surroundings: None,
        truth: None,
        fps: FPS,
    };
    let count = people.len();
    for slots in people {
        let bones = slots.first().and_then(|slot| model.skeletons.get(slot));
        let skeleton = bones.unwrap_or(skeleton);
        let shots = shots(spec, what, count, model, captures, skeleton)?;
        let light = light::on_one_person(spec, world(spec, what), model, captures)?;
        plan.views
            .extend(views_of(spec, &shots.shots, slots, light));
        plan.truth = shots.truth;
        plan.fps = shots.fps;
    }
    Ok(plan)
}

/// The subject whose capture's world the pictures are in: the subject of the render, except with another
/// person's motion.
pub(crate) fn world<'a>(spec: &'a RenderSpec, what: &'a What) -> &'a str {
    match what {
        What::Motion(transfer) => &transfer.driver,
        _ => &spec.subject,
    }
}

/// The poses and cameras of `what` for one person, on `skeleton`; `people` is the number of all people.
fn shots(
    spec: &RenderSpec,
    what: &What,
    people: usize,
    model: &ModelBodies,
    captures: &Captures,
    skeleton: &Skeleton,
) -> Result<Shots, PlanError> {
    let subject_track = || captures.track(&model.name, &spec.subject);
    let (mut fps, mut truth) = (wanted_fps(spec).unwrap_or(FPS), None);
    let shots = match what {
        What::Views(list) => views::shots(list, skeleton.joints())?,
        What::Orbit(orbit) => orbit::shots(orbit, subject_track()?)?,
        What::Clip(clip) => clip::shots(clip, subject_track()?, skeleton, fps.into())?,
        What::Motion(transfer) => {
            let track = captures.track(&model.name, &transfer.driver)?;
            let positions = motion::positions(transfer, track, "motion")?;
            // Only the track tells how many frames an open range has.
            if let Some(message) = too_many(positions.len() as u64, people as u64) {
                return Err(PlanError::invalid("motion.frame_count", message));
            }
            let natural = motion::natural_fps(&positions, track);
            fps = wanted_fps(spec).or(natural).unwrap_or(FPS).min(MAX_FPS);
            let shots = motion::shots(transfer, &positions, track, skeleton)?;
            let shard = captures.shard(&model.name, &transfer.driver)?;
            truth = shard
                .and_then(|shard| Truth::of_motion(spec, transfer, shard, &positions, skeleton));
            shots
        }
        What::Scene(_) => return Err(PlanError::invalid("scene", "not of one person")),
    };
    for shot in &shots {
        check_joints(&shot.pose, skeleton.joints())?;
    }
    Ok(Shots { shots, truth, fps })
}

/// A driver's pose may not fit the body.
fn check_joints(pose: &Pose, joints: usize) -> Result<(), PlanError> {
    let found = pose.rotations.len();
    if found == joints {
        return Ok(());
    }
    Err(PlanError::Failed {
        code: "RETARGET",
        message: format!("a pose of {found} joints for a body of {joints}"),
    })
}

/// The pictures of one person, who consists of all `slots` of the render's own model.
fn views_of<'a>(
    spec: &'a RenderSpec,
    shots: &'a [Shot],
    slots: &'a [usize],
    light: Light,
) -> impl Iterator<Item = View> + use<'a> {
    shots.iter().map(move |shot| View {
        actors: slots
            .iter()
            .map(|slot| Actor {
                model: 0,
                slot: *slot,
                pose: shot.pose.clone(),
                light,
            })
            .collect(),
        camera: shot.camera.clone(),
        background: background(spec),
        shadow: None,
    })
}
