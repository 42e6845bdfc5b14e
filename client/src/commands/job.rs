//! `yoto job`: list, watch, fetch and cancel jobs.

use super::out_folder::OutFolder;
use super::waiting::wait;
use super::{Server, evaluate, job_fetch, table, train};
use crate::progress::{ProgressDisplay, describe};
use clap::{Args, Subcommand};
use yoto_proto::v1::{Job, job, job_result, job_spec};

const LIST_HELP: &str = "\
Example:
  yoto job list";
const WATCH_HELP: &str = "\
Interrupting the watch does not stop the job. The exit status is non-zero unless the job
succeeds.

Example:
  yoto job watch jobs/0198c1f2";
const FETCH_HELP: &str = "\
A render has its pictures, an evaluation scores.json and the plots of a trade-off, a training its last
checkpoint (`yoto model export` writes the best one).

Example:
  yoto job fetch jobs/0198c1f2 --out out/ada";
const CANCEL_HELP: &str = "\
A queued job ends at once, a running job after its worker's next heartbeat.

Example:
  yoto job cancel jobs/0198c1f2";

/// List, watch, fetch and cancel jobs.
#[derive(Debug, Args)]
pub(super) struct JobCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// List jobs with their state.
    #[command(after_help = LIST_HELP)]
    List {
        #[command(flatten)]
        server: Server,
    },
    /// Follow a job to its end.
    #[command(after_help = WATCH_HELP)]
    Watch(Which),
    /// Wait for a job and write its files: pictures, figures, or the checkpoint of a training.
    #[command(after_help = FETCH_HELP)]
    Fetch {
        #[command(flatten)]
        which: Which,
        #[command(flatten)]
        folder: OutFolder,
    },
    /// Cancel a job.
    #[command(after_help = CANCEL_HELP)]
    Cancel(Which),
}

#[derive(Debug, Args)]
struct Which {
    /// The job, as `jobs/ID` or ID.
    job: String,
    #[command(flatten)]
    server: Server,
}

impl Which {
    fn name(&self) -> String {
        if self.job.contains('/') {
            self.job.clone()
        } else {
            format!("jobs/{}", self.job)
        }
    }
}

impl JobCommand {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        match self.action {
            Action::List { server } => list(&server).await,
            Action::Watch(which) => watch(&which).await,
            Action::Fetch { which, folder } => {
                let client = which.server.connect().await?;
                for path in job_fetch::fetch(&client, &which.name(), &folder).await? {
                    println!("{}", path.display());
                }
                Ok(())
            }
            Action::Cancel(which) => {
                let job = which
                    .server
                    .connect()
                    .await?
                    .cancel_job(&which.name())
                    .await?;
                let asked = if job.state() == job::State::Running {
                    " (waiting for its worker)"
                } else {
                    ""
                };
                println!("{} {}{asked}", job.name, job.state().as_str_name());
                Ok(())
            }
        }
    }
}

async fn watch(which: &Which) -> anyhow::Result<()> {
    let client = which.server.connect().await?;
    let name = which.name();
    let mut display = ProgressDisplay::new(name.clone());
    let job = wait(&client, &name, &mut display).await?;
    display.finish(&outcome(&job));
    Ok(())
}

/// Result of a successful job, in one line.
fn outcome(job: &Job) -> String {
    match job.result.as_ref().and_then(|result| result.kind.as_ref()) {
        Some(job_result::Kind::Ingest(it)) => {
            format!("{} frames of {}x{}", it.frames, it.width, it.height)
        }
        Some(job_result::Kind::Train(it)) => train::summary(it),
        Some(job_result::Kind::Render(it)) => {
            format!(
                "{} files, {:.2} s per frame on {}",
                it.files.len(),
                it.seconds_per_frame,
                it.device
            )
        }
        Some(job_result::Kind::Evaluate(it)) => evaluate::summary(it),
        None => job.state().as_str_name().to_owned(),
    }
}

async fn list(server: &Server) -> anyhow::Result<()> {
    let jobs = server.connect().await?.list_jobs().await?;
    let rows: Vec<Vec<String>> = jobs
        .iter()
        .map(|job| {
            let (kind, of) = about(job);
            vec![
                job.name.clone(),
                kind.to_owned(),
                of,
                job.state().as_str_name().to_owned(),
                detail(job),
            ]
        })
        .collect();
    println!(
        "{}",
        table::table(&["NAME", "KIND", "OF", "STATE", "DETAIL"], &rows)
    );
    Ok(())
}

/// Kind and object of a job.
fn about(job: &Job) -> (&'static str, String) {
    match job.spec.as_ref().and_then(|spec| spec.kind.as_ref()) {
        Some(job_spec::Kind::Ingest(spec)) => ("ingest", spec.capture.clone()),
        Some(job_spec::Kind::Train(spec)) => ("train", spec.model.clone()),
        Some(job_spec::Kind::Render(spec)) => {
            ("render", format!("{} by {}", spec.subject, spec.model))
        }
        Some(job_spec::Kind::Evaluate(spec)) => ("evaluate", spec.model.clone()),
        None => ("unknown", String::new()),
    }
}

/// Details of a job in its state.
fn detail(job: &Job) -> String {
    match job.state() {
        job::State::Running => job.progress.as_ref().map(describe).unwrap_or_default(),
        job::State::Queued => format!("{} ahead", job.queue_position),
        job::State::Succeeded => outcome(job),
        job::State::Failed => job
            .error
            .as_ref()
            .map(|error| format!("{} [{}]", error.message, error.code))
            .unwrap_or_default(),
        job::State::Cancelled | job::State::Unspecified => String::new(),
    }
}
