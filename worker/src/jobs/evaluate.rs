//! Measures a model: renders the held-out frames of each capture and compares them with the
//! camera's pictures.
//!
//! The service stores the pictures of one camera, so these frames show held-out poses from the
//! training camera. Figures of other cameras need a capture folder with their pictures.

mod tradeoff;

use super::checkpoint::Downloaded;
use super::train::HOLDOUT_EVERY;
use super::{JobContext, JobFailure, checkpoint, shard};
use tradeoff::Sweep;
use yoto_avatar::evaluate::{Examiner, LpipsMetric, Mean, Protocol, Score, Truth};
use yoto_avatar::render::FrameExposure;
use yoto_avatar::train::{CaptureExposures, Validation, capture_exposures};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::{FrameImage, Shard};
use yoto_proto::checks::evaluate as order;
use yoto_proto::names;
use yoto_proto::protocols::HELD_OUT;
use yoto_proto::v1::{EvaluateResult, EvaluateSpec, IdentitySlot, SubjectScores};
use yoto_proto::worker::v1::Inputs;

/// Measures the requested subjects.
///
/// # Errors
/// Bad requests, a model without a complete checkpoint, captures too short to have a held-out
/// frame, LPIPS weights that can't be read, and faults of the store.
pub fn run(
    context: &JobContext,
    spec: &EvaluateSpec,
    inputs: &Inputs,
) -> Result<EvaluateResult, JobFailure> {
    JobFailure::refuse("evaluate", order::faults(spec))?;
    let protocol = Protocol::named(HELD_OUT).map_err(|error| {
        let message = error.to_string();
        JobFailure::invalid("evaluate", "protocol", message)
    })?;
    let slots = slots(spec, inputs)?;
    let (renderer, found) = checkpoint::load_renderer(context, inputs, "measure")?;
    let weights = context.lpips.as_ref();
    let lpips = weights
        .map(|weights| LpipsMetric::load(weights, &context.device.device))
        .transpose()
        .map_err(|error| JobFailure::failed("LPIPS", "loading the weights of LPIPS", &error))?;
    let knows = |slot: &IdentitySlot| renderer.skeleton(slot.slot as usize).is_some();
    let (slots, unknown): (Vec<_>, Vec<_>) = slots.into_iter().partition(|slot| knows(slot));
    let mut notes = left_out(spec, inputs, &unknown)?;
    let size = match spec.image_size {
        0 => found.checkpoint.image_size,
        asked => asked,
    };
    let examiner = Examiner::new(renderer, protocol, lpips);
    let mut pictures = Vec::new();
    let mut too_short = Vec::new();
    for slot in &slots {
        context.check()?;
        let fetched = Pictures::fetch(context, inputs, &found, slot, size)?;
        match fetched.frames.is_empty() {
            true => too_short.push(fetched.display_name),
            false => pictures.push(fetched),
        }
    }
    notes.extend(without_held_out(spec, &pictures, &too_short)?);
    let longest = |it: &Picture| it.camera.width.max(it.camera.height);
    let size = pictures.iter().flat_map(|it| &it.frames).map(longest).max();
    let sweep = spec.tradeoff.as_ref();
    let sweep = sweep.map(|wanted| Sweep::new(context, examiner.renderer(), wanted, &pictures));
    let later = sweep.as_ref().map_or(0, Sweep::frames);
    let scores = measure(context, &examiner, &pictures, later)?;
    let tradeoff = match &sweep {
        Some(sweep) => {
            let before = pictures.iter().map(|person| person.frames.len()).sum();
            let curve = sweep.measure(context, examiner.into_renderer(), before)?;
            Some(tradeoff::keep(
                context,
                &spec.model,
                found.manifest.step,
                &curve,
            )?)
        }
        None => None,
    };
    let result = |(pictures, score): (&Pictures, &Score)| SubjectScores {
        subject: pictures.subject.clone(),
        display_name: pictures.display_name.clone(),
        scores: Some(score.into()),
    };
    Ok(EvaluateResult {
        protocol: protocol.name.into(),
        checkpoint: names::checkpoint(&spec.model, found.manifest.step),
        subjects: pictures.iter().zip(&scores).map(result).collect(),
        mean: Some((&Score::mean(&scores)).into()),
        device: context.device.info.adapter.clone(),
        tradeoff,
        notes,
        image_size: size.unwrap_or(0),
    })
}

