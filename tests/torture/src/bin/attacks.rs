//! Memory and latencies of a coordinator whose client asks for much, for docs/operate/jobs.md:
//! `cargo build -p yoto-tests --bins && cargo run -p yoto-torture --bin attacks`.

#[tokio::main]
async fn main() -> anyhow::Result<()> {
    yoto_torture::load::attacks::run().await
}
