//! The reads of pages return rows of the asker's tenant alone, and the same as the calls for each row.

use crate::db::{Tx, sql};
use crate::stage::{DatabaseKind, Staged, on_each_database};
use crate::{JobFilter, JobGroup, JobKind, Membership, OperatorNote, Page, Tenant};
use std::sync::Arc;
use yoto_process::clock::{Clock, ManualClock};
use yoto_proto::keys::{CHECK, FRAMES};
use yoto_proto::v1::job;

/// Two tenants with the same of everything, whose ids begin with `a` and `b`.
struct Stage {
    staged: Staged,
    own: Tenant,
}

const ALL: Page = Page {
    limit: 100,
    after: None,
};

/// The rows of a tenant. `@` is the beginning of its ids, `$1` its id, and `$2` an order; the newer capture of the person was
/// rejected.
const ROWS: [&str; 17] = [
    "INSERT INTO subjects (id, display_name, consent_note, create_time, tenant) VALUES ('@-s', 'Ada of @', '', 1, $1)",
    "INSERT INTO captures (id, subject, state, frames, create_time, idle_since, shard_key, shard_bytes, shard_sha256)
     VALUES ('@-ready', '@-s', 'READY', 7, 1, 1, 'shard-@', 3, 'x')",
    "INSERT INTO captures (id, subject, state, create_time, idle_since) VALUES ('@-rejected', '@-s', 'REJECTED', 1, 1)",
    "INSERT INTO capture_objects (capture, file, key, bytes, sha256) VALUES ('@-ready', 'check.json', 'check-@', 3, 'x')",
    "INSERT INTO capture_violations (capture, number, code, file, field, message)
     VALUES ('@-rejected', 0, 'X', 'a.png', '', 'is blurred')",
    "INSERT INTO consents (id, subject, given_by, note, create_time) VALUES ('@-c1', '@-s', 'Ada', '', 1)",
    "INSERT INTO consent_purposes (consent, purpose) VALUES ('@-c1', 'CONSENT_RENDER'), ('@-c1', 'CONSENT_TRAIN')",
    "INSERT INTO consents (id, subject, given_by, note, create_time) VALUES ('@-c2', '@-s', 'Ada', '', 1)",
    "INSERT INTO models (id, display_name, tier, variant, create_time, tenant) VALUES ('@-m', 'model of @', 'draft', 'yoto', 1, $1)",
    "INSERT INTO models (id, display_name, tier, variant, create_time, tenant) VALUES ('@-n', 'nobody', 'draft', 'yoto', 1, $1)",
    "INSERT INTO slots (model, slot, subject) VALUES ('@-m', 1, '@-s')",
    "INSERT INTO jobs (id, kind, model, spec, create_time, tenant, state, end_time)
     VALUES ('@-done', 'train', '@-m', $2, 1, $1, 'SUCCEEDED', 2)",
    "INSERT INTO job_metrics (job, step, seconds, loss) VALUES ('@-done', 10, 1, 0.5), ('@-done', 20, 2, 0.25)",
    "INSERT INTO checkpoints (model, step, manifest_key, manifest_bytes, manifest_sha256, bytes, create_time, slots, number)
     VALUES ('@-m', 10, 'k', 1, 'x', 1, 1, '1', 1), ('@-m', 20, 'k', 1, 'x', 1, 1, '0', 2)",
    "INSERT INTO jobs (id, kind, model, spec, create_time, tenant) VALUES ('@-first', 'train', '@-m', $2, 1, $1)",
    "INSERT INTO jobs (id, kind, model, spec, create_time, tenant) VALUES ('@-second', 'train', '@-m', $2, 1, $1)",
    "INSERT INTO cordons (tenant, worker, reason, since) VALUES ($1, 'w of @', 'hot', 1)",
];

async fn insert(tx: &mut Tx, tenant: &Tenant, begin: &str) {
    for row in ROWS {
        // Each statement takes both parameters.
        let text = format!("WITH taken AS (SELECT $1 AS tenant, $2 AS spec) {row}");
        let statement = sql(text.replace('@', begin)).bind(tenant.id());
        let statement = statement.bind(Vec::<u8>::new());
        let inserted = statement.execute(tx, "inserting").await;
        inserted.unwrap_or_else(|error| panic!("{row}: {error}"));
    }
}

impl Stage {
    async fn set(kind: DatabaseKind) -> Self {
        let clock: Arc<dyn Clock> = Arc::new(ManualClock::at(1e9));
        let staged = kind.store(clock).await;
        let own = Tenant::default();
        let other = Tenant::new("other").expect("an id");
        let mut tx = staged.store.db.write().await.expect("begins");
        insert(&mut tx, &own, "a").await;
        insert(&mut tx, &other, "b").await;
        tx.commit().await.expect("commits");
        Self { staged, own }
    }
}

on_each_database!(
    names_are_the_own_ones,
    people_have_the_newest_ready_capture,
    captures_have_their_files_and_violations,
    each_list_of_jobs_is_as_the_call_has_it,
    figures_checkpoints_and_consents_are_the_own_ones,
    a_person_is_in_the_models_that_have_them,
    the_state_of_the_queue_is_the_own_one,
);

