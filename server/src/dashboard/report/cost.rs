//! What a model has cost: time of workers by kinds of jobs, and bytes.

use super::super::words::{bytes, count, kind_word, seconds};
use maud::{Markup, html};
use yoto_proto::progress::duration;
use yoto_proto::v1::{Checkpoint, Job, JobKind};

/// The kinds in the order of a person's way through the service.
const KINDS: [JobKind; 5] = [
    JobKind::Ingest,
    JobKind::Train,
    JobKind::Evaluate,
    JobKind::Render,
    JobKind::Export,
];

/// Seconds of workers that the jobs of one kind have had, with attempts that failed.
fn worker_seconds(jobs: &[&Job], now: f64) -> f64 {
    let attempts = jobs.iter().flat_map(|job| &job.attempts);
    let seconds = attempts.filter_map(|it| {
        let begin = it.begin_time.as_ref().map(seconds)?;
        let end = it.end_time.as_ref().map_or(now, seconds);
        Some((end - begin).max(0.0))
    });
    seconds.sum()
}

/// A table of the `jobs` of a model, and the bytes of its `checkpoints`.
pub(super) fn section(jobs: &[Job], checkpoints: &[Checkpoint], now: f64) -> Markup {
    let total: u64 = checkpoints.iter().map(|it| it.bytes).sum();
    let rows = KINDS.map(|kind| {
        let of: Vec<&Job> = jobs.iter().filter(|it| it.kind() == kind).collect();
        (kind, of.len(), worker_seconds(&of, now))
    });
    html! {
        div .scroll { table {
            thead { tr { th { "Kind" } th { "Jobs" } th { "Time of workers" } } }
            tbody { @for (kind, number, seconds) in rows.into_iter().filter(|it| it.1 > 0) {
                tr { th scope="row" { (kind_word(kind)) } td { (number) } td { (duration(seconds)) } }
            } }
        } }
        p .detail { (count(checkpoints.len() as u64, "checkpoint")) " of " (bytes(total)) " together. Deleted jobs are not counted." }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost_types::Timestamp;
    use yoto_proto::v1::JobAttempt;

    #[test]
    fn all_attempts_of_a_kind_count_together() {
        let time = |seconds| Some(Timestamp { seconds, nanos: 0 });
        let attempt = |begin, end: Option<i64>| JobAttempt {
            begin_time: time(begin),
            end_time: end.and_then(time),
            ..JobAttempt::default()
        };
        let job = |kind: JobKind, attempts| Job {
            kind: kind.into(),
            attempts,
            ..Job::default()
        };
        let jobs = [
            job(
                JobKind::Train,
                vec![attempt(0, Some(10)), attempt(20, Some(80))],
            ),
            job(JobKind::Train, vec![attempt(100, None)]),
            job(JobKind::Render, vec![]),
        ];
        let shown = section(&jobs, &[], 105.0).into_string();
        assert!(
            shown.contains("training</th><td>2</td><td>1:15</td>"),
            "{shown}"
        );
        assert!(
            shown.contains("render</th><td>1</td><td>0:00</td>"),
            "{shown}"
        );
        assert!(!shown.contains("export"), "{shown}");
    }
}
