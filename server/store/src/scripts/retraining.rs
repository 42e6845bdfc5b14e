//! The others of a model whose shared parameters have seen a person who is erased: a new model of them, trained from scratch.

use super::leaving::{job_of, slot_of};
use super::{jobs, models};
use crate::db::{Lock, Tx, sql};
use crate::{NewJob, NewModel, OpenErasure, StoreError, Tenant};
use yoto_proto::names::Collection;
use yoto_proto::v1::{JobPriority, JobSpec, TrainSpec, job_result, job_spec};

/// What is added to the name of a model.
const ANEW: &str = ", trained anew";

/// The id of the new model in place of `model_id`, which is made if there is none yet; `None` where nothing is to be trained: the shared
/// parameters have nothing of the person, nobody else is in the model, or it was never trained.
pub(crate) async fn model(
    tx: &mut Tx,
    erasure: &OpenErasure,
    model_id: &str,
) -> Result<Option<String>, StoreError> {
    let tenant = &erasure.tenant;
    tx.lock(Lock::Model(model_id)).await?;
    if let Some(made) = made(tx, &erasure.id, model_id).await? {
        return Ok(Some(made));
    }
    let old = models::get(tx, tenant, model_id).await?;
    let Some(slot) = slot_of(&old, &erasure.subject_id) else {
        return Ok(None);
    };
    let others: Vec<&str> = (old.slots.iter())
        .filter(|it| it.slot != slot)
        .map(|it| it.subject.as_str())
        .collect();
    let trained = trainings(tx, model_id).await?;
    if others.is_empty() || trained.is_empty() || !saw_them(tx, erasure, model_id).await? {
        return Ok(None);
    }
    let retention = old.retention.unwrap_or_default();
    let new = NewModel {
        display_name: named(&old.display_name),
        tier: old.tier,
        variant: old.variant,
        retention,
    };
    let made = models::create(tx, tenant, new, None).await?;
    let id = Collection::Models
        .parse(&made.name)
        .unwrap_or_default()
        .to_owned();
    for subject in others {
        let subject = Collection::Subjects.parse(subject).unwrap_or_default();
        models::fill_slot(tx, &id, subject).await?;
    }
    sql("UPDATE erasure_models SET retrained = $3 WHERE erasure = $1 AND model = $2")
        .bind(&erasure.id)
        .bind(model_id)
        .bind(&id)
        .execute(tx, "noting a model that is trained anew")
        .await?;
    Ok(Some(id))
}

/// Queues the training of `new_id` in place of `model_id`, unless it was queued before: with the settings of the old model's last
/// training, for as long as all of its trainings together.
pub(crate) async fn job(
    tx: &mut Tx,
    tenant: &Tenant,
    model_id: &str,
    new_id: &str,
) -> Result<(), StoreError> {
    tx.lock(Lock::Model(new_id)).await?;
    let queued =
        sql("SELECT EXISTS (SELECT 1 FROM jobs WHERE model = $1 AND kind = 'train') AS found")
            .bind(new_id)
            .one(tx, "looking for a training")
            .await?;
    let trained = trainings(tx, model_id).await?;
    let (false, Some(last)) = (queued.flag("found")?, trained.last()) else {
        return Ok(());
    };
    let (seconds, steps) = budget(&trained);
    let order = TrainSpec {
        model: Collection::Models.name(new_id),
        only: String::new(),
        leave: String::new(),
        seconds,
        steps,
        ..last.clone()
    };
    let new = NewJob {
        spec: JobSpec {
            kind: Some(job_spec::Kind::Train(order)),
        },
        priority: NewJob::column(JobPriority::Normal),
        owner: String::new(),
        trace_parent: None,
    };
    jobs::insert(tx, tenant, new).await.map(drop)
}

/// The new model in place of `model_id`, if one was made by this erasure.
pub(crate) async fn made(
    tx: &mut Tx,
    erasure_id: &str,
    model_id: &str,
) -> Result<Option<String>, StoreError> {
    let row = sql("SELECT retrained FROM erasure_models WHERE erasure = $1 AND model = $2")
        .bind(erasure_id)
        .bind(model_id)
        .row(tx, "looking for a model that is trained anew")
        .await?;
    Ok(row
        .map(|it| it.maybe_text("retrained"))
        .transpose()?
        .flatten())
}

/// Whether the job that took the person out of the model says that its shared parameters were trained with them. A job that was
/// interrupted does not tell what it wrote before.
async fn saw_them(tx: &mut Tx, erasure: &OpenErasure, model_id: &str) -> Result<bool, StoreError> {
    let job = job_of(tx, &erasure.tenant, &erasure.id, model_id).await?;
    let result = job.and_then(|it| it.result).and_then(|it| it.kind);
    Ok(match result {
        Some(job_result::Kind::Train(train)) => {
            train.removed.is_empty() || train.removed.iter().any(|it| it.trunk_saw_them)
        }
        _ => false,
    })
}

/// The orders of a model's trainings that have succeeded, oldest first.
async fn trainings(tx: &mut Tx, model_id: &str) -> Result<Vec<TrainSpec>, StoreError> {
    let rows = sql(
        "SELECT spec FROM jobs WHERE model = $1 AND kind = 'train' AND state = 'SUCCEEDED' ORDER BY ord",
    )
    .bind(model_id)
    .rows(tx, "listing trainings")
    .await?;
    let mut found = Vec::with_capacity(rows.len());
    for row in &rows {
        let spec: JobSpec = row.message("spec")?.unwrap_or_default();
        if let Some(job_spec::Kind::Train(train)) = spec.kind
            && train.leave.is_empty()
        {
            found.push(train);
        }
    }
    Ok(found)
}

/// Seconds and steps of all trainings together, in the unit of the last one; (0, 0), the length of the tier, where it has none.
fn budget(trained: &[TrainSpec]) -> (f64, u64) {
    let steps: u64 = trained.iter().map(|it| it.steps).sum();
    let timed = trained.iter().filter(|it| it.steps == 0);
    let seconds: f64 = timed.map(|it| it.seconds).sum();
    match trained.last() {
        Some(last) if last.steps > 0 => (0.0, steps),
        Some(last) if last.seconds > 0.0 => (seconds, 0),
        _ => (0.0, 0),
    }
}

/// The name of the new model.
fn named(old: &str) -> String {
    let room = yoto_proto::limits::DISPLAY_NAME_BYTES - ANEW.len();
    let end = old.floor_char_boundary(room.min(old.len()));
    format!("{}{ANEW}", &old[..end])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trainings_are_added_up_in_the_unit_of_the_last() {
        let of = |seconds, steps| TrainSpec {
            seconds,
            steps,
            ..TrainSpec::default()
        };
        assert_eq!(budget(&[of(60.0, 0), of(0.0, 100), of(30.0, 0)]), (90.0, 0));
        assert_eq!(
            budget(&[of(60.0, 0), of(0.0, 100), of(0.0, 50)]),
            (0.0, 150)
        );
        assert_eq!(budget(&[of(0.0, 0)]), (0.0, 0));
    }

    #[test]
    fn a_long_name_stays_within_its_limit() {
        assert_eq!(named("duo"), "duo, trained anew");
        let long = "\u{e4}".repeat(yoto_proto::limits::DISPLAY_NAME_BYTES);
        let new = named(&long);
        assert!(new.len() <= yoto_proto::limits::DISPLAY_NAME_BYTES && new.ends_with(ANEW));
    }
}
