//! The jobs that end when a consent is revoked: those of its purpose, whatever their kind, and no others.

use super::{consent_rule, consents};
use crate::db::{Tx, sql};
use crate::stage::{DatabaseKind, on_each_database};
use crate::{JobKind, StoreError, Tenant};
use std::sync::Arc;
use yoto_process::clock::ManualClock;
use yoto_proto::v1::ConsentPurpose;

/// A person with a capture, and a model.
const ROWS: [&str; 3] = [
    "INSERT INTO subjects (id, display_name, consent_note, create_time, tenant) VALUES ('s', 'Ada', '', 1, 'default')",
    "INSERT INTO captures (id, subject, state, create_time, idle_since, shard_key, shard_bytes, shard_sha256)
     VALUES ('c', 's', 'READY', 1, 1, 'shard', 3, 'x')",
    "INSERT INTO models (id, display_name, tier, variant, create_time, tenant) VALUES ('m', 'm', 'draft', 'yoto', 1, 'default')",
];

/// Queues a job that needs the person. Its id is the name of its kind.
async fn insert_job(tx: &mut Tx, kind: &str) {
    let is_ingest = kind == JobKind::Ingest.as_str();
    let (capture, model) = if is_ingest {
        (Some("c"), None)
    } else {
        (None, Some("m"))
    };
    sql("INSERT INTO jobs (id, tenant, kind, capture, model, spec, create_time) VALUES ($1, 'default', $1, $2, $3, $4, 1)")
        .bind(kind)
        .bind(capture)
        .bind(model)
        .bind(Vec::<u8>::new())
        .execute(tx, "queuing")
        .await
        .expect("is queued");
    sql("INSERT INTO job_captures (job, subject, capture) VALUES ($1, 's', 'c')")
        .bind(kind)
        .execute(tx, "pinning")
        .await
        .expect("is pinned");
}

/// Revokes a consent of the person, and looks for the jobs that end.
async fn revoke(tx: &mut Tx, purpose: ConsentPurpose) -> Result<Vec<String>, StoreError> {
    let own = Tenant::default();
    consents::revoke(tx, &own, "s", &[purpose], "", None).await?;
    consent_rule::to_stop(tx, Some("s")).await
}

on_each_database!(
    a_revocation_finds_the_jobs_of_its_purpose,
    a_job_of_an_unknown_kind_is_not_passed_over,
);

async fn a_revocation_finds_the_jobs_of_its_purpose(kind: DatabaseKind) {
    let staged = kind.store(Arc::new(ManualClock::at(1e9))).await;
    let expected: [(_, &[&str]); 4] = [
        (ConsentPurpose::ConsentShare, &[]),
        (ConsentPurpose::ConsentTrain, &["train", "evaluate"]),
        (ConsentPurpose::ConsentRender, &["render"]),
        (ConsentPurpose::ConsentExport, &["export"]),
    ];
    for (purpose, jobs) in expected {
        // It is not committed, so each purpose is revoked alone.
        let mut tx = staged.store.db.write().await.expect("begins");
        for row in ROWS {
            sql(row).execute(&mut tx, "inserting").await.expect(row);
        }
        for kind in JobKind::ALL {
            insert_job(&mut tx, kind.as_str()).await;
        }
        let found = revoke(&mut tx, purpose).await;
        assert_eq!(found.expect("reads"), jobs, "{purpose:?}");
        let of_anybody = consent_rule::to_stop(&mut tx, None).await;
        assert_eq!(of_anybody.expect("reads"), jobs, "{purpose:?}");
    }
}

async fn a_job_of_an_unknown_kind_is_not_passed_over(kind: DatabaseKind) {
    let staged = kind.store(Arc::new(ManualClock::at(1e9))).await;
    let mut tx = staged.store.db.write().await.expect("begins");
    for row in ROWS {
        sql(row).execute(&mut tx, "inserting").await.expect(row);
    }
    let allow = match kind {
        DatabaseKind::Sqlite => "PRAGMA ignore_check_constraints = 1",
        DatabaseKind::Postgres => "ALTER TABLE jobs DROP CONSTRAINT jobs_kind_check",
    };
    let allowed = sql(allow).execute(&mut tx, "allowing any kind").await;
    allowed.expect("allows any kind");
    insert_job(&mut tx, "dance").await;
    let found = revoke(&mut tx, ConsentPurpose::ConsentRender).await;
    assert!(
        matches!(&found, Err(StoreError::Corrupt { what: "kind", detail }) if detail == "dance"),
        "{found:?}"
    );
}
