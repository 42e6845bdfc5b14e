//! The service's promises under faults: real processes, broken by a seeded plan while clients use them, and
//! a checker over everything that was acknowledged.
//!
//! | file | idea |
//! |---|---|
//! | `fault`, `plan` | what can go wrong, and in which order it does |
//! | `parts` | the processes, made to fail as told |
//! | `outside` | the database and the store that the processes share |
//! | `processes`, `proxy` | started, killed, stopped; connections cut |
//! | `calls`, `workload` | clients that repeat calls by their request ids |
//! | `breakage`, `late`, `embedded` | each fault, and the recovery from it |
//! | `history`, `observer`, `ending` | what was seen, and what is left |
//! | `checker`, `report` | whether the promises were kept |
//! | `load` | not faults, but a measurement: the coordinator under the load of a cluster |

mod breakage;
mod calls;
mod checker;
mod embedded;
mod ending;
mod fault;
mod history;
mod late;
pub mod load;
mod observer;
mod outside;
mod parts;
mod plan;
mod processes;
mod proxy;
mod records;
mod report;
mod workload;

pub use parts::Part;

use anyhow::{Context, Result};
use breakage::{Breaker, Keys};
use calls::Calls;
use checker::Final;
use clap::Args;
use fault::{Fault, Makeup};
use futures::FutureExt;
use history::{Event, History};
use outside::Outside;
use plan::Plan;
use processes::Fleet;
use proxy::{Proxy, Target};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use report::Report;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use workload::{Avatar, Workload};

/// Longest time for all jobs to end after the last fault.
const SETTLE: Duration = Duration::from_secs(180);
/// Longest time for the coordinators to end with watchers that never read.
const DRAIN: Duration = Duration::from_secs(20);
/// Interval at which ended processes are started again.
const TEND: Duration = Duration::from_millis(50);

/// What to run.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Time of breaking, at least one round of all faults.
    #[arg(long, default_value_t = 10.0)]
    pub minutes: f64,
    /// Seed of the faults and the load.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// One round: of all faults, or of those that the smallest service can't have if this one has more than that.
    #[arg(long, conflicts_with = "minutes")]
    pub short: bool,
    /// Number of coordinators. Several need --postgres.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=8))]
    pub coordinators: u8,
    /// Number of workers.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..=32))]
    pub workers: u8,
    /// Rows in a private PostgreSQL in place of SQLite.
    #[arg(long)]
    pub postgres: bool,
    /// Objects in S3, on a server in this process, in place of a folder.
    #[arg(long)]
    pub s3: bool,
    /// Length of a lease, seconds.
    #[arg(long, default_value_t = 3.0)]
    pub lease_seconds: f64,
    /// Only these faults, by name: for a look at one of them; the others are reported as missing.
    #[arg(long, value_delimiter = ',')]
    pub only: Vec<String>,
    /// Folder for data, logs and history, kept at the end; a temporary one without it.
    #[arg(long, value_name = "DIR")]
    pub keep: Option<PathBuf>,
}

impl Options {
    fn makeup(&self) -> Makeup {
        Makeup {
            coordinators: self.coordinators.into(),
            postgres: self.postgres,
            s3: self.s3,
        }
    }

    /// The faults that have to happen.
    fn kinds(&self) -> Vec<Fault> {
        let makeup = self.makeup();
        match self.short && makeup != Makeup::SMALL {
            true => Fault::of_several(makeup),
            false => Fault::kinds(makeup),
        }
    }
}

/// Runs it and returns the report.
///
/// # Errors
/// When it can't be run; a broken promise is in the report.
pub async fn run(options: Options) -> Result<Report> {
    let temporary = tempfile::tempdir()?;
    let folder = options.keep.as_deref().unwrap_or(temporary.path());
    let makeup = options.makeup();
    anyhow::ensure!(
        makeup.postgres || makeup.coordinators == 1,
        "several coordinators share a database: add --postgres"
    );
    std::fs::create_dir_all(folder)?;
    let folder = folder.canonicalize()?;
    let history = Arc::new(History::create(&folder.join("history.jsonl"))?);
    let outside = Outside::start(makeup, &folder)?;
    let fleet = Fleet::new(
        &folder,
        outside,
        makeup.coordinators,
        options.lease_seconds,
        options.seed,
    );
    let fleet = Arc::new(fleet.await?);
    fleet.start_coordinators()?;
    for _ in 0..options.workers {
        fleet.start_lasting().await?;
    }
    let calls = Calls::to(&fleet.addresses())?;
    let done = Arc::new(AtomicBool::new(false));
    let tending = tokio::spawn(tend(
        Arc::clone(&fleet),
        calls.clone(),
        Arc::clone(&history),
        Arc::clone(&done),
    ));
    let mut failures = Vec::new();
    let torture = Torture {
        options,
        fleet: Arc::clone(&fleet),
        calls,
        history: Arc::clone(&history),
    };
    let mut end = Final::default();
    if let Err(error) = torture.run(&folder, &mut failures, &mut end).await {
        failures.push(format!("{error:#}"));
    }
    done.store(true, Ordering::SeqCst);
    if let Err(error) = tending.await.context("the tending of processes")? {
        failures.push(format!("{error:#}"));
    }
    if let Err(error) = fleet.end_coordinators(DRAIN).await {
        failures.push(format!("{error:#}"));
    }
    let events = history.events();
    Ok(Report {
        kinds: torture.options.kinds(),
        faults: count(&events, fleet.controls().noted()),
        findings: checker::check(&events, &end),
        lease_seconds: torture.options.lease_seconds,
        failures,
    })
}

