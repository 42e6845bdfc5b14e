//! `yoto job`: list, show, watch, draw, fetch, cancel, retry and delete jobs, pause and resume kinds of them.

mod curve;
mod fetch;
mod list;
mod watch;

use crate::args::{KindName, Server};
use crate::files::OutFolder;
use crate::show;
use crate::show::{Titles, kind, kind_word, span};
use clap::{Args, Subcommand};
use list::JobList;
use prost_types::Timestamp;
use std::time::SystemTime;
use watch::JobWatch;
use yoto_client::{ClientError, YotoClient};
use yoto_proto::pose_track;
use yoto_proto::v1::{Job, job};
use yoto_terminal::output::{self, others};

const SHOW_HELP: &str = "\
Each attempt is a line: its worker, how long it ran, and how it ended. --output json prints the whole job:
its order, progress, attempts, faults and result.

Example:
  yoto job show 9f31c2aa";
const FETCH_HELP: &str = "\
The files of a render are its pictures; of an export, its page, splats or mesh; of an evaluation, scores.json and
the plots of a trade-off; of a training, its last checkpoint (`yoto model export` writes the best one).

Example:
  yoto job fetch 9f31c2aa --out out/ada";
const CANCEL_HELP: &str = "\
A queued job ends at once, a running job after its worker's next heartbeat.

Example:
  yoto job cancel 9f31c2aa";

const RETRY_HELP: &str = "\
The same order becomes a new job, with the same priority and owner. A training continues from the newest
checkpoint of its model, with its whole budget; an ingest job reads the files of its capture again.

Example:
  yoto job retry 9f31c2aa";

const PAUSE_HELP: &str = "\
Queued jobs of the kind wait; running jobs continue.

Example:
  yoto job pause train --reason \"a new GPU is built in\"";

const RESUME_HELP: &str = "\
Example:
  yoto job resume train";

const DELETE_HELP: &str = "\
Its pictures, figures and exported files are deleted with it. The checkpoints of a training stay with their model, and the capture
of an ingest job with its person.

Example:
  yoto job delete 9f31c2aa";

/// List, show, watch, draw, fetch, cancel, retry and delete jobs; pause and resume kinds of them.
#[derive(Debug, Args)]
pub(crate) struct JobCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// List jobs with their state, newest first.
    #[command(after_help = list::AFTER_HELP)]
    List(JobList),
    /// Show one job with its faults.
    #[command(after_help = SHOW_HELP)]
    Show(JobArgs),
    /// Follow a job to its end, or all open jobs.
    #[command(after_help = watch::AFTER_HELP)]
    Watch(JobWatch),
    /// Draw loss and held-out quality of a training over its steps.
    #[command(after_help = curve::AFTER_HELP)]
    Curve(JobArgs),
    /// Wait for a job and write its files: pictures, an exported person, figures, or the checkpoint of a training.
    #[command(after_help = FETCH_HELP)]
    Fetch {
        #[command(flatten)]
        which: JobArgs,
        #[command(flatten)]
        folder: OutFolder,
    },
    /// Cancel a job.
    #[command(after_help = CANCEL_HELP)]
    Cancel(JobArgs),
    /// Queue again a job that failed or was cancelled.
    #[command(after_help = RETRY_HELP)]
    Retry(JobArgs),
    /// Delete a job that has ended, with its pictures, figures and exported files.
    #[command(after_help = DELETE_HELP)]
    Delete(JobArgs),
    /// Start no more jobs of a kind.
    #[command(after_help = PAUSE_HELP)]
    Pause {
        /// The kind of jobs.
        kind: KindName,
        /// Reason; `yoto status` shows it.
        #[arg(
            long,
            default_value = "",
            hide_default_value = true,
            value_name = "TEXT"
        )]
        reason: String,
        #[command(flatten)]
        server: Server,
    },
    /// Start jobs of a kind again.
    #[command(after_help = RESUME_HELP)]
    Resume {
        /// The kind of jobs.
        kind: KindName,
        #[command(flatten)]
        server: Server,
    },
}

#[derive(Debug, Args)]
struct JobArgs {
    /// The job, by its id or at least the first four characters of it.
    job: String,
    #[command(flatten)]
    server: Server,
}

