//! Choice of a checkpoint when some are damaged.

use super::*;
use crate::jobs::test_context::context;

/// Stores a checkpoint of `step` whose weights contain the step's number.
async fn store(context: &JobContext, step: u64) -> Checkpoint {
    let key = format!("models/m/test-1/{step:09}");
    let weights = step.to_string();
    let object = context
        .objects
        .put(&format!("{key}/{}", files::WEIGHTS), weights.into())
        .await
        .expect("stored");
    let manifest = Manifest {
        version: manifest::VERSION,
        model: "models/m".into(),
        step,
        job: "jobs/test".into(),
        job_seconds: 1.5,
        job_steps: step,
        objects: vec![ManifestObject {
            file: files::WEIGHTS.into(),
            key: object.key,
            bytes: object.bytes,
            sha256: object.sha256,
        }],
    };
    let json = serde_json::to_vec(&manifest).expect("serialises");
    let object = context
        .objects
        .put(&format!("{key}/{}", files::MANIFEST), json.into())
        .await
        .expect("stored");
    Checkpoint {
        name: names::checkpoint("models/m", step),
        step,
        manifest: Some(object),
        ..Checkpoint::default()
    }
}

/// The step of the chosen checkpoint, after a check that its file is its own.
async fn serving(context: JobContext, checkpoints: Vec<Checkpoint>) -> Option<u64> {
    let job = move || first_whole(&context, &checkpoints, &[files::WEIGHTS]);
    let found = tokio::task::spawn_blocking(job)
        .await
        .expect("no panic")
        .expect("the store works")?;
    let weights = fs::read_to_string(found.folder.path().join(files::WEIGHTS)).expect("downloaded");
    assert_eq!(weights, found.manifest.step.to_string());
    Some(found.manifest.step)
}

#[tokio::test]
async fn the_newest_serves_while_it_is_whole() {
    let context = context();
    let checkpoints = vec![store(&context, 20).await, store(&context, 10).await];
    assert_eq!(serving(context, checkpoints).await, Some(20));
}

#[tokio::test]
async fn the_one_before_serves_when_weights_or_manifest_are_torn() {
    for torn in [files::WEIGHTS, files::MANIFEST] {
        let context = context();
        let checkpoints = vec![store(&context, 20).await, store(&context, 10).await];
        let key = format!("models/m/test-1/{:09}/{torn}", 20);
        context
            .objects
            .put(&key, "torn".into())
            .await
            .expect("overwritten");
        assert_eq!(serving(context, checkpoints).await, Some(10), "{torn}");
    }
}

#[tokio::test]
async fn none_serves_when_all_are_torn() {
    let context = context();
    let mut checkpoint = store(&context, 10).await;
    checkpoint.manifest = None;
    assert_eq!(serving(context, vec![checkpoint]).await, None);
}
