//! Figures of a coordinator under the load of a cluster, for docs/jobs.md:
//! `cargo build -p yoto-tests --bins && cargo run -p yoto-torture --bin load`.

use yoto_torture::load::{Load, Plan};

#[tokio::main]
async fn main() -> anyhow::Result<()> {
    Load::start(Plan::default()).await?.run().await
}
