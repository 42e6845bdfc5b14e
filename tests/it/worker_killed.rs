//! A worker is killed during a training: the job is leased again, resumes from its last checkpoint
//! and finishes; calls with the dead worker's lease are refused.

use anyhow::{Context, ensure};
use std::path::Path;
use std::time::Instant;
use tonic::Code;
use yoto_client::YotoClient;
use yoto_proto::v1::job::State;
use yoto_proto::v1::{Job, JobResult, PoseRefinement, TrainSpec, job_result};
use yoto_proto::worker::v1::end_job_request::Outcome;
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_proto::worker::v1::{Claim, EndJobRequest, HeartbeatRequest, PublishCheckpointRequest};
use yoto_synthetic::SyntheticPerson;
use yoto_tests::people::write_capture;
use yoto_tests::process::{PATIENCE, Process, Service, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const STEPS: u64 = 400;

/// Watches `job` until `done`.
async fn until(
    client: &YotoClient,
    job: &str,
    what: &str,
    done: impl Fn(&Job) -> bool,
) -> anyhow::Result<Job> {
    let mut watch = client.watch_job(job);
    let deadline = Instant::now() + PATIENCE;
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let next = tokio::time::timeout(left, watch.next())
            .await
            .with_context(|| format!("waiting until {what}"))??;
        let job = next.with_context(|| format!("the job ended before {what}"))?;
        if done(&job) {
            return Ok(job);
        }
        ensure!(job.error.is_none(), "{:?}", job.error);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_workers_job_goes_on_from_its_last_checkpoint() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let service = Service::start(YOTO, &dir.path().join("data"), false)?;
    let mut first = service.worker(YOTO, "first")?;
    let client = YotoClient::connect(&service.address).await?;
    let (model, job) = training(&service, &client, dir.path()).await?;
    let kept = checkpoint_of(&client, &model, &job).await?;
    first.kill()?;
    let orphan = client.get_job(&job).await?;
    ensure!(
        (orphan.state(), orphan.attempts.len()) == (State::Running, 1),
        "{orphan:?}"
    );
    // It must run until the job has ended.
    let _second = resumed(&service, &client, &orphan, kept).await?;
    late_calls_are_refused(&service, &client, &model, &orphan).await?;
    succeeds(&client, &job).await
}

/// Queues a training of Ada. Returns the names of model and job.
async fn training(
    service: &Service,
    client: &YotoClient,
    dir: &Path,
) -> anyhow::Result<(String, String)> {
    let capture = dir.join("ada");
    write_capture(&SyntheticPerson::cast(1, 7)[0], 8, 48, &capture)?;
    let yoto = |arguments: &[&str]| {
        let server = ["--server", service.address.as_str()];
        succeed(YOTO, &[arguments, &server].concat())
    };
    let folder = capture.to_str().context("a path")?;
    yoto(&["subject", "add", "ada", "--capture", folder])?;
    yoto(&[
        "model",
        "create",
        "solo",
        "--subjects",
        "ada",
        "--tier",
        "draft",
    ])?;
    let model = client.find_model("solo").await?.name;
    let spec = TrainSpec {
        model: model.clone(),
        steps: STEPS,
        seed: 3,
        checkpoint_seconds: 0.5,
        // A resume also needs the poses as they were refined.
        refine_poses: PoseRefinement::Always.into(),
        ..TrainSpec::default()
    };
    let job = client.train(spec).await?.name;
    Ok((model, job))
}

/// Waits for a checkpoint to resume from, and several steps after it. Returns its step.
async fn checkpoint_of(client: &YotoClient, model: &str, job: &str) -> anyhow::Result<u64> {
    let kept = loop {
        let running = until(client, job, "a step was taken", |job| {
            job.progress.as_ref().is_some_and(|p| p.step > 0)
        })
        .await?;
        ensure!(running.state() == State::Running, "{running:?}");
        if let Some(checkpoint) = client.list_checkpoints(model).await?.first() {
            break checkpoint.step;
        }
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
    };
    ensure!(
        kept < STEPS,
        "the training was over before it could be disturbed"
    );
    Ok(kept)
}

/// Starts a second worker, which resumes the job from the checkpoint `kept` or a later one.
async fn resumed(
    service: &Service,
    client: &YotoClient,
    orphan: &Job,
    kept: u64,
) -> anyhow::Result<Process> {
    let mut second = service.worker(YOTO, "second")?;
    let line = second.line_with("training resumes")?;
    let step: u64 = line
        .split_once("step=")
        .and_then(|(_, rest)| rest.split_whitespace().next()?.parse().ok())
        .with_context(|| format!("a step in '{line}'"))?;
    assert!(
        step >= kept,
        "went on at step {step}, a checkpoint of step {kept} was there"
    );
    let resumed = client.get_job(&orphan.name).await?;
    let seen = (resumed.attempts.len(), resumed.worker == orphan.worker);
    assert_eq!(seen, (2, false));
    Ok(second)
}

/// The token of the first lease of `job`, from the folder of its checkpoints: the service tells it to the worker alone.
fn first_token(service: &Service, model: &str, job: &str) -> anyhow::Result<u64> {
    let objects = service.objects.trim_start_matches("file://");
    let own = format!("{}-", job.trim_start_matches("jobs/"));
    let mut tokens = Vec::new();
    for folder in std::fs::read_dir(Path::new(objects).join(model))? {
        let name = folder?.file_name();
        if let Some(token) = name.to_string_lossy().strip_prefix(&own) {
            tokens.push(token.parse::<u64>()?);
        }
    }
    tokens.into_iter().min().context("it has published")
}

/// Calls with the token of the dead worker.
async fn late_calls_are_refused(
    service: &Service,
    client: &YotoClient,
    model: &str,
    orphan: &Job,
) -> anyhow::Result<()> {
    let mut late = WorkerServiceClient::connect(service.address.clone()).await?;
    let claim = Claim {
        job: orphan.name.clone(),
        worker: orphan.worker.clone(),
        token: first_token(service, model, &orphan.name)?,
    };
    let heartbeat = HeartbeatRequest {
        claim: Some(claim.clone()),
        progress: None,
    };
    let refused = late
        .heartbeat(heartbeat)
        .await
        .expect_err("a late heartbeat");
    assert_eq!(refused.code(), Code::FailedPrecondition, "{refused}");
    let checkpoint = client.list_checkpoints(model).await?.first().cloned();
    let publish = PublishCheckpointRequest {
        claim: Some(claim.clone()),
        checkpoint,
        save_seconds: 0.5,
    };
    let refused = late
        .publish_checkpoint(publish)
        .await
        .expect_err("a late checkpoint");
    assert_eq!(refused.code(), Code::FailedPrecondition, "{refused}");

    let end = EndJobRequest {
        claim: Some(claim),
        outcome: Some(Outcome::Succeeded(JobResult::default())),
    };
    let refused = late.end_job(end).await.expect_err("a late result");
    assert_eq!(refused.code(), Code::FailedPrecondition, "{refused}");
    Ok(())
}

/// The job succeeds after two attempts, and has taken each step once.
async fn succeeds(client: &YotoClient, job: &str) -> anyhow::Result<()> {
    let ended = until(client, job, "it succeeded", |job| {
        job.state() == State::Succeeded
    })
    .await?;
    let attempts = client.get_job(job).await?.attempts;
    assert_eq!((attempts.len(), ended.lost_workers), (2, 1));
    let Some(job_result::Kind::Train(result)) = ended.result.and_then(|result| result.kind) else {
        anyhow::bail!("no result of a training");
    };
    let parts = &result.active_parts;
    ensure!(
        parts.iter().any(|part| part == "pose refinement"),
        "{parts:?}"
    );
    assert_eq!(
        result.steps, STEPS,
        "each step of the budget was taken once"
    );
    Ok(())
}
