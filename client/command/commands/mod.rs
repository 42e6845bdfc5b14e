//! The `yoto` command line: one file per command.
//!
//! Results go to stdout, progress and logs to stderr; the exit status is non-zero after a
//! failure.

#[cfg(feature = "embedded")]
mod avatar;
mod between_two;
mod capture;
mod capture_example;
mod capture_part;
mod completions;
mod correction;
#[cfg(feature = "embedded")]
mod demo;
mod evaluate;
mod export;
mod exposure;
mod ffmpeg_arg;
mod import;
#[cfg(feature = "embedded")]
mod ingest_args;
mod job;
mod job_attempts;
mod job_fetch;
mod job_list;
mod kind_name;
mod logs;
#[cfg(feature = "embedded")]
mod lpips_args;
mod matting_args;
mod media_args;
mod model;
mod model_export;
mod motion;
mod out_folder;
mod person_args;
mod refine_poses;
mod render;
mod render_choice;
mod render_film;
mod render_what;
mod scene;
#[cfg(feature = "embedded")]
mod serve;
mod status;
mod subject;
mod subject_poses;
mod table;
mod titles;
#[cfg(feature = "embedded")]
mod tradeoff;
mod train;
mod train_preview;
mod turn_args;
mod waiting;
mod whole_file;
#[cfg(feature = "embedded")]
mod worker;

use anyhow::Context;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::process::ExitCode;
use yoto_client::{ClientError, DEFAULT_SERVER, YotoClient};
use yoto_terminal::output;

const AFTER_HELP: &str = "\
First steps:
  yoto demo                                   see all of yoto in a few minutes
  yoto avatar walk.mp4 --pose-model models    make one person's avatar from a video
  yoto serve                                  run the service on this machine
  yoto subject add ada captures/ada           upload a person
  yoto train duo --subjects ada,bob           train one model of two people
  yoto render duo --subject ada --orbit 0 --animate --out out/ada

Logs: RUST_LOG=debug, or e.g. RUST_LOG=yoto_server=debug,info.";

/// One-camera videos of people in, animatable 3D avatars out: many people in one model.
#[derive(Debug, Parser)]
#[command(name = "yoto", version, after_help = AFTER_HELP, arg_required_else_help = true)]
pub struct Cli {
    /// Format of results on stdout: text for people, or one JSON object for programs.
    #[arg(
        long,
        global = true,
        value_enum,
        value_name = "FORMAT",
        default_value = "text"
    )]
    output: Format,
    /// Print results and errors only.
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Show no progress.
    #[arg(long, global = true)]
    no_progress: bool,
    /// The earlier place of an option of `serve` and `worker`.
    #[arg(long, hide = true)]
    log_json: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Text,
    Json,
}

/// Logs of a service.
#[cfg(feature = "embedded")]
#[derive(Debug, Clone, Copy, Args)]
struct LogArgs {
    /// Write logs as JSON, one object per line.
    #[arg(long)]
    log_json: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    #[cfg(feature = "embedded")]
    Serve(serve::Serve),
    #[cfg(feature = "embedded")]
    Worker(worker::WorkerCommand),
    #[cfg(feature = "embedded")]
    Demo(demo::Demo),
    #[cfg(feature = "embedded")]
    Avatar(Box<avatar::Avatar>),
    Import(import::Import),
    Capture(capture::CaptureCommand),
    Subject(subject::SubjectCommand),
    Model(model::ModelCommand),
    Train(train::Train),
    Job(job::JobCommand),
    Status(status::Status),
    Gc(status::gc::Gc),
    Render(Box<render::Render>),
    Motion(motion::MotionCommand),
    Scene(scene::SceneCommand),
    Export(Box<export::Export>),
    Evaluate(evaluate::Evaluate),
    #[cfg(feature = "embedded")]
    Tradeoff(tradeoff::TradeoffCommand),
    Completions(completions::Completions),
}

/// The service of a client command.
#[derive(Debug, Args)]
struct Server {
    /// Address of the service.
    #[arg(long, env = "YOTO_SERVER", default_value = DEFAULT_SERVER, value_name = "URL")]
    server: String,
}

impl Server {
    async fn connect(&self) -> Result<YotoClient, ClientError> {
        YotoClient::connect(&self.server).await
    }
}

/// Parses the command line, runs the command, prints errors.
pub fn main() -> ExitCode {
    // A worker starts this program again to read an upload.
    #[cfg(feature = "embedded")]
    yoto_ingest::become_ingest_child_if_asked();
    let cli = Cli::parse();
    output::set_style(output::Style {
        json: cli.output == Format::Json,
        quiet: cli.quiet,
        no_progress: cli.no_progress || cli.quiet,
    });
    let outcome = run(cli);
    if let Err(error) = &outcome {
        if let Some(ClientError::JobEnded(job)) = error.downcast_ref() {
            output::put("job", output::message(&**job));
        }
        output::error(format_args!("{error:#}"));
    }
    output::finish();
    outcome.map_or(ExitCode::FAILURE, |()| ExitCode::SUCCESS)
}

fn run(cli: Cli) -> anyhow::Result<()> {
    let log_json = cli.log_json || logs_are_json(&cli.command);
    logs::init(default_level(&cli.command), log_json);
    let runtime = tokio::runtime::Runtime::new().context("starting the asynchronous runtime")?;
    let outcome = match cli.command {
        #[cfg(feature = "embedded")]
        Command::Serve(command) => runtime.block_on(command.run()),
        #[cfg(feature = "embedded")]
        Command::Worker(command) => runtime.block_on(command.run()),
        #[cfg(feature = "embedded")]
        Command::Demo(command) => runtime.block_on(command.run()),
        #[cfg(feature = "embedded")]
        Command::Avatar(command) => runtime.block_on(command.run()),
        Command::Import(command) => command.run(),
        Command::Capture(command) => command.run(),
        Command::Subject(command) => runtime.block_on(command.run()),
        Command::Model(command) => runtime.block_on(command.run()),
        Command::Train(command) => runtime.block_on(command.run()),
        Command::Job(command) => runtime.block_on(command.run()),
        Command::Status(command) => runtime.block_on(command.run()),
        Command::Gc(command) => runtime.block_on(command.run()),
        Command::Motion(command) => command.run(),
        Command::Scene(command) => command.run(),
        Command::Render(command) => runtime.block_on(command.run()),
        Command::Export(command) => runtime.block_on(command.run()),
        Command::Evaluate(command) => runtime.block_on(command.run()),
        #[cfg(feature = "embedded")]
        Command::Tradeoff(command) => runtime.block_on(command.run()),
        Command::Completions(command) => command.run(),
    };
    // A computation that outlives its job must not prevent the process from ending.
    runtime.shutdown_background();
    outcome
}

fn logs_are_json(command: &Command) -> bool {
    match command {
        #[cfg(feature = "embedded")]
        Command::Serve(serve) => serve.logs.log_json,
        #[cfg(feature = "embedded")]
        Command::Worker(worker) => worker.logs.log_json,
        _ => false,
    }
}

/// Services log their actions; other commands log only warnings.
fn default_level(command: &Command) -> &'static str {
    match command {
        #[cfg(feature = "embedded")]
        Command::Serve(_) | Command::Worker(_) => "info",
        _ => "warn",
    }
}

#[cfg(test)]
mod tests;
