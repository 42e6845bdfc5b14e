//! Figures of a coordinator under the load of a cluster, for docs/operate/jobs.md:
//! `cargo build -p yoto-tests --bins && cargo run -p yoto-torture --bin load`, with `-- --postgres` on a private PostgreSQL that
//! syncs every commit.

use clap::Parser;
use yoto_torture::load::{Load, Plan};

/// Measures a coordinator under the load of a cluster.
#[derive(Debug, Parser)]
struct Arguments {
    /// Keep the rows in PostgreSQL, whose programs this machine has.
    #[arg(long)]
    postgres: bool,
    /// Workers that ask for jobs.
    #[arg(long, default_value_t = Plan::default().workers)]
    workers: usize,
    /// Jobs in the queue.
    #[arg(long, default_value_t = Plan::default().queued)]
    queued: usize,
}

#[tokio::main]
async fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let plan = Plan {
        postgres: arguments.postgres,
        workers: arguments.workers,
        queued: arguments.queued,
        ..Plan::default()
    };
    Load::start(plan).await?.run().await
}