/// How often each fault has happened, by the history and by the notes of the processes.
fn count(events: &[Event], noted: BTreeMap<Fault, usize>) -> BTreeMap<Fault, usize> {
    let mut counts = noted;
    for event in events {
        if let Event::Broken { fault } = event {
            *counts.entry(*fault).or_default() += 1;
        }
    }
    counts
}

/// Starts ended processes again until `done`, and measures how long a coordinator is away.
async fn tend(
    fleet: Arc<Fleet>,
    calls: Calls,
    history: Arc<History>,
    done: Arc<AtomicBool>,
) -> Result<()> {
    while !done.load(Ordering::SeqCst) {
        if let Some(ended) = fleet.tend()? {
            // Not found, and yet an answer.
            let _ = calls.job("jobs/none").await;
            history.record(Event::Recovered {
                fault: Fault::CoordinatorKilled,
                seconds: ended.elapsed().as_secs_f64(),
            })?;
        }
        tokio::time::sleep(TEND).await;
    }
    Ok(())
}

struct Torture {
    options: Options,
    fleet: Arc<Fleet>,
    calls: Calls,
    history: Arc<History>,
}

impl Torture {
    /// Breaks the running service. Adds errors to `failures`, and writes the state at the end to `end`.
    async fn run(&self, folder: &Path, failures: &mut Vec<String>, end: &mut Final) -> Result<()> {
        let addresses = self.fleet.addresses();
        let targets = addresses.iter().copied().map(Target::Port);
        let proxy = Proxy::start(targets.collect()).await?;
        let (calls, history) = (self.calls.clone(), Arc::clone(&self.history));
        let workload = Workload::new(calls, proxy.clone(), history, folder)?;
        let workload = Arc::new(workload);
        let avatar = workload.avatar().await.context("the first person")?;
        let mut breaker = Breaker {
            fleet: Arc::clone(&self.fleet),
            victims: [
                workload.avatar().await.context("the second person")?,
                workload.avatar().await.context("the third person")?,
            ],
            calls: self.calls.clone(),
            each: (addresses.iter().map(|it| Calls::to(&[*it]))).collect::<Result<_>>()?,
            workload: Arc::clone(&workload),
            proxy,
            history: Arc::clone(&self.history),
            stranger: late::register_stranger(&self.calls).await?,
            chance: ChaCha8Rng::seed_from_u64(self.options.seed),
            keys: Keys::make(&self.calls).await?,
            silent: Vec::new(),
        };
        self.breaking(&mut breaker, &workload, &avatar, failures)
            .await?;
        ending::settle(&self.calls, SETTLE).await?;
        for it in self.calls.list_jobs(&[]).await? {
            if let Ok(job) = self.calls.job(&it.name).await {
                late::write_late(
                    &self.calls,
                    &self.history,
                    &self.fleet.records(),
                    &job,
                    &breaker.stranger,
                )
                .await?;
            }
        }
        let events = self.history.events();
        let place = self.fleet.outside().place()?;
        ending::collect(&self.calls, &place, &events, end).await?;
        ending::repeat(&self.calls, &workload, end).await
    }

    /// Runs workload, observer and faults concurrently, until the plan is complete.
    async fn breaking(
        &self,
        breaker: &mut Breaker,
        workload: &Workload,
        avatar: &Avatar,
        failures: &mut Vec<String>,
    ) -> Result<()> {
        let done = AtomicBool::new(false);
        let is_done = || done.load(Ordering::SeqCst);
        let asking = workload.run(avatar, self.options.seed, &is_done);
        let observing = observer::observe(&self.calls, &self.history, &is_done);
        let breaking = async {
            self.faults(breaker, failures).await;
            done.store(true, Ordering::SeqCst);
            Ok(())
        };
        let (asked, observed, broken) = futures::join!(
            asking.map(|it| it.context("the load")),
            observing.map(|it| it.context("the observer")),
            breaking
        );
        asked.and(observed).and(broken)
    }

    async fn faults(&self, breaker: &mut Breaker, failures: &mut Vec<String>) {
        let began = Instant::now();
        let time = Duration::from_secs_f64(self.options.minutes.max(0.0) * 60.0);
        let mut plan = Plan::new(self.options.seed, self.options.kinds());
        let mut pauses = ChaCha8Rng::seed_from_u64(!self.options.seed);
        loop {
            let over = self.options.short || began.elapsed() >= time;
            if over && plan.is_complete() {
                return;
            }
            let Some(fault) = plan.next() else { return };
            let only = &self.options.only;
            if !only.is_empty() && !only.iter().any(|name| name == fault.name()) {
                continue;
            }
            let at = Instant::now();
            let made = breaker.make(fault).await;
            let seconds = at.elapsed().as_secs_f64();
            eprintln!(
                "{:>7.1} s  {:<20} {seconds:>5.1} s",
                began.elapsed().as_secs_f64(),
                fault.name()
            );
            if let Err(error) = made {
                eprintln!("          {error:#}");
                failures.push(format!("{}: {error:#}", fault.name()));
            }
            let pause = pauses.random_range(100..600);
            tokio::time::sleep(Duration::from_millis(pause)).await;
        }
    }
}