/// Notes on the people with the `unknown` slots, who came after the checkpoint. It is a
/// fault if they were asked for by name, or nobody else is left.
fn left_out(
    spec: &EvaluateSpec,
    inputs: &Inputs,
    unknown: &[&IdentitySlot],
) -> Result<Vec<String>, JobFailure> {
    let notes = unknown.iter().map(|slot| {
        let name = shard::person(inputs, &slot.subject);
        format!("{name} is left out: the checkpoint was trained before they joined the model")
    });
    let notes: Vec<String> = notes.collect();
    let known = inputs.model.iter().flat_map(|it| &it.slots).count() > unknown.len();
    if !notes.is_empty() && (!spec.subjects.is_empty() || !known) {
        return Err(JobFailure::Failed {
            code: "NOT_TRAINED",
            message: notes.join("; "),
        });
    }
    Ok(notes)
}

/// Notes on the people whose captures are `too_short` to hold a frame out. It is a fault if they were
/// asked for by name, or nobody else is left.
fn without_held_out(
    spec: &EvaluateSpec,
    measured: &[Pictures],
    too_short: &[String],
) -> Result<Option<String>, JobFailure> {
    if too_short.is_empty() {
        return Ok(None);
    }
    let message = format!(
        "{}: a capture of fewer than {} frames has none to hold out, so that nothing measures it",
        too_short.join(", "),
        HOLDOUT_EVERY / 2 + 1
    );
    if measured.is_empty() || !spec.subjects.is_empty() {
        return Err(JobFailure::Failed {
            code: "NO_HELD_OUT",
            message,
        });
    }
    Ok(Some(message))
}

/// Slots of the subjects to measure, in the model's order.
fn slots<'a>(spec: &EvaluateSpec, inputs: &'a Inputs) -> Result<Vec<&'a IdentitySlot>, JobFailure> {
    let all = inputs.model.iter().flat_map(|model| &model.slots);
    let asked =
        |slot: &&IdentitySlot| spec.subjects.is_empty() || spec.subjects.contains(&slot.subject);
    let slots: Vec<_> = all.filter(asked).collect();
    let strangers: Vec<&str> = spec
        .subjects
        .iter()
        .filter(|subject| !slots.iter().any(|slot| slot.subject == **subject))
        .map(|subject| shard::person(inputs, subject))
        .collect();
    if !strangers.is_empty() || slots.is_empty() {
        let message = format!("not in {}: {}", shard::model(inputs), strangers.join(", "));
        return Err(JobFailure::invalid("evaluate", "subjects", message));
    }
    Ok(slots)
}

/// One person's held-out frames.
struct Pictures {
    slot: usize,
    subject: String,
    display_name: String,
    frames: Vec<Picture>,
}

struct Picture {
    index: u32,
    pose: Pose,
    camera: Camera,
    image: FrameImage,
    exposure: FrameExposure,
}

impl Pictures {
    /// The held-out frames of the subject's capture, at `size` pixels.
    fn fetch(
        context: &JobContext,
        inputs: &Inputs,
        found: &Downloaded,
        slot: &IdentitySlot,
        size: u32,
    ) -> Result<Self, JobFailure> {
        let subject = &slot.subject;
        let (display_name, shard) = shard::with_refined_poses(context, inputs, found, subject)?;
        let film = capture_exposures(found.folder.path(), slot.slot as usize, &shard.track)
            .map_err(|error| JobFailure::failed("INTERNAL", "the exposures", &error))?;
        let frames = held_out(&shard, size, film.as_ref())?;
        Ok(Self {
            slot: slot.slot as usize,
            subject: slot.subject.clone(),
            display_name,
            frames,
        })
    }
}

fn held_out(
    shard: &Shard,
    size: u32,
    film: Option<&CaptureExposures>,
) -> Result<Vec<Picture>, JobFailure> {
    let track = &shard.track;
    let validation = Validation::Every(HOLDOUT_EVERY);
    let frames = track.frames.iter().enumerate();
    frames
        .filter(|(position, frame)| validation.holds_out(*position, frame.index))
        .map(|(position, frame)| {
            // Ingested captures were checked, so this is not a fault of the user.
            let fault = |error: yoto_capture::ViewError| {
                let doing = format!("the capture's frame {}", frame.index);
                JobFailure::failed("INTERNAL", &doing, &error)
            };
            Ok(Picture {
                index: frame.index,
                pose: Pose::from_frame(frame).map_err(fault)?,
                camera: Camera::from_frame(frame, track.image_size)
                    .map_err(fault)?
                    .scaled_to(size),
                image: shard.image(position).resized(size),
                exposure: film.map_or(FrameExposure::NEUTRAL, |film| film.near(frame.index)),
            })
        })
        .collect()
}

