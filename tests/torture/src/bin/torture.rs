//! Breaks the service by a plan, and checks that it keeps its promises:
//! `cargo run -p yoto-torture --bin torture -- --minutes 10 --seed 1`. docs/operate/jobs.md explains the table.

use clap::{Parser, Subcommand};
use std::process::ExitCode;
use yoto_torture::{Options, Part, run};

/// Breaks real processes of the service, and checks what clients were promised.
#[derive(Debug, Parser)]
#[command(args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(subcommand)]
    process: Option<Process>,
    #[command(flatten)]
    options: Options,
}

#[derive(Debug, Subcommand)]
enum Process {
    /// One of the processes that are broken.
    #[command(hide = true, subcommand)]
    Part(Part),
}

fn main() -> anyhow::Result<ExitCode> {
    yoto_ingest::become_ingest_child_if_asked(None);
    let cli = Cli::parse();
    let runtime = tokio::runtime::Runtime::new()?;
    let outcome = match cli.process {
        Some(Process::Part(part)) => runtime.block_on(part.run()).map(|()| true),
        None => runtime.block_on(run(cli.options)).map(|report| {
            println!("{report}");
            report.passed()
        }),
    };
    // A computation that outlives its job must not keep the process.
    runtime.shutdown_background();
    Ok(match outcome? {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    })
}
