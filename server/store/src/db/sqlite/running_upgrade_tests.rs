//! A job that runs while its database is brought up to date, from each earlier schema.

use super::migrations::migrations;
use super::upgrade_tests::write_schema;
use crate::Store;
use crate::stage::{running_job_goes_on, taken_back_from_the_process_before};
use std::path::Path;
use std::sync::Arc;
use yoto_process::clock::ManualClock;

/// The first schema with attempts, captures of jobs, the clock of leases, and workers in the coordinator's process.
const ATTEMPTS: i64 = 9;
/// The first schema with a counter of tokens.
const TOKENS: i64 = 11;
/// The first schema with tenants.
const TENANTS: i64 = 15;

/// What a service of schema `version` has while the worker `w` trains the job `j`.
fn running(version: i64) -> String {
    let (tenant, default) = match version >= TENANTS {
        true => (", tenant", ", 'default'"),
        false => ("", ""),
    };
    let (token, counted) = match version >= TOKENS {
        true => (", last_token", ", 77"),
        false => ("", ""),
    };
    let mut content = format!(
        "INSERT INTO subjects (id, display_name, consent_note{tenant}) VALUES ('s', 'Ada', ''{default});
         INSERT INTO captures (id, subject, state, shard_key, shard_bytes, shard_sha256)
             VALUES ('c', 's', 'READY', 'k', 1, 'x');
         INSERT INTO models (id, display_name, tier, variant{tenant}) VALUES ('m', 'm', 'draft', 'yoto'{default});
         INSERT INTO slots (model, slot, subject) VALUES ('m', 0, 's');
         INSERT INTO workers (id, display_name, backend, adapter, gpu, memory_bytes{tenant})
             VALUES ('w', 'w', 'cpu', 'cpu', 0, 0{default});
         INSERT INTO worker_kinds VALUES ('w', 'train');
         INSERT INTO jobs (id, kind, model, state, spec, lease, worker, lease_deadline{token}{tenant})
             VALUES ('j', 'train', 'm', 'RUNNING', x'120A0A086D6F64656C732F6D', 77, 'w', 1e10{counted}{default});"
    );
    if version >= ATTEMPTS {
        content.push_str(
            "INSERT INTO job_attempts (job, lease, worker, begin_time) VALUES ('j', 77, 'w', 1.5);
             INSERT INTO job_captures (job, subject, capture) VALUES ('j', 's', 'c');
             INSERT INTO lease_clock (id, last_tick) VALUES (1, 1.5);",
        );
    }
    content
}

/// The schema of `version` with `content`, opened by this program.
async fn upgraded(folder: &Path, version: i64, content: String) -> Store {
    let path = folder.join(format!("{version}.db"));
    write_schema(&path, version, content).await;
    let store = Store::open_sqlite(&path, Arc::new(ManualClock::at(2.0))).await;
    store.unwrap_or_else(|error| panic!("schema {version}: {error}"))
}

/// All schemas but this program's own.
fn earlier() -> Vec<i64> {
    let mut versions: Vec<i64> = migrations().iter().map(|it| it.version).collect();
    versions.pop().expect("a schema");
    versions
}

#[tokio::test]
async fn a_running_job_goes_on_after_the_upgrade_of_each_earlier_schema() {
    let folder = tempfile::tempdir().expect("a folder");
    for version in earlier() {
        let store = upgraded(folder.path(), version, running(version)).await;
        running_job_goes_on(&store, usize::from(version >= ATTEMPTS)).await;
        store.close().await;
    }
}

#[tokio::test]
async fn a_job_of_the_process_before_the_upgrade_is_taken_back() {
    let folder = tempfile::tempdir().expect("a folder");
    for version in earlier().into_iter().filter(|it| *it >= ATTEMPTS) {
        let embedded = "UPDATE workers SET embedded = 1;";
        let store = upgraded(folder.path(), version, running(version) + embedded).await;
        taken_back_from_the_process_before(&store).await;
        store.close().await;
    }
}
