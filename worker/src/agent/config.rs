//! Settings of a worker.

use std::path::PathBuf;
use std::time::Duration;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_ingest::IngestSettings;
use yoto_proto::key::Key;
use yoto_proto::v1::JobKind;

/// Kinds of jobs that this program runs.
pub const KINDS: &[JobKind] = &[
    JobKind::Ingest,
    JobKind::Train,
    JobKind::Render,
    JobKind::Evaluate,
    JobKind::Export,
];
/// Longest time from a worker's end to that of its process.
pub(super) const SLACK: Duration = Duration::from_secs(1);

/// Settings of a worker; the default suits embedded and separate workers.
#[derive(Debug, Clone)]
pub struct WorkerConfig {
    /// Display name of this worker.
    pub display_name: String,
    /// Kinds of jobs that it runs.
    pub kinds: Vec<JobKind>,
    /// Whether it runs in the coordinator's process: a coordinator that starts takes back the jobs that
    /// such a worker had.
    pub embedded: bool,
    /// First pause between two requests for work, seconds; it doubles while no job is queued.
    pub poll_seconds: f64,
    /// Longest pause between two requests for work, seconds.
    pub idle_poll_seconds: f64,
    /// Shortest pause between two heartbeats that carry new progress, seconds.
    pub progress_seconds: f64,
    /// Time limit for a training to save and stop when the worker shuts down, seconds.
    pub drain_seconds: f64,
    /// Time limit for the report of a job's end when the worker shuts down, seconds.
    pub report_seconds: f64,
    /// Whether the worker ends after one job, and, without [`max_idle_seconds`](Self::max_idle_seconds), at once if no
    /// job waits.
    pub one_job: bool,
    /// Time without a job after which the worker ends, seconds.
    pub max_idle_seconds: Option<f64>,
    /// Shortest silence of a job after which this worker ends, seconds. A slow job may be silent for
    /// 20 of its steps.
    pub silence_seconds: f64,
    /// Program and limits for reading uploads.
    pub ingest: IngestSettings,
    /// Weights of the networks of LPIPS, if present.
    pub lpips: Option<LpipsWeights>,
    /// Where the files of a running job are: an upload to read, a checkpoint to load or save. Created if
    /// missing.
    pub scratch: PathBuf,
    /// The worker's key, where the service asks for one.
    pub key: Option<Key>,
    /// Called after each job, e.g. to give memory back to the system.
    pub after_job: fn(),
}

impl Default for WorkerConfig {
    fn default() -> Self {
        Self {
            display_name: "worker".into(),
            kinds: KINDS.to_vec(),
            embedded: false,
            poll_seconds: 0.2,
            idle_poll_seconds: 2.0,
            progress_seconds: 0.5,
            drain_seconds: 10.0,
            report_seconds: 3.0,
            one_job: false,
            max_idle_seconds: None,
            silence_seconds: 60.0,
            ingest: IngestSettings::default(),
            lpips: None,
            scratch: std::env::temp_dir(),
            key: None,
            after_job: || {},
        }
    }
}

impl WorkerConfig {
    /// A worker that ends within `seconds` after it is asked to stop, as machines that are taken back give notice.
    #[must_use]
    pub fn with_notice(self, seconds: f64) -> Self {
        let report_seconds = Self::default().report_seconds.min(seconds / 4.0);
        // The rest is for the end of the process.
        let rest = SLACK.as_secs_f64().min(seconds / 4.0);
        Self {
            drain_seconds: seconds - report_seconds - rest,
            report_seconds,
            ..self
        }
    }
}