async fn names_are_the_own_ones(kind: DatabaseKind) {
    let Stage { staged, own } = Stage::set(kind).await;
    let asked = [
        "models/a-m",
        "models/b-m",
        "subjects/a-s",
        "subjects/b-s",
        "captures/a-ready",
        "captures/b-ready",
        "models/none",
        "jobs/a-done",
        "nothing",
        "",
    ];
    let names = staged.store.names(&own, &asked).await.expect("reads");
    let mut names: Vec<(&str, &str)> = names.iter().map(|it| (&**it.0, &**it.1)).collect();
    names.sort_unstable();
    let expected = [
        ("captures/a-ready", "Ada of a"),
        ("models/a-m", "model of a"),
        ("subjects/a-s", "Ada of a"),
    ];
    assert_eq!(names, expected);
    let none = staged.store.names(&own, &["jobs/a-done"]).await;
    assert!(none.expect("reads nothing").is_empty());
}

async fn people_have_the_newest_ready_capture(kind: DatabaseKind) {
    let Stage { staged, own } = Stage::set(kind).await;
    let people = staged.store.people(&own, &["b-s", "a-s", "none"]).await;
    let [ada] = &people.expect("reads")[..] else {
        panic!("one is the tenant's");
    };
    assert_eq!(
        ada.subject,
        staged.store.subject(&own, "a-s").await.expect("is there")
    );
    let portrait = ada.portrait.as_ref().expect("has captures");
    let capture = staged
        .store
        .capture(&own, "a-ready")
        .await
        .expect("is there");
    assert_eq!(portrait.capture.name, capture.name);
    assert_eq!(
        (portrait.capture.frames, &portrait.capture.check),
        (7, &capture.check)
    );
    assert_eq!(portrait.object(CHECK).expect("has a report").key, "check-a");
    let nobody = staged.store.people(&own, &[]).await;
    assert!(nobody.expect("reads nothing").is_empty());
}

async fn captures_have_their_files_and_violations(kind: DatabaseKind) {
    let Stage { staged, own } = Stage::set(kind).await;
    let store = &staged.store;
    let found = store
        .captures_with_files(&own, "a-s", 10)
        .await
        .expect("lists");
    let listed = store.captures(&own, ALL, Some("a-s")).await.expect("lists");
    assert_eq!(found.len(), 2);
    for (found, listed) in found.iter().zip(&listed) {
        assert_eq!(found.capture, listed.item);
        let id = found.capture.name.trim_start_matches("captures/");
        assert_eq!(
            found.capture,
            store.capture(&own, id).await.expect("is there")
        );
    }
    let files: Vec<&str> = found[0].files.iter().map(|it| &*it.file).collect();
    assert_eq!(files, [CHECK, FRAMES]);
    assert!(found[1].files.is_empty());
    assert_eq!(found[1].capture.violations[0].message, "is blurred");
    assert_eq!(
        store.captures(&own, ALL, None).await.expect("lists").len(),
        2
    );
    store
        .captures_with_files(&own, "b-s", 10)
        .await
        .expect_err("is another's");
}

async fn each_list_of_jobs_is_as_the_call_has_it(kind: DatabaseKind) {
    let Stage { staged, own } = Stage::set(kind).await;
    let filters = [
        JobFilter {
            states: vec![job::State::Queued],
            ..JobFilter::default()
        },
        JobFilter {
            kinds: vec![JobKind::Render, JobKind::Export],
            ..JobFilter::default()
        },
        JobFilter {
            model_id: Some("a-m".into()),
            ..JobFilter::default()
        },
        JobFilter {
            model_id: Some("b-m".into()),
            ..JobFilter::default()
        },
    ];
    let mut groups = Vec::new();
    let mut expected = Vec::new();
    for (filter, full) in filters.into_iter().zip([false, false, true, true]) {
        let page = Page {
            limit: 2,
            after: None,
        };
        let listed = staged
            .store
            .jobs(&own, page, &filter, full)
            .await
            .expect("lists");
        expected.push(listed.into_iter().map(|it| it.item).collect::<Vec<_>>());
        groups.push(JobGroup {
            filter,
            most: 2,
            full,
            positions: true,
            ids: None,
        });
    }
    let found = staged.store.job_groups(&own, &groups).await.expect("lists");
    assert_eq!(found, expected);
    let of_queue: Vec<u32> = found[0].iter().map(|it| it.queue_position).collect();
    assert_eq!(of_queue, [1, 0]);
    assert!(found[1].is_empty() && found[2].len() == 2 && found[3].is_empty());
    for group in &mut groups {
        group.positions = false;
    }
    let found = staged.store.job_groups(&own, &groups).await.expect("lists");
    assert!(found.iter().flatten().all(|it| it.queue_position == 0));
    assert!(found[2].iter().all(|it| it.spec.is_some()));
    assert!(found[0].iter().all(|it| it.spec.is_none()));
    assert!(
        staged
            .store
            .job_groups(&own, &[])
            .await
            .expect("lists")
            .is_empty()
    );
    for (ids, expected) in [(vec![], 0), (vec!["a-done", "b-done", "a-first"], 2)] {
        let group = JobGroup {
            most: 10,
            ids: Some(ids.into_iter().map(str::to_owned).collect()),
            ..JobGroup::default()
        };
        let found = staged
            .store
            .job_groups(&own, &[group])
            .await
            .expect("lists");
        assert_eq!(found[0].len(), expected);
    }
}

