//! `yoto job watch`: one job with its progress, or all open jobs with a line for each change of state.

use crate::args::Server;
use crate::show;
use crate::show::{ID, Titles, job_detail, kind};
use crate::waiting::wait;
use clap::Args;
use std::collections::HashMap;
use yoto_client::{JobsChange, JobsFilter, YotoClient};
use yoto_proto::v1::{Job, job};
use yoto_terminal::output::{self, others};
use yoto_terminal::progress::ProgressDisplay;

pub(crate) const AFTER_HELP: &str = "\
Interrupting the watch does not stop the job. The exit status is non-zero unless the job
succeeds. Without a job, all open jobs are followed until none is left, including those that are queued
meanwhile, with a line for each change of state; the exit status then does not depend on them.

Examples:
  yoto job watch 9f31c2aa
  yoto job watch";

#[derive(Debug, Args)]
pub(crate) struct JobWatch {
    /// The job, by its id or at least the first four characters of it [default: all open jobs].
    job: Option<String>,
    #[command(flatten)]
    server: Server,
}

impl JobWatch {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        match &self.job {
            Some(job) => one(&client, job).await,
            None => all(&client).await,
        }
    }
}

async fn one(client: &YotoClient, job: &str) -> anyhow::Result<()> {
    let job = client.find_job(job).await?;
    let mut display = ProgressDisplay::new(job.name.clone());
    let job = wait(client, &job.name, &mut display).await?;
    output::put("job", output::message(&job));
    display.finish(&show::job_outcome(&job));
    Ok(())
}

async fn all(client: &YotoClient) -> anyhow::Result<()> {
    let mut watch = client.watch_jobs(JobsFilter::default());
    let mut titles = Titles::load(client).await?;
    let mut states: HashMap<String, job::State> = HashMap::new();
    let mut ended: Vec<Job> = Vec::new();
    let mut any = false;
    loop {
        match watch.next_change().await? {
            JobsChange::Changed { jobs, deleted } => {
                any |= !jobs.is_empty();
                for job in jobs {
                    let state = job.state();
                    if states.insert(job.name.clone(), state) == Some(state) {
                        continue;
                    }
                    if !titles.knows(&job) {
                        titles = Titles::load(client).await?;
                    }
                    say!("{}", changed(&job, &titles));
                    if !matches!(state, job::State::Queued | job::State::Running) {
                        states.remove(&job.name);
                        ended.push(job);
                    }
                }
                for name in deleted {
                    say!("{name} was deleted");
                    states.remove(&name);
                }
            }
            JobsChange::Disconnected => tell!("the service can't be reached; trying again"),
        }
        if watch.open() == 0 {
            if !any {
                tell!("no job is queued or running");
            }
            output::put("jobs", output::messages(&ended));
            return Ok(());
        }
    }
}

/// `9f31c2aa train of duo: running, step 40 of 100`.
fn changed(job: &Job, titles: &Titles) -> String {
    let id = job.name.split('/').next_back().unwrap_or_default();
    let id: String = id.chars().take(ID).collect();
    let state = job.state().as_str_name().to_lowercase();
    let of = others(&titles.of(job));
    let detail = match job_detail(job) {
        empty if empty.is_empty() => String::new(),
        detail => format!(", {detail}"),
    };
    format!("{id} {} of {of}: {state}{detail}", kind(job))
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::{JobError, JobKind};

    #[test]
    fn a_change_is_one_line_even_without_the_order() {
        let job = Job {
            name: "jobs/9f31c2aa-0000-4000-8000-000000000000".into(),
            state: job::State::Failed.into(),
            kind: JobKind::Train.into(),
            model: "models/duo".into(),
            error: Some(JobError {
                message: "a\nloss".into(),
                ..JobError::default()
            }),
            ..Job::default()
        };
        let line = changed(&job, &Titles::default());
        assert_eq!(line, "9f31c2aa train of models/duo: failed, a loss");
    }
}
