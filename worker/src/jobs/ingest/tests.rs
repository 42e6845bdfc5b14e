//! The steps of an ingest job before its child starts.

use super::*;
use crate::jobs::test_context::context;
use yoto_proto::pose_track::FILE;
use yoto_proto::worker::v1::InputFile;

#[tokio::test]
async fn an_object_that_changed_after_the_upload_is_our_fault_not_the_owner_s() {
    let context = context();
    let written = context
        .objects
        .put("uploads/c/poses.json", "{}".into())
        .await
        .expect("stored");
    context
        .objects
        .put("uploads/c/poses.json", "[]".into())
        .await
        .expect("altered");
    let inputs = Inputs {
        files: vec![InputFile {
            path: FILE.into(),
            object: Some(written),
        }],
        ..Inputs::default()
    };
    let spec = IngestSpec {
        capture: "captures/c".into(),
    };
    let job = move || run(&context, &spec, &inputs);
    let failure = tokio::task::spawn_blocking(job)
        .await
        .expect("no panic")
        .expect_err("altered");
    assert!(
        matches!(
            failure,
            JobFailure::Failed {
                code: "OBJECTS",
                ..
            }
        ),
        "{failure:?}"
    );
}
