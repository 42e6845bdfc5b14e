//! The `yoto-lab` command line: one file per command.
//!
//! Results go to stdout, progress and logs to stderr; the exit status is non-zero after a
//! failure.

mod ablation;
mod actors;
mod args;
mod bench;
mod body;
mod decoder;
mod detector;
mod distill;
mod evaluate;
mod frames;
mod import_humannerf;
mod import_progress;
mod info;
mod lift;
mod poses;
mod quality;
mod real;
mod render_frame;
mod screen;
mod stress;
mod tradeoff;

use clap::{Parser, Subcommand};
use std::io::IsTerminal;
use std::process::ExitCode;
use tracing_subscriber::EnvFilter;
use yoto_terminal::args::OutputArgs;
use yoto_terminal::output;

/// Experiments: models trained and measured in this process, without a service.
#[derive(Debug, Parser)]
#[command(name = "yoto-lab", version, arg_required_else_help = true)]
pub struct Cli {
    #[command(flatten)]
    output: OutputArgs,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Quality(Box<quality::Quality>),
    Real(Box<real::Real>),
    Ablation(ablation::AblationCommand),
    Decoder(decoder::DecoderCommand),
    Body(body::BodyCommand),
    Stress(stress::StressCommand),
    Poses(poses::PosesCommand),
    Detector(detector::DetectorCommand),
    Lift(lift::LiftCommand),
    Tradeoff(tradeoff::TradeoffCommand),
    Evaluate(evaluate::Evaluate),
    Distill(distill::Distill),
    Bench(bench::Bench),
    Frames(frames::Frames),
    RenderFrame(render_frame::RenderFrame),
    Info(info::Info),
    #[command(name = "import-humannerf")]
    ImportHumanNerf(import_humannerf::ImportHumanNerf),
}

/// Parses the command line, runs the command, prints errors.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    cli.output.set_style(false);
    log_to_stderr();
    let outcome = cli.command.run();
    if let Err(error) = &outcome {
        output::error(format_args!("{error:#}"));
    }
    output::finish();
    outcome.map_or(ExitCode::FAILURE, |()| ExitCode::SUCCESS)
}

impl Command {
    fn run(self) -> anyhow::Result<()> {
        // Before any command computes: a wrong YOTO_CPU is an error, and not a slower or faster form than asked for.
        yoto_device::check_cpu_form()?;
        match self {
            Self::Quality(command) => command.run(),
            Self::Real(command) => command.run(),
            Self::Ablation(command) => command.run(),
            Self::Decoder(command) => command.run(),
            Self::Body(command) => command.run(),
            Self::Stress(command) => command.run(),
            Self::Poses(command) => command.run(),
            Self::Detector(command) => command.run(),
            Self::Lift(command) => command.run(),
            Self::Tradeoff(command) => command.run(),
            Self::Evaluate(command) => command.run(),
            Self::Distill(command) => command.run(),
            Self::Bench(command) => command.run(),
            Self::Frames(command) => command.run(),
            Self::RenderFrame(command) => command.run(),
            Self::Info(command) => command.run(),
            Self::ImportHumanNerf(command) => command.run(),
        }
    }
}

/// Logs warnings, or what `RUST_LOG` asks for.
fn log_to_stderr() {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        // A log that can't be written must not end the program: the report of it would panic.
        .log_internal_errors(false)
        .with_ansi(std::io::stderr().is_terminal())
        .init();
}

#[cfg(test)]
mod tests;