/// Each person's mean. The job renders `later` more frames after these.
fn measure(
    context: &JobContext,
    examiner: &Examiner,
    people: &[Pictures],
    later: usize,
) -> Result<Vec<Score>, JobFailure> {
    let total = people
        .iter()
        .map(|person| person.frames.len())
        .sum::<usize>()
        + later;
    let mut done = 0;
    let mut scores = Vec::new();
    for person in people {
        let mut mean = Mean::default();
        for picture in &person.frames {
            context.check()?;
            context.report_pieces("evaluating", done, total);
            let truth = Truth {
                pose: &picture.pose,
                camera: &picture.camera,
                image: &picture.image,
                exposure: picture.exposure,
            };
            let examined = examiner.examine(person.slot, &truth).map_err(|error| {
                let doing = format!("{}, frame {}", person.display_name, picture.index);
                JobFailure::failed("EVALUATION", &doing, &error)
            })?;
            mean.add(&examined.score);
            done += 1;
        }
        scores.push(mean.score());
    }
    context.report_pieces("evaluating", done, total);
    Ok(scores)
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_capture::ShardBuilder;
    use yoto_proto::v1::Model;
    use yoto_synthetic::SyntheticPerson;

    fn inputs() -> Inputs {
        let slot = |slot, subject: &str| IdentitySlot {
            slot,
            subject: subject.into(),
            trained: true,
        };
        let model = Model {
            name: "models/m".into(),
            slots: vec![slot(0, "subjects/a"), slot(2, "subjects/b")],
            ..Model::default()
        };
        Inputs {
            model: Some(model),
            ..Inputs::default()
        }
    }

    #[test]
    fn everybody_is_measured_unless_some_are_named() {
        let of = |subjects: &[&str]| {
            let spec = EvaluateSpec {
                subjects: subjects.iter().map(|&name| name.into()).collect(),
                ..EvaluateSpec::default()
            };
            let inputs = inputs();
            let found = slots(&spec, &inputs);
            found.map(|slots| slots.iter().map(|slot| slot.slot).collect::<Vec<_>>())
        };
        assert_eq!(of(&[]).expect("both"), [0, 2]);
        assert_eq!(of(&["subjects/b"]).expect("one"), [2]);
        let Err(JobFailure::Invalid(found)) = of(&["subjects/b", "subjects/x"]) else {
            panic!("a stranger is refused");
        };
        assert!(found[0].message.ends_with(": subjects/x"), "{found:?}");
    }

    #[test]
    fn a_person_who_came_after_the_training_is_left_out_unless_asked_for() {
        let inputs = inputs();
        let slots: Vec<_> = inputs.model.iter().flat_map(|model| &model.slots).collect();
        let spec = |subjects: &[&str]| EvaluateSpec {
            subjects: subjects.iter().map(|&name| name.into()).collect(),
            ..EvaluateSpec::default()
        };
        let everybody = spec(&[]);
        assert!(left_out(&everybody, &inputs, &[]).expect("all").is_empty());
        let notes = left_out(&everybody, &inputs, &slots[1..]).expect("one is left");
        assert!(notes[0].starts_with("subjects/b is left out"), "{notes:?}");
        let refused = |spec: &EvaluateSpec, unknown: &[&IdentitySlot]| {
            let found = left_out(spec, &inputs, unknown);
            matches!(
                found,
                Err(JobFailure::Failed {
                    code: "NOT_TRAINED",
                    ..
                })
            )
        };
        assert!(refused(&spec(&["subjects/b"]), &slots[1..]));
        assert!(refused(&everybody, &slots));
    }

    #[test]
    fn the_frames_are_those_that_training_keeps_out() {
        let (track, images) = SyntheticPerson::cast(1, 7)[0].capture(31, 24);
        let mut builder = ShardBuilder::new(track);
        for image in &images {
            builder.push(image).expect("fits");
        }
        let shard = builder.finish().expect("complete");
        let pictures = held_out(&shard, 16, None).expect("good frames");
        let indices: Vec<u32> = pictures.iter().map(|picture| picture.index).collect();
        let expected: Vec<u32> = [10, 30]
            .map(|at: usize| shard.track.frames[at].index)
            .into();
        assert_eq!(indices, expected);
        assert_eq!(pictures[0].image, images[10].resized(16));
        assert_eq!(pictures[0].camera.width.max(pictures[0].camera.height), 16);
    }
}
