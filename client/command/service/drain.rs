//! `yoto drain`: the service takes no new jobs.

use crate::args::{Reason, Server};
use clap::Args;
use std::time::Duration;
use yoto_client::YotoClient;

/// Interval between looks at what still runs.
const LOOK_EVERY: Duration = Duration::from_secs(1);

const AFTER_HELP: &str = "\
Queued jobs wait, running jobs continue, and new jobs are refused (DRAINING). All coordinators of the
service take part, and a restart does not end it. A single coordinator drains by itself when it is
asked to stop (`yoto serve --drain-seconds`).

Examples:
  yoto drain --wait --reason \"the disk is exchanged\"
  yoto drain --end";

/// Take no new jobs and give no leases, before an upgrade or a repair.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Drain {
    #[command(flatten)]
    reason: Reason,
    /// Wait until no job runs.
    #[arg(long)]
    wait: bool,
    /// Take jobs and give leases again.
    #[arg(long, conflicts_with_all = ["wait", "reason"])]
    end: bool,
    #[command(flatten)]
    server: Server,
}

impl Drain {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        if self.end {
            client.end_drain().await?;
            say!("the service takes jobs again");
            return Ok(());
        }
        client.drain(&self.reason.reason).await?;
        say!("the service takes no new jobs; running jobs continue");
        match self.wait {
            true => until_idle(&client).await,
            false => Ok(()),
        }
    }
}

async fn until_idle(client: &YotoClient) -> anyhow::Result<()> {
    let mut told = None;
    loop {
        let running = client.status().await?.running;
        if running == 0 {
            say!("no job runs any more");
            return Ok(());
        }
        if told.replace(running) != Some(running) {
            tell!(
                "{} still run",
                yoto_terminal::progress::count(usize::try_from(running)?, "job")
            );
        }
        tokio::time::sleep(LOOK_EVERY).await;
    }
}
