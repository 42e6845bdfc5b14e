//! `yoto status`: the service at a glance.

use crate::args::Server;
use crate::show;
use crate::show::{Titles, kind, kind_word, now, span};
use clap::Args;
use indicatif::BinaryBytes;
use prost_types::Timestamp;
use yoto_client::YotoClient;
use yoto_proto::v1::{ServiceStatus, UploadLimits, WorkerStatus};
use yoto_terminal::output::{self, others};

const AFTER_HELP: &str = "\
Examples:
  yoto status
  yoto status --ready
  yoto status --output json --server http://192.168.1.7:50051";

/// Show the service: its workers, its queue, and the room on its disk.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Status {
    /// Only check whether the service is ready. Needs no key, and fails if the service is not.
    #[arg(long)]
    ready: bool,
    #[command(flatten)]
    server: Server,
}

impl Status {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        if self.ready {
            anyhow::ensure!(client.is_ready().await?, "the service is not ready");
            say!("ready");
            return Ok(());
        }
        let status = client.status().await?;
        let limits = client.limits().await?;
        output::put("limits", output::message(&limits));
        output::put("status", output::message(&status));
        say!(
            "service  {} at {}{}",
            status.version,
            self.server.server,
            up(&status)
        );
        say!(
            "jobs     {} running, {} queued",
            status.running,
            status.queued
        );
        for paused in &status.paused {
            let kind = kind_word(paused.kind());
            let told = told(&paused.reason, &paused.by, paused.since.as_ref());
            say!("paused   {kind} jobs{told}");
            still_wanted(paused.since.as_ref(), &format!("yoto job resume {kind}"));
        }
        if let Some(draining) = &status.draining {
            let told = told(&draining.reason, &draining.by, draining.since.as_ref());
            say!("drained  no new jobs{told}");
            still_wanted(draining.since.as_ref(), "yoto drain --end");
        }
        for cordon in &status.cordons {
            let name = others(&cordon.display_name);
            let told = told(&cordon.reason, &cordon.by, cordon.since.as_ref());
            say!("cordon   {name} gets no jobs{told}");
            still_wanted(
                cordon.since.as_ref(),
                &format!("yoto worker uncordon {name}"),
            );
        }
        say!("objects  {}{}", status.objects, room(&status));
        let upload = limits.upload.unwrap_or_default();
        say!("uploads  {}", allowed(&upload));
        if status.workers.is_empty() {
            say!("workers  none: jobs wait until one asks for them (`yoto worker`)");
            return Ok(());
        }
        let titles = Titles::load(&client).await?;
        let mut rows = Vec::new();
        for worker in &status.workers {
            rows.push(row(&client, &titles, worker).await?);
        }
        say!(
            "\n{}",
            show::table(&["WORKER", "DEVICE", "SEEN", "DOES"], &rows)
        );
        if !upload.films {
            say!("no worker has a pose model: films need poses (`yoto serve --pose-model`)");
        }
        for worker in &status.workers {
            if worker.order_level < status.order_level {
                say!("{}", outdated(worker));
            }
        }
        Ok(())
    }
}

async fn row(
    client: &YotoClient,
    titles: &Titles,
    worker: &WorkerStatus,
) -> anyhow::Result<Vec<String>> {
    let device = worker.device.clone().unwrap_or_default();
    let does = match worker.job.as_str() {
        "" => "nothing".to_owned(),
        name => {
            let job = client.get_job(name).await?;
            let done = job.progress.as_ref().map_or(0.0, |it| it.fraction);
            let percent = 100.0 * done;
            format!("{} of {}, {percent:.0} %", kind(&job), titles.of(&job))
        }
    };
    let seen = worker.last_seen.as_ref().map_or_else(
        || "-".to_owned(),
        |at| format!("{} ago", span(now() - at.seconds as f64)),
    );
    Ok(vec![
        worker.display_name.clone(),
        device.adapter,
        seen,
        does,
    ])
}

/// `: a reason`.
/// Time after which an operator may have forgotten that jobs wait, seconds.
const FORGOTTEN: f64 = 86_400.0;

/// The age, the key and the reason of a pause, drain or cordon.
fn told(reason: &str, by: &str, since: Option<&Timestamp>) -> String {
    let age = since.map(|it| format!(", for {}", span(now() - it.seconds as f64)));
    let by = match by {
        "" => String::new(),
        key => format!(", by {}", others(key)),
    };
    format!("{}{by}{}", age.unwrap_or_default(), because(reason))
}

/// Asks whether what lasts for more than a day is still wanted.
fn still_wanted(since: Option<&Timestamp>, end: &str) {
    if since.is_some_and(|it| now() - it.seconds as f64 > FORGOTTEN) {
        say!("         is that still wanted? `{end}` ends it");
    }
}

fn because(reason: &str) -> String {
    match reason {
        "" => String::new(),
        reason => format!(": {}", others(reason)),
    }
}

/// The note on a worker that does not understand all orders.
fn outdated(worker: &WorkerStatus) -> String {
    let version = match worker.version.as_str() {
        "" => "an earlier version".to_owned(),
        version => format!("version {}", others(version)),
    };
    let name = others(&worker.display_name);
    format!("{name} is of {version}: orders that it does not understand wait for other workers")
}

/// `, up for 3h`.
fn up(status: &ServiceStatus) -> String {
    status
        .start_time
        .as_ref()
        .map_or_else(String::new, |start| {
            format!(", up for {}", span(now() - start.seconds as f64))
        })
}

/// `a capture has at most 8.00 GiB in 200000 files, of at most 8.00 GiB each`.
fn allowed(limits: &UploadLimits) -> String {
    format!(
        "a capture has at most {} in {} files, of at most {} each",
        BinaryBytes(limits.capture_bytes),
        limits.files,
        BinaryBytes(limits.file_bytes)
    )
}

/// `, 12.00 GiB of 80.00 GiB free`.
fn room(status: &ServiceStatus) -> String {
    match (status.disk_free, status.disk_total) {
        (Some(free), Some(total)) => {
            format!(", {} of {} free", BinaryBytes(free), BinaryBytes(total))
        }
        _ => String::new(),
    }
}
