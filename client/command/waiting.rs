//! Waiting for a job, and what an interruption means: the job continues without its watcher.

use crate::show::{Titles, kind};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::{Interval, MissedTickBehavior, interval};
use yoto_client::{ClientError, JobChange, YotoClient};
use yoto_proto::v1::{Job, JobKind, job};
use yoto_terminal::output;
use yoto_terminal::progress::{ProgressDisplay, duration};

/// Exit status of a program that Ctrl-C ended, as shells report it.
const INTERRUPTED: i32 = 130;

/// Interval between looks at what a queued job waits for.
const LOOK_EVERY: Duration = Duration::from_secs(2);

/// Whether this program waits for a job: otherwise Ctrl-C ends it at once.
static WAITING: AtomicBool = AtomicBool::new(false);
/// Number of times that Ctrl-C was pressed during a wait.
static PRESSED: OnceLock<watch::Receiver<u32>> = OnceLock::new();

/// Prints the `name` of a job that was just started, and follows it to its end, as [`wait`].
///
/// # Errors
/// As [`YotoClient::wait_for_job`].
pub(crate) async fn wait_for_new(
    client: &YotoClient,
    name: &str,
    display: &mut ProgressDisplay,
) -> Result<Job, ClientError> {
    follow_new(client, name, display, |_| ()).await
}

/// As [`wait_for_new`]; `on_change` receives each change of the job.
///
/// # Errors
/// As [`YotoClient::wait_for_job`].
pub(crate) async fn follow_new(
    client: &YotoClient,
    name: &str,
    display: &mut ProgressDisplay,
    on_change: impl FnMut(&Job),
) -> Result<Job, ClientError> {
    // From the moment that the name is known, Ctrl-C has its meaning.
    interrupts();
    let _waiting = Waiting::begin();
    display.note(&format!("runs as {name}"));
    follow(client, name, display, on_change).await
}

/// Follows the job `name` to its end. The first Ctrl-C says how to come back to the job, the second
/// one ends this program.
///
/// # Errors
/// As [`YotoClient::wait_for_job`].
pub(crate) async fn wait(
    client: &YotoClient,
    name: &str,
    display: &mut ProgressDisplay,
) -> Result<Job, ClientError> {
    follow(client, name, display, |_| ()).await
}

async fn follow(
    client: &YotoClient,
    name: &str,
    display: &mut ProgressDisplay,
    mut on_change: impl FnMut(&Job),
) -> Result<Job, ClientError> {
    let mut pressed = interrupts();
    let _waiting = Waiting::begin();
    let mut watch = client.watch_job(name);
    let mut last: Option<Job> = None;
    let mut warned = false;
    let mut look = looks();
    loop {
        let is_queued = last
            .as_ref()
            .is_some_and(|it| it.state() == job::State::Queued);
        tokio::select! {
            change = watch.next_change() => match change? {
                Some(JobChange::Job(job)) => {
                    display.job(&job);
                    on_change(&job);
                    last = Some(*job);
                }
                Some(JobChange::Disconnected) => display.disconnected(),
                None => return YotoClient::succeeded(name, last),
            },
            _ = look.tick(), if is_queued => {
                // The display alone needs the other jobs: a failure appears at the watch.
                if let (Some(job), Ok(Some(others))) = (&last, running(client).await) {
                    display.waits_for(job, &others);
                }
            }
            // Without a listener there is nothing to wait for.
            Ok(()) = pressed.changed() => {
                let count = *pressed.borrow_and_update();
                if count > 1 || warned {
                    if let Some(job) = &last {
                        output::put("job", output::message(job));
                    }
                    output::finish();
                    std::process::exit(INTERRUPTED);
                }
                warned = true;
                display.note(&left(name, last.as_ref()));
            }
        }
    }
}

fn looks() -> Interval {
    let mut look = interval(LOOK_EVERY);
    look.set_missed_tick_behavior(MissedTickBehavior::Delay);
    look
}

/// What the workers do, in words: `evaluate of trio, 0:42 left`; `None` if they do nothing.
async fn running(client: &YotoClient) -> Result<Option<String>, ClientError> {
    let jobs = client
        .list_jobs_in(&[job::State::Running], usize::MAX)
        .await?;
    let titles = Titles::load(client).await?;
    let one = |job: &Job| {
        let progress = job.progress.as_ref();
        let seconds_left = progress.and_then(|it| it.seconds_left);
        let left = match (seconds_left, progress) {
            (Some(left), _) if left > 0.0 => format!("{} left", duration(left)),
            (_, Some(it)) => format!("{:.0} % done", 100.0 * it.fraction),
            (_, None) => "just begun".to_owned(),
        };
        format!("{} of {}, {left}", kind(job), titles.of(job))
    };
    let all: Vec<String> = jobs.iter().map(one).collect();
    Ok((!all.is_empty()).then(|| all.join("; ")))
}

/// A wait, until it is dropped.
struct Waiting {
    /// Whether this wait is inside another one.
    inner: bool,
}

impl Waiting {
    fn begin() -> Self {
        Self {
            inner: WAITING.swap(true, Ordering::SeqCst),
        }
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        WAITING.store(self.inner, Ordering::SeqCst);
    }
}

/// The count of Ctrl-C. The first call listens for the rest of the process, since the system's own
/// reaction is gone with the first listener.
fn interrupts() -> watch::Receiver<u32> {
    let listen = || {
        let (send, pressed) = watch::channel(0);
        match signal() {
            Ok(mut signal) => {
                tokio::spawn(async move {
                    while signal.recv().await.is_some() {
                        if !WAITING.load(Ordering::SeqCst) {
                            std::process::exit(INTERRUPTED);
                        }
                        send.send_modify(|count| *count += 1);
                    }
                });
            }
            Err(error) => tracing::warn!(%error, "no notice of Ctrl-C"),
        }
        pressed
    };
    PRESSED.get_or_init(listen).clone()
}

#[cfg(unix)]
fn signal() -> std::io::Result<tokio::signal::unix::Signal> {
    tokio::signal::unix::signal(tokio::signal::unix::SignalKind::interrupt())
}

#[cfg(windows)]
fn signal() -> std::io::Result<tokio::signal::windows::CtrlC> {
    tokio::signal::windows::ctrl_c()
}

/// How to come back to a job that nobody watches, in its `last` known state.
fn left(name: &str, last: Option<&Job>) -> String {
    let later = match last.map(Job::kind) {
        // An upload's job has no files.
        Some(JobKind::Ingest) => format!("`yoto job watch {name}`"),
        _ => format!("`yoto job fetch {name} --out DIR`"),
    };
    format!(
        "it goes on as {name} without this program: Ctrl-C again to leave, {later} to come back, \
         `yoto job cancel {name}` to end it"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_back_depends_on_the_job() {
        let ingest = Job {
            kind: JobKind::Ingest.into(),
            ..Job::default()
        };
        assert!(left("jobs/1", Some(&ingest)).contains("`yoto job watch jobs/1`"));
        assert!(left("jobs/1", None).contains("`yoto job fetch jobs/1 --out DIR`"));
    }
}
