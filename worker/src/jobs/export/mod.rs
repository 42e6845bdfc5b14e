//! Writes one person of a model to files that other programs play. Of a model of fields, splats are made
//! first.

mod distilled;
mod motions;

use super::{JobContext, JobFailure, checkpoint, shard};
use motions::Motions;
use yoto_avatar::render::{Renderer, SkinnedSplats};
use yoto_export::mesh::MeshOptions;
use yoto_export::order::{ExportError, Exported, File, Order};
use yoto_export::source::{Source, SourceError};
use yoto_proto::checks::export;
use yoto_proto::v1::{
    DistilledSplats, ExportResult, ExportSpec, ExportedFile, IdentitySlot, ObjectRef, Progress,
    RenderedFile,
};
use yoto_proto::worker::v1::Inputs;
use yoto_proto::{exports, keys, names};

/// Exports the person of the order.
///
/// # Errors
/// Bad requests, a model without a complete checkpoint, motions that do not fit the person, a training that
/// fails, and faults of the store.
pub fn run(
    context: &JobContext,
    spec: &ExportSpec,
    inputs: &Inputs,
) -> Result<ExportResult, JobFailure> {
    JobFailure::refuse("export", export::faults(spec))?;
    let slot = slot(spec, inputs)?;
    let (renderer, found) = checkpoint::load_renderer(context, inputs, "export")?;
    let body = renderer.skeleton(slot).ok_or_else(|| JobFailure::Failed {
        code: "NOT_TRAINED",
        message: format!(
            "{} was trained before {} joined the model",
            found.checkpoint.name,
            shard::person(inputs, &spec.subject)
        ),
    })?;
    let motions = Motions::new(context, spec, inputs, &found).all()?;
    let (person, distilled) = match splats(&renderer, slot)? {
        Some(person) => (person, None),
        None => {
            let (name, capture) =
                shard::with_refined_poses(context, inputs, &found, &spec.subject)?;
            let entry = inputs.shards.iter().find(|it| it.subject == spec.subject);
            let course = distilled::Order {
                context,
                checkpoint: &found.checkpoint,
                shard: entry.and_then(|it| it.shard.as_ref()),
                renderer: &renderer,
                slot,
                wanted: spec.distillation.as_ref(),
                name: &name,
            };
            let (person, distilled) = course.run(&capture, body)?;
            (person, Some(distilled))
        }
    };
    context.check()?;
    let done = distilled.as_ref().map_or(0.0, |_| distilled::SHARE);
    report(context, done);
    let exported = write(context, spec, inputs, motions, person)?;
    let files = commit(context, &exported)?;
    report(context, 1.0);
    let (triangles, texture) = exported.mesh.unwrap_or_default();
    Ok(ExportResult {
        files,
        checkpoint: names::checkpoint(&spec.model, found.manifest.step),
        splats: count(exported.splats.unwrap_or_default()),
        triangles: count(triangles),
        texture,
        distilled,
        device: context.device.info.adapter.clone(),
    })
}

/// Reports that this share of the job is done, and the files are next.
fn report(context: &JobContext, fraction: f64) {
    context.report(Progress {
        phase: "exporting".into(),
        fraction,
        ..Progress::default()
    });
}

/// The subject's slot in the model.
fn slot(spec: &ExportSpec, inputs: &Inputs) -> Result<usize, JobFailure> {
    let mut slots = inputs.model.iter().flat_map(|model| &model.slots);
    let of_subject = |slot: &&IdentitySlot| slot.subject == spec.subject;
    let found = slots.find(of_subject).ok_or_else(|| {
        let person = shard::person(inputs, &spec.subject);
        let message = format!("{person} is not in {}", shard::model(inputs));
        JobFailure::invalid("export", "subject", message)
    })?;
    Ok(found.slot as usize)
}

/// The splats of the person in `slot`; none of a model of fields.
fn splats(renderer: &Renderer, slot: usize) -> Result<Option<SkinnedSplats>, JobFailure> {
    let splats = renderer.skinned_splats(slot);
    splats.map_err(|error| JobFailure::failed("INTERNAL", "reading the splats", &error))
}

