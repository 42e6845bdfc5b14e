//! What a model has cost: how long its jobs ran, by kind, and bytes.

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

/// Seconds for which the jobs of one kind ran.
fn ran(jobs: &[&Job], now: f64) -> f64 {
    let seconds = jobs.iter().filter_map(|it| {
        let begin = it.start_time.as_ref().map(seconds)?;
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
        (kind, of.len(), ran(&of, now))
    });
    html! {
        div .scroll tabindex="0" role="group" aria-label="Table" { table {
            thead { tr { th { "Kind" } th { "Jobs" } th { "Ran" } } }
            tbody { @for (kind, number, seconds) in rows.into_iter().filter(|it| it.1 > 0) {
                tr { th scope="row" { (kind_word(kind)) } td { (number) } td { (duration(seconds)) } }
            } }
        } }
        p .detail { (count(checkpoints.len() as u64, "checkpoint")) " of " (bytes(total)) " together. At most the newest " (super::JOBS) " jobs count, and no deleted ones." }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost_types::Timestamp;

    #[test]
    fn jobs_of_a_kind_count_together() {
        let time = |seconds| Timestamp { seconds, nanos: 0 };
        let job = |kind: JobKind, begin: Option<i64>, end: Option<i64>| Job {
            kind: kind.into(),
            start_time: begin.map(time),
            end_time: end.map(time),
            ..Job::default()
        };
        let jobs = [
            job(JobKind::Train, Some(10), Some(80)),
            job(JobKind::Train, Some(100), None),
            job(JobKind::Render, None, None),
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
