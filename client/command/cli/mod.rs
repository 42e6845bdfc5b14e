//! The `yoto` command line: its commands, and what all of them share.
//!
//! Results go to stdout, progress and logs to stderr; the exit status is non-zero after a
//! failure.

mod completions;

#[cfg(feature = "embedded")]
use crate::{audit, avatar, demo};
use crate::{
    capture, export, job, key, model, motion, render, scene, service, share, subject, tenant,
    webhook,
};
use anyhow::Context;
#[cfg(feature = "embedded")]
use clap::{CommandFactory, FromArgMatches};
use clap::{Parser, Subcommand};
use std::process::ExitCode;
use yoto_client::ClientError;
use yoto_terminal::args::OutputArgs;
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
    #[command(flatten)]
    output: OutputArgs,
    /// The earlier position of an option of `serve` and `worker`.
    #[arg(long, hide = true)]
    log_json: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    #[cfg(feature = "embedded")]
    Serve(service::serve::Serve),
    Worker(service::worker::WorkerCommand),
    #[cfg(feature = "embedded")]
    Demo(demo::command::Demo),
    #[cfg(feature = "embedded")]
    Avatar(Box<avatar::command::Avatar>),
    Import(capture::import::Import),
    Capture(capture::CaptureCommand),
    Subject(subject::SubjectCommand),
    Model(model::ModelCommand),
    Train(model::train::Train),
    Job(job::JobCommand),
    Status(service::status::Status),
    Key(key::KeyCommand),
    Usage(tenant::ShowUsage),
    Quota(tenant::SetQuota),
    #[cfg(feature = "embedded")]
    Audit(audit::AuditCommand),
    Gc(service::gc::Gc),
    Drain(service::drain::Drain),
    #[cfg(feature = "embedded")]
    Backup(service::backup::Backup),
    #[cfg(feature = "embedded")]
    Restore(service::backup::Restore),
    #[cfg(feature = "embedded")]
    Erased(service::erased::Erased),
    #[cfg(feature = "embedded")]
    Adopt(service::adopt::Adopt),
    #[cfg(feature = "embedded")]
    Fsck(service::fsck::Fsck),
    Render(Box<render::Render>),
    Motion(motion::MotionCommand),
    Scene(scene::SceneCommand),
    Export(Box<export::Export>),
    Share(share::ShareCommand),
    Webhook(webhook::WebhookCommand),
    Evaluate(model::evaluate::Evaluate),
    Report(model::report::WriteReport),
    #[cfg(feature = "embedded")]
    Tradeoff(model::tradeoff::TradeoffCommand),
    Completions(completions::Completions),
}

/// Parses the command line, runs the command, prints errors.
pub fn main() -> ExitCode {
    // A worker starts this program again to read an upload.
    #[cfg(feature = "embedded")]
    yoto_ingest::become_ingest_child_if_asked(Some(yoto_import::read_film));
    let cli = match parsed() {
        Ok(Some(cli)) => cli,
        Ok(None) => return ExitCode::SUCCESS,
        Err(error) => error.exit(),
    };
    cli.output.set_style(is_brief(&cli.command));
    let outcome = run(cli);
    if let Err(error) = &outcome {
        if let Some(ClientError::JobEnded(job)) = error.downcast_ref() {
            output::put("job", output::message(&**job));
        }
        output::error(format_args!("{error:#}"));
    }
    output::finish();
    outcome.unwrap_or(ExitCode::FAILURE)
}

/// The command line, with the settings of the file that it names; `None` if it asks only for these to be printed.
#[cfg(feature = "embedded")]
fn parsed() -> Result<Option<Cli>, clap::Error> {
    use crate::service::config;
    let parsed = config::parse(Cli::command(), std::env::args_os().collect())?;
    if let Some(text) = config::print(&parsed) {
        say!("{}", text.trim_end());
        return Ok(None);
    }
    Cli::from_arg_matches(&parsed.matches).map(Some)
}

#[cfg(not(feature = "embedded"))]
fn parsed() -> Result<Option<Cli>, clap::Error> {
    Cli::try_parse().map(Some)
}

fn run(cli: Cli) -> anyhow::Result<ExitCode> {
    // Before any command computes: a wrong YOTO_CPU is an error, and not a slower or faster form than asked for.
    #[cfg(feature = "embedded")]
    yoto_device::check_cpu_form()?;
    let log_json = cli.log_json || logs_are_json(&cli.command);
    service::logs::init(default_level(&cli.command), log_json);
    let runtime = tokio::runtime::Runtime::new().context("starting the asynchronous runtime")?;
    let mut code = ExitCode::SUCCESS;
    let outcome = match cli.command {
        #[cfg(feature = "embedded")]
        Command::Serve(command) => runtime.block_on(command.run()),
        Command::Worker(command) => runtime.block_on(command.run()).map(|ended| code = ended),
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
        Command::Key(command) => runtime.block_on(command.run()),
        Command::Share(command) => runtime.block_on(command.run()),
        Command::Webhook(command) => runtime.block_on(command.run()),
        Command::Usage(command) => runtime.block_on(command.run()),
        Command::Quota(command) => runtime.block_on(command.run()),
        #[cfg(feature = "embedded")]
        Command::Audit(command) => runtime.block_on(command.run()),
        Command::Gc(command) => runtime.block_on(command.run()),
        Command::Drain(command) => runtime.block_on(command.run()),
        #[cfg(feature = "embedded")]
        Command::Backup(command) => runtime.block_on(command.run()),
        #[cfg(feature = "embedded")]
        Command::Restore(command) => runtime.block_on(command.run()),
        #[cfg(feature = "embedded")]
        Command::Erased(command) => runtime.block_on(command.run()),
        #[cfg(feature = "embedded")]
        Command::Adopt(command) => runtime.block_on(command.run()),
        #[cfg(feature = "embedded")]
        Command::Fsck(command) => runtime.block_on(command.run()).map(|ended| code = ended),
        Command::Motion(command) => command.run(),
        Command::Scene(command) => command.run(),
        Command::Render(command) => runtime.block_on(command.run()),
        Command::Export(command) => runtime.block_on(command.run()),
        Command::Evaluate(command) => runtime.block_on(command.run()),
        Command::Report(command) => runtime.block_on(command.run()),
        #[cfg(feature = "embedded")]
        Command::Tradeoff(command) => runtime.block_on(command.run()),
        Command::Completions(command) => command.run(),
    };
    // A computation that outlives its job must not prevent the process from ending.
    runtime.shutdown_background();
    outcome.map(|()| code)
}

/// Whether the command keeps details to its log.
fn is_brief(command: &Command) -> bool {
    match command {
        #[cfg(feature = "embedded")]
        Command::Avatar(avatar) => !avatar.verbose,
        _ => false,
    }
}

fn logs_are_json(command: &Command) -> bool {
    match command {
        #[cfg(feature = "embedded")]
        Command::Serve(serve) => serve.logs.are_json(),
        #[cfg(feature = "embedded")]
        Command::Worker(command) => command.worker.logs.are_json(),
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
