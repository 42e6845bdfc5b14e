//! Repeated calls: each first answer is lost after the call took effect. The client calls again, with the same effect.

use std::collections::HashSet;
use std::sync::{Arc, Mutex};
use tokio::net::TcpListener;
use yoto_client::{FileSource, UploadFile, YotoClient};
use yoto_proto::v1::{JobKind, Retention, job};
use yoto_server::faults::{Delivery, Faults, Moment};
use yoto_server::{Coordinator, ServerConfig};

/// Loses the first answer of each method.
#[derive(Debug, Default)]
struct First(Mutex<HashSet<String>>);

impl Faults for First {
    fn reached(&self, _: &str, _: Moment) {}

    fn delivery(&self, call: &str) -> Delivery {
        let first = self.0.lock().expect("no panic").insert(call.to_owned());
        Delivery {
            answered: !first,
            ..Delivery::ONCE
        }
    }
}

#[tokio::test]
async fn calls_that_may_be_repeated_are() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut config = ServerConfig::new(folder.path());
    config.storage.min_free_bytes = 0;
    let faults = Arc::new(First::default());
    config.faults = Some(Arc::clone(&faults) as Arc<dyn Faults>);
    let coordinator = Coordinator::open(config).await.expect("opens");
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
    let address = listener.local_addr().expect("has an address");
    let incoming = yoto_server::tcp(listener);
    let serving = tokio::spawn(coordinator.serve(incoming, std::future::pending()));
    let client = YotoClient::connect(&format!("http://{address}"))
        .await
        .expect("connects");

    let subject = client.create_subject("Ada", "").await.expect("creates");
    let poses = UploadFile {
        path: "poses.json".into(),
        source: FileSource::Memory(b"{}".to_vec()),
    };
    let uploaded = client.upload_capture(&subject.name, vec![poses], |_| {});
    let ingest = uploaded.await.expect("uploads").ingest_job;
    client
        .pause_jobs(JobKind::Train, "a look at the machine")
        .await
        .expect("pauses");
    client.resume_jobs(JobKind::Train).await.expect("resumes");
    let model = client.create_model("solo", "draft", "yoto").await;
    let model = model.expect("creates").name;
    let keep = Retention {
        newest: Some(7),
        ..Retention::default()
    };
    let kept = client.set_retention(&model, keep).await.expect("keeps");
    assert_eq!(kept.retention.and_then(|it| it.newest), Some(7));
    let cancelled = client.cancel_job(&ingest).await.expect("cancels");
    assert_eq!(cancelled.state(), job::State::Cancelled);
    let lost = faults.0.lock().expect("no panic");
    for call in ["PauseJobs", "ResumeJobs", "UpdateModel", "CancelJob"] {
        assert!(lost.contains(call), "{call} was never disturbed: {lost:?}");
    }
    serving.abort();
}
