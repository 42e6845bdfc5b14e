//! Figures of a coordinator under the load of a cluster, for docs/jobs.md:
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
}

#[tokio::main]
async fn main() -> anyhow::Result<()> {
    let plan = Plan {
        postgres: Arguments::parse().postgres,
        ..Plan::default()
    };
    Load::start(plan).await?.run().await
}