/// The files of a `person`. A large mesh takes minutes, mostly in other people's code.
fn write(
    context: &JobContext,
    spec: &ExportSpec,
    inputs: &Inputs,
    motions: Vec<Source>,
    person: SkinnedSplats,
) -> Result<Exported, JobFailure> {
    let (form, frame, mesh) = (spec.form(), spec.frame, mesh_options(spec));
    let max_bytes = (spec.max_bytes > 0).then_some(spec.max_bytes);
    let title = shard::person(inputs, &spec.subject).to_owned();
    let rights = inputs.rights.clone();
    let stem = match &*spec.file {
        "" => exports::FILE.to_owned(),
        stem => stem.to_owned(),
    };
    let work = move || {
        let order = Order {
            form,
            title: &title,
            stem: &stem,
            motions: &motions,
            frame,
            mesh,
            rights: &rights,
            max_bytes,
        };
        order.of(&person)
    };
    context.beside("writing the files", work)?.map_err(failure)
}

fn mesh_options(spec: &ExportSpec) -> MeshOptions {
    let standard = MeshOptions::default();
    MeshOptions {
        triangles: match spec.triangles {
            0 => standard.triangles,
            triangles => triangles as usize,
        },
        texture: match spec.texture {
            0 => standard.texture,
            texture => texture,
        },
    }
}

fn failure(error: ExportError) -> JobFailure {
    match error {
        ExportError::Motion(error) => of_motion(&error),
        error @ ExportError::TooFewBytes { .. } => {
            JobFailure::invalid("export", "max_bytes", error.to_string())
        }
        error => JobFailure::failed("EXPORT", "exporting the person", &error),
    }
}

/// A motion that the person can't take.
fn of_motion(error: &SourceError) -> JobFailure {
    match error {
        SourceError::NoFrame { .. } => JobFailure::invalid("export", "frame", error.to_string()),
        SourceError::TooFew { .. } | SourceError::NoneBelow { .. } => {
            JobFailure::invalid("export", "motions", error.to_string())
        }
        error => JobFailure::failed("RETARGET", "the motions", error),
    }
}

/// Writes the files, and commits them once all are written.
fn commit(context: &JobContext, exported: &Exported) -> Result<Vec<ExportedFile>, JobFailure> {
    let put = |file: &File| -> Result<ExportedFile, JobFailure> {
        context.check()?;
        let key = keys::render(context.job_id()?, context.claim.token, &file.name);
        let object: ObjectRef = context.put(&key, file.bytes.clone())?;
        Ok(ExportedFile {
            file: file.name.clone(),
            object: Some(object),
            content_type: file.content_type.into(),
        })
    };
    let files = exported.files.iter().map(put);
    let files = files.collect::<Result<Vec<_>, _>>()?;
    for file in &files {
        context.commit(RenderedFile {
            file: file.file.clone(),
            object: file.object.clone(),
        })?;
    }
    Ok(files)
}

/// A count of at most some millions.
fn count(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::{ExportForm, Model};

    #[test]
    fn orders_that_can_not_be_served_are_refused_by_field() {
        let spec = ExportSpec {
            subject: "subjects/b".into(),
            form: ExportForm::SplatsSpz.into(),
            ..ExportSpec::default()
        };
        let taken = IdentitySlot {
            slot: 3,
            subject: "subjects/a".into(),
            trained: true,
        };
        let inputs = Inputs {
            model: Some(Model {
                slots: vec![taken],
                ..Model::default()
            }),
            ..Inputs::default()
        };
        let Err(JobFailure::Invalid(found)) = slot(&spec, &inputs) else {
            panic!("nobody is in that slot");
        };
        assert_eq!(found[0].field, "subject");
        let known = ExportSpec {
            subject: "subjects/a".into(),
            ..spec
        };
        assert_eq!(slot(&known, &inputs).expect("is there"), 3);
        let far = SourceError::NoFrame {
            location: "ada".into(),
            number: 99,
            frames: 12,
        };
        let JobFailure::Invalid(found) = failure(ExportError::Motion(far)) else {
            panic!("the order is at fault");
        };
        assert_eq!(
            (&*found[0].field, &*found[0].message),
            ("frame", "ada: no frame 99 among its 12")
        );
    }

    #[test]
    fn a_mesh_costs_what_is_wanted() {
        let spec = ExportSpec {
            texture: 64,
            ..ExportSpec::default()
        };
        let options = mesh_options(&spec);
        assert_eq!(options.texture, 64);
        assert_eq!(options.triangles, exports::TRIANGLES as usize);
        assert_eq!(MeshOptions::default().texture, exports::TEXTURE);
    }
}
