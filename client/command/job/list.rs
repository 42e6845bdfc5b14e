//! `yoto job list`: jobs as a table that fits a terminal.

use crate::args::Server;
use crate::show;
use crate::show::{ID, Titles, job_detail, kind, now, span};
use clap::{Args, ValueEnum};
use yoto_proto::v1::{Job, job};
use yoto_terminal::output;

pub(crate) const AFTER_HELP: &str = "\
AGE is the time since a job was queued, TIME how long it ran. All commands take the first characters of an id
in its place.

Examples:
  yoto job list
  yoto job list --state failed,running --limit 5";

/// Widest table, columns of a terminal.
const WIDEST: usize = 100;
/// Widest name of what a job is about.
const WIDEST_OF: usize = 24;

#[derive(Debug, Args)]
pub(crate) struct JobList {
    /// Only jobs in these states, separated by commas.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "STATE")]
    state: Vec<StateName>,
    /// Only the newest N jobs.
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..))]
    limit: u32,
    #[command(flatten)]
    server: Server,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum StateName {
    Queued,
    Running,
    Succeeded,
    Failed,
    Cancelled,
}

impl From<StateName> for job::State {
    fn from(name: StateName) -> Self {
        match name {
            StateName::Queued => Self::Queued,
            StateName::Running => Self::Running,
            StateName::Succeeded => Self::Succeeded,
            StateName::Failed => Self::Failed,
            StateName::Cancelled => Self::Cancelled,
        }
    }
}

impl JobList {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let states: Vec<job::State> = self.state.iter().map(|&name| name.into()).collect();
        // One more tells whether there are more.
        let limit = self.limit as usize;
        let mut jobs = client.list_jobs_in(&states, limit + 1).await?;
        let more = jobs.len() > limit;
        jobs.truncate(limit);
        output::put("jobs", output::messages(&jobs));
        let titles = Titles::load(&client).await?;
        say!("{}", listed(&jobs, &titles, now()));
        if more {
            tell!("older jobs are not shown (--limit N)");
        }
        Ok(())
    }
}

/// The table of `jobs` at `now`, seconds since 1970.
fn listed(jobs: &[Job], titles: &Titles, now: f64) -> String {
    let header = ["ID", "KIND", "OF", "STATE", "AGE", "TIME"];
    let row = |job: &Job| {
        let id = job.name.split('/').next_back().unwrap_or_default();
        let created = seconds(job.create_time.as_ref());
        let started = seconds(job.start_time.as_ref());
        let ended = seconds(job.end_time.as_ref()).unwrap_or(now);
        let since = |from: Option<f64>, to: f64| {
            from.map_or_else(|| "-".to_owned(), |from| span(to - from))
        };
        vec![
            id.chars().take(ID).collect(),
            kind(job).to_owned(),
            cut(&titles.of(job), WIDEST_OF),
            job.state().as_str_name().to_lowercase(),
            since(created, now),
            since(started, ended),
        ]
    };
    let rows: Vec<Vec<String>> = jobs.iter().map(row).collect();
    let plain = show::table(&header, &rows);
    let width = plain.lines().map(|line| line.chars().count()).max();
    let width = width.unwrap_or(0);
    let details = std::iter::once("DETAIL".to_owned()).chain(jobs.iter().map(job_detail));
    let room = WIDEST.saturating_sub(width + 2);
    let lines = plain.lines().zip(details);
    let lines: Vec<String> = lines
        .map(|(line, detail)| {
            let line = format!("{line:<width$}  {}", cut(&detail, room));
            line.trim_end().to_owned()
        })
        .collect();
    lines.join("\n")
}

fn seconds(time: Option<&prost_types::Timestamp>) -> Option<f64> {
    time.map(|it| it.seconds as f64 + f64::from(it.nanos) * 1e-9)
}

/// The first line of `text`, with at most `width` characters.
fn cut(text: &str, width: usize) -> String {
    let line = text.lines().next().unwrap_or_default();
    if line.chars().count() <= width {
        return line.to_owned();
    }
    let kept: String = line.chars().take(width.saturating_sub(1)).collect();
    format!("{}…", kept.trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::{EvaluateSpec, JobError, JobSpec, Violation, job_spec};

    #[test]
    fn a_job_takes_one_line_of_a_terminal() {
        let violation = |frame| Violation {
            code: "NOT_FINITE".into(),
            file: "poses.json".into(),
            frame: Some(frame),
            field: "pose[41]".into(),
            message: "NaN, which is not a number that anybody can turn a joint by".into(),
        };
        let time = |seconds| Some(prost_types::Timestamp { seconds, nanos: 0 });
        let job = Job {
            name: "jobs/9f31c2aa-0000-4000-8000-000000000000".into(),
            state: job::State::Failed.into(),
            spec: Some(JobSpec {
                kind: Some(job_spec::Kind::Evaluate(EvaluateSpec {
                    model: "models/of-a-name-that-is-longer-than-a-column".into(),
                    ..EvaluateSpec::default()
                })),
            }),
            error: Some(JobError {
                violations: (0..20).map(violation).collect(),
                ..JobError::default()
            }),
            create_time: time(1000),
            start_time: time(1010),
            end_time: time(1052),
            ..Job::default()
        };
        let text = job_detail(&job);
        assert!(text.ends_with(", and 19 more"), "{text}");
        let table = listed(&[job], &Titles::default(), 8300.0);
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(lines.len(), 2);
        assert!(
            lines.iter().all(|line| line.chars().count() <= WIDEST),
            "{table}"
        );
        let cells: Vec<&str> = lines[1].split_whitespace().take(6).collect();
        let expected = [
            "9f31c2aa",
            "evaluate",
            "models/of-a-name-that-i…",
            "failed",
            "2h",
            "42s",
        ];
        assert_eq!(cells, expected);
    }
}
