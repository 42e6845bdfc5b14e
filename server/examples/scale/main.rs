//! A service of 10,000 people, 1,000 queued trainings and 200 workers, simulated: the coordinators, their database and every
//! rule of the queue are the real ones, and only time, workers and people's calls are made up. For docs/operate/jobs.md:
//! `cargo run -p yoto-server --example scale -- sqlite`, and `-- postgres` with two coordinators on a private PostgreSQL that
//! syncs every commit.
//!
//! Events follow each other on a clock that is set from one to the next. Each makes its call, and the time that the call really
//! takes is what the service would be busy with in that span of the simulated time.
//!
//! `-- hints` measures instead, on the real clock, after what time a worker and a watcher at one coordinator learn of what happens
//! at the other, with hints and by polling.

mod costs;
mod day;
mod latency;
mod stage;

use costs::Costs;
use day::Day;
use stage::Stage;
use std::sync::Arc;
use std::time::Instant;
use yoto_server::clock::ManualClock;

/// The simulated time of the begin, seconds since 1970.
const BEGIN: f64 = 1.7e9;

/// Sizes of the simulation.
struct Plan {
    people: usize,
    trainings: usize,
    workers: usize,
    /// Length of a training, seconds, give or take a fifth.
    seconds: f64,
    /// One in so many leases is lost with its worker.
    lost: u64,
    /// People who look at a job every 2 seconds, and at a page of the list every 30 seconds.
    watchers: usize,
}

const PLAN: Plan = Plan {
    people: 10_000,
    trainings: 1_000,
    workers: 200,
    seconds: 30.0,
    lost: 50,
    watchers: 100,
};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let database = arguments.next().unwrap_or_default();
    let number = |text: Option<String>, usual: usize| text.map_or(Ok(usual), |it| it.parse());
    let mut plan = PLAN;
    plan.people = number(arguments.next(), plan.people)?;
    plan.trainings = number(arguments.next(), plan.trainings)?;
    plan.workers = number(arguments.next(), plan.workers)?;
    let postgres = || {
        let database = yoto_test_postgres::Database::create_durable();
        database.ok_or("PostgreSQL is not installed")
    };
    let database = match database.as_str() {
        "sqlite" => None,
        "postgres" => Some(postgres()?),
        "hints" => return latency::run(postgres).await,
        _ => return Err("scale hints|sqlite|postgres [PEOPLE [TRAININGS [WORKERS]]]".into()),
    };
    let clock = Arc::new(ManualClock::at(BEGIN));
    let stage = Stage::simulated(database, &clock).await?;
    let began = Instant::now();
    let models = stage.fill(&plan).await?;
    println!(
        "{} people with captures, {} models and queued trainings were made in {:.0} s",
        plan.people,
        models.len(),
        began.elapsed().as_secs_f64()
    );
    let mut costs = Costs::default();
    let report = Day::new(&stage, &clock, &plan, &models)
        .run(&mut costs)
        .await?;
    println!("{report}");
    print!("{}", costs.table(report.span));
    Ok(())
}
