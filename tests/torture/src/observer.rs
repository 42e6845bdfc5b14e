//! Writes down each state in which a job is seen.

use super::calls::Calls;
use super::history::{Event, History};
use super::workload::is_ended;
use anyhow::Result;
use std::collections::HashMap;
use std::time::Duration;
use tonic::Code;
use yoto_proto::v1::Job;

/// Pause between two looks.
const PAUSE: Duration = Duration::from_millis(250);

/// Looks at all jobs until `done`.
///
/// # Errors
/// When the service gives no definite answer, or the history can't be written.
pub(crate) async fn observe(
    calls: &Calls,
    history: &History,
    done: &dyn Fn() -> bool,
) -> Result<()> {
    let mut last = HashMap::new();
    while !done() {
        look(calls, history, &mut last).await?;
        tokio::time::sleep(PAUSE).await;
    }
    Ok(())
}

async fn look(
    calls: &Calls,
    history: &History,
    last: &mut HashMap<String, (i32, u64)>,
) -> Result<()> {
    for listed in calls.list_jobs(&[]).await? {
        let before = last.get(&listed.name);
        if before.is_some_and(|(state, _)| *state == listed.state && is_ended(listed.state())) {
            continue;
        }
        let job = match calls.job(&listed.name).await {
            Ok(job) => job,
            Err(status) if status.code() == Code::NotFound => continue,
            Err(status) => return Err(status.into()),
        };
        let seen = (job.state, newest_attempt(&job));
        if last.insert(job.name.clone(), seen) != Some(seen) {
            history.record(Event::Seen {
                state: job.state().as_str_name().to_owned(),
                attempt: seen.1,
                job: job.name,
            })?;
        }
    }
    Ok(())
}

/// Number of the newest attempt of a job; 0 before the first.
pub(crate) fn newest_attempt(job: &Job) -> u64 {
    job.attempts.last().map_or(0, |attempt| attempt.number)
}