async fn figures_checkpoints_and_consents_are_the_own_ones(kind: DatabaseKind) {
    let Stage { staged, own } = Stage::set(kind).await;
    let store = &staged.store;
    let figures = store
        .figures_of(&own, &["a-done", "b-done", "a-first"])
        .await;
    let mut figures = figures.expect("reads");
    let of_job = store.job_metrics(&own, "a-done").await.expect("reads");
    assert_eq!(figures.remove("a-done"), Some(of_job.points));
    assert!(figures.is_empty(), "{figures:?}");
    let checkpoints = store.checkpoints_of(&own, &["a-m", "b-m", "a-n"]).await;
    let mut checkpoints = checkpoints.expect("reads");
    let of_model = store.checkpoints(&own, "a-m", 10).await.expect("reads");
    assert_eq!(
        of_model.iter().map(|it| it.step).collect::<Vec<_>>(),
        [20, 10]
    );
    assert_eq!(checkpoints.remove("a-m"), Some(of_model));
    assert!(checkpoints.is_empty(), "{checkpoints:?}");
    store
        .checkpoints(&own, "b-m", 10)
        .await
        .expect_err("is another's");
    assert!(
        store
            .checkpoints(&own, "a-n", 10)
            .await
            .expect("reads")
            .is_empty()
    );
    let consents = store
        .consents_of(&own, &["a-s", "b-s"])
        .await
        .expect("reads");
    let of_person = store.consents(&own, "a-s", ALL).await.expect("reads");
    let of_person: Vec<_> = of_person.into_iter().map(|it| it.item).collect();
    assert_eq!(consents, of_person);
    let purposes: Vec<usize> = consents.iter().map(|it| it.items.len()).collect();
    assert_eq!(purposes, [0, 2]);
    let newest = Page {
        limit: 1,
        after: None,
    };
    let newest = store.consents(&own, "a-s", newest).await.expect("reads");
    assert_eq!((newest.len(), &newest[0].item), (1, &consents[0]));
    store
        .consents(&own, "b-s", ALL)
        .await
        .expect_err("is another's");
}

async fn a_person_is_in_the_models_that_have_them(kind: DatabaseKind) {
    let Stage { staged, own } = Stage::set(kind).await;
    let store = &staged.store;
    let member = |model: &str, display_name: &str, trained| Membership {
        model: format!("models/{model}"),
        display_name: display_name.into(),
        trained,
    };
    let nobody = member("a-n", "nobody", None);
    let found = store.memberships(&own, "a-s").await.expect("reads");
    // The newest checkpoint has another slot alone.
    assert_eq!(
        found,
        [member("a-m", "model of a", Some(false)), nobody.clone()]
    );
    let found = store.memberships(&own, "b-s").await.expect("reads");
    assert_eq!(found, [member("a-m", "model of a", None), nobody]);
    let models = store.models(&own, ALL).await.expect("lists");
    let models: Vec<_> = models.into_iter().map(|it| it.item).collect();
    assert_eq!(
        store
            .models_of(&own, &["a-n", "b-m", "a-m"])
            .await
            .expect("reads"),
        models
    );
    let slots: Vec<(u32, bool)> = models[0]
        .slots
        .iter()
        .map(|it| (it.slot, it.trained))
        .collect();
    assert_eq!(slots, [(1, false)]);
    store
        .require_model(&own, "b-m")
        .await
        .expect_err("is another's");
}

async fn the_state_of_the_queue_is_the_own_one(kind: DatabaseKind) {
    let Stage { staged, own } = Stage::set(kind).await;
    let store = &staged.store;
    let note = |reason, key| OperatorNote { reason, key };
    for (kind, note) in [
        (JobKind::Render, note("no lamp", "k")),
        (JobKind::Export, note("", "")),
    ] {
        store.pause_jobs(&own, kind, note).await.expect("pauses");
    }
    store.drain(note("soon", "k")).await.expect("drains");
    let state = store.service_state(&own).await.expect("reads");
    assert_eq!((state.queued, state.running), (2, 0));
    assert_eq!(state.paused, store.paused_kinds(&own).await.expect("reads"));
    let by: Vec<&str> = state.paused.iter().map(|it| &*it.by).collect();
    assert_eq!(by, ["", "keys/k"]);
    assert_eq!(state.draining, store.draining().await.expect("reads"));
    let cordons: Vec<&str> = state.cordons.iter().map(|it| &*it.display_name).collect();
    assert_eq!(cordons, ["w of a"]);
}
