//! The service in one process is killed in the middle of a training, and started again on its folder.

use super::calls::Calls;
use super::checker::Final;
use super::ending;
use super::fault::Fault;
use super::history::{Event, History};
use super::observer::newest_attempt;
use super::processes::{Fleet, free_port};
use super::proxy::{Proxy, Target};
use super::workload::{Workload, train};
use anyhow::{Context, Result, ensure};
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::process::Child;
use std::sync::Arc;
use std::time::{Duration, Instant};
use yoto_proto::v1::job;
use yoto_server::Environment;
use yoto_server::fsck::Place;

/// Longest wait for something that has to happen.
const PATIENCE: Duration = Duration::from_secs(60);
/// Steps of the training, more than are made before the kill.
const STEPS: u64 = 150;

/// The process ends with this.
struct Ending(Child);

impl Drop for Ending {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Kills the service, and checks its jobs and objects against the `history`.
///
/// # Errors
/// When it does not recover, or a promise is broken.
pub(crate) async fn kill(fleet: &Fleet, history: &Arc<History>) -> Result<()> {
    let folder = fleet.folder().join("embedded");
    let port = free_port()?;
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    let calls = Calls::to(&[address])?;
    let mut service = Ending(fleet.start_embedded(port)?);
    // A history of its own: its jobs are not in the other service.
    let own = Arc::new(History::create(&fleet.folder().join("embedded.jsonl"))?);
    let proxy = Proxy::start(vec![Target::Port(address)]).await?;
    let workload = Workload::new(calls.clone(), proxy, Arc::clone(&own), fleet.folder())?;
    let avatar = workload.avatar().await?;
    let job = workload.ask(train(&avatar.model, STEPS), false).await?;
    let job = job.context("a training")?;
    let began = Instant::now();
    let before = loop {
        let now = calls.job(&job).await?;
        if now.progress.as_ref().is_some_and(|it| it.step > 0) {
            break now;
        }
        ensure!(began.elapsed() < PATIENCE, "it never made a step: {now:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    ensure!(before.state() == job::State::Running, "{before:?}");
    service.0.kill()?;
    service.0.wait()?;
    let killed = Instant::now();
    history.record(Event::Broken {
        fault: Fault::EmbeddedKilled,
    })?;
    service = Ending(fleet.start_embedded(port)?);
    while newest_attempt(&calls.job(&job).await?) == newest_attempt(&before) {
        ensure!(killed.elapsed() < PATIENCE, "{job} is not leased again");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    history.record(Event::Recovered {
        fault: Fault::EmbeddedKilled,
        seconds: killed.elapsed().as_secs_f64(),
    })?;
    let ended = workload.wait(&job).await?;
    ensure!(ended.state() == job::State::Succeeded, "{:?}", ended.error);
    check(&calls, &workload, &folder, &own).await?;
    drop(service);
    Ok(())
}

async fn check(calls: &Calls, workload: &Workload, folder: &Path, own: &History) -> Result<()> {
    let (events, mut end) = (own.events(), Final::default());
    let place = Place {
        data_dir: folder.to_owned(),
        database: None,
        objects: None,
        environment: Environment::default(),
    };
    ending::collect(calls, &place, &events, &mut end).await?;
    ending::repeat(calls, workload, &mut end).await?;
    let found = super::checker::check(&events, &end);
    ensure!(found.is_clean(), "embedded: {:?}", found.broken());
    Ok(())
}