impl JobArgs {
    /// A connection to the service, and the job as it is now.
    async fn find(&self) -> Result<(YotoClient, Job), ClientError> {
        let client = self.server.connect().await?;
        let job = client.find_job(&self.job).await?;
        Ok((client, job))
    }
}

impl JobCommand {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        match self.action {
            Action::List(list) => list.run().await,
            Action::Show(which) => show(&which).await,
            Action::Watch(watch) => watch.run().await,
            Action::Curve(which) => curve::show(&which).await,
            Action::Fetch { which, folder } => {
                let (client, job) = which.find().await?;
                let paths = fetch::fetch(&client, &job.name, &folder).await?;
                folder.show(&paths);
                Ok(())
            }
            Action::Cancel(which) => {
                let (client, job) = which.find().await?;
                let job = client.cancel_job(&job.name).await?;
                let asked = if job.state() == job::State::Running {
                    " (waiting for its worker)"
                } else {
                    ""
                };
                say!("{} {}{asked}", job.name, job.state().as_str_name());
                output::put("job", output::message(&job));
                Ok(())
            }
            Action::Retry(which) => {
                let (client, job) = which.find().await?;
                let job = client.retry_job(&job.name).await?;
                say!("{} {}", job.name, job.state().as_str_name());
                output::put("job", output::message(&job));
                Ok(())
            }
            Action::Delete(which) => {
                let (client, job) = which.find().await?;
                let deleted = client.delete_job(&job.name, &job.etag).await?;
                show::say_deleted(&job.name, &deleted);
                Ok(())
            }
            Action::Pause {
                kind,
                reason,
                server,
            } => {
                server
                    .connect()
                    .await?
                    .pause_jobs(kind.into(), &reason)
                    .await?;
                say!(
                    "no more {} jobs are started; running jobs continue",
                    kind_word(kind.into())
                );
                Ok(())
            }
            Action::Resume { kind, server } => {
                server.connect().await?.resume_jobs(kind.into()).await?;
                say!("{} jobs are started again", kind_word(kind.into()));
                Ok(())
            }
        }
    }
}

async fn show(which: &JobArgs) -> anyhow::Result<()> {
    let (client, found) = which.find().await?;
    // Only this call tells the attempts.
    let job = client.get_job(&found.name).await?;
    output::put("job", output::message(&job));
    let titles = Titles::load(&client).await?;
    say!("job      {}", job.name);
    say!("kind     {} of {}", kind(&job), titles.of(&job));
    say!("state    {}", job.state().as_str_name());
    say!("time     {}", times(&job));
    match job.state() {
        job::State::Succeeded => say!("result   {}", show::job_outcome(&job)),
        job::State::Running => say!("now      {}", show::job_detail(&job)),
        job::State::Queued => say!("now      {}", show::job_detail(&job)),
        _ => {}
    }
    if !job.owner.is_empty() {
        say!("owner    {}", others(&job.owner));
    }
    if job.lost_workers > 0 {
        say!("lost     {} workers", job.lost_workers);
    }
    for attempt in &job.attempts {
        say!("attempt  {}", show::attempt_line(attempt));
    }
    if let Some(error) = &job.error {
        say!(
            "fault    {} [{}]",
            others(&error.message),
            others(&error.code)
        );
        for violation in &error.violations {
            say!("         {}", pose_track::describe(violation));
        }
    }
    Ok(())
}

/// `queued 2h ago, ran 42s`.
fn times(job: &Job) -> String {
    let now = Some(SystemTime::now().into());
    let since = |from: &Option<Timestamp>, to: &Option<Timestamp>| {
        let seconds = |at: &Option<Timestamp>| Some(at.as_ref()?.seconds as f64);
        seconds(from)
            .zip(seconds(to))
            .map(|(from, to)| span(to - from))
    };
    let ended = job.end_time.or(now);
    let age = since(&job.create_time, &now).map(|age| format!("queued {age} ago"));
    let ran = since(&job.start_time, &ended).map(|time| format!("ran {time}"));
    let parts: Vec<String> = age.into_iter().chain(ran).collect();
    parts.join(", ")
}
