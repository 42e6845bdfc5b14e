//! `yoto status`: the service at a glance.

use crate::args::Server;
use crate::show;
use crate::show::{Titles, kind, kind_word, now, span};
use clap::Args;
use indicatif::BinaryBytes;
use yoto_client::YotoClient;
use yoto_proto::v1::{ServiceStatus, WorkerStatus};
use yoto_terminal::output;

const AFTER_HELP: &str = "\
Examples:
  yoto status
  yoto status --output json --server http://192.168.1.7:50051";

/// Show the service: its workers, its queue, and the room on its disk.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Status {
    #[command(flatten)]
    server: Server,
}

impl Status {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let status = client.status().await?;
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
            let reason = match paused.reason.as_str() {
                "" => String::new(),
                reason => format!(": {reason}"),
            };
            say!("paused   {} jobs{reason}", kind_word(paused.kind()));
        }
        say!("objects  {}{}", status.objects, room(&status));
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

/// `, up for 3h`.
fn up(status: &ServiceStatus) -> String {
    status
        .start_time
        .as_ref()
        .map_or_else(String::new, |start| {
            format!(", up for {}", span(now() - start.seconds as f64))
        })
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
