//! After what time somebody at one coordinator learns of what happens at the other.

use crate::stage::{Result, Stage, claim};
use std::time::{Duration, Instant};
use yoto_proto::v1::{JobKind, Progress, WatchJobRequest};
use yoto_proto::worker::v1::{
    EndJobRequest, HeartbeatRequest, Lease, WaitForJobRequest, end_job_request,
};
use yoto_test_postgres::Database;

/// Measurements of each.
const TIMES: usize = 40;
/// The longest pause of a worker between two requests.
const POLL: f64 = 2.0;

/// Measures with hints and without.
pub(crate) async fn run(
    database: impl Fn() -> std::result::Result<Database, &'static str>,
) -> Result<()> {
    for hints in [false, true] {
        let stage = Stage::open(Some(database()?), |config| config.hints = hints).await?;
        let model = stage.model_of_somebody().await?;
        let worker = stage.register(1, JobKind::Train).await?;
        let (mut leases, mut watches) = (Vec::new(), Vec::new());
        for number in 0..TIMES {
            let (lease, waited) = leased(&stage, &model, &worker, number).await?;
            leases.push(waited);
            watches.push(watched(&stage, &worker, &lease, number).await?);
            end(&stage, &worker, &lease).await?;
        }
        let name = match hints {
            true => "with hints",
            false => "by polling",
        };
        println!(
            "{name}: from the order of a training to its lease, {}",
            told(leases)
        );
        println!("{name}: from a report to a watcher, {}", told(watches));
    }
    Ok(())
}

/// A training that is ordered at one coordinator while a worker waits at the other, and the time until it has the lease.
async fn leased(
    stage: &Stage,
    model: &str,
    worker: &str,
    number: usize,
) -> Result<(Lease, Duration)> {
    let work = async {
        loop {
            if let Some(lease) = stage.lease(1, worker).await? {
                return Result::Ok((lease, Instant::now()));
            }
            let request = WaitForJobRequest {
                kinds: vec![JobKind::Train.into()],
                seconds: POLL,
            };
            stage.workers(1).wait_for_job(request).await?;
        }
    };
    let order = async {
        // At another moment of the worker's pause each time.
        tokio::time::sleep(Duration::from_secs_f64(POLL * spread(number))).await;
        let began = Instant::now();
        stage.train(0, model).await?;
        Result::Ok(began)
    };
    let ((lease, at), began) = tokio::try_join!(work, order)?;
    Ok((lease, at.duration_since(began)))
}

/// The time from a report at one coordinator to its arrival at a watcher at the other.
async fn watched(stage: &Stage, worker: &str, lease: &Lease, number: usize) -> Result<Duration> {
    let claim = claim(worker, lease);
    let request = WatchJobRequest {
        name: claim.job.clone(),
        after_sequence: 0,
    };
    let mut states = stage.jobs(1).watch_job(request).await?.into_inner();
    states.message().await?;
    tokio::time::sleep(Duration::from_secs_f64(0.25 * (1.0 + spread(number)))).await;
    let request = HeartbeatRequest {
        claim: Some(claim),
        progress: Some(Progress {
            step: 1,
            ..Progress::default()
        }),
    };
    let began = Instant::now();
    stage.workers(0).heartbeat(request).await?;
    states.message().await?;
    Ok(began.elapsed())
}

async fn end(stage: &Stage, worker: &str, lease: &Lease) -> Result<()> {
    let failed = yoto_proto::v1::JobError {
        code: "MEASURED".into(),
        ..Default::default()
    };
    let request = EndJobRequest {
        claim: Some(claim(worker, lease)),
        outcome: Some(end_job_request::Outcome::Failed(failed)),
    };
    stage.workers(1).end_job(request).await?;
    Ok(())
}

/// Shares from 0 to 1, evenly spread.
fn spread(number: usize) -> f64 {
    (number as f64 * 0.618_034).fract()
}

fn told(mut times: Vec<Duration>) -> String {
    times.sort_unstable();
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e3;
    format!("{:.0} ms p50, {:.0} ms at most", at(0.5), at(1.0))
}
