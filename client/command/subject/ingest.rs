//! `yoto subject ingest`: another attempt at an ingest that failed or was cancelled.

use super::add::say_ingested;
use crate::args::Server;
use crate::waiting::wait_for_new;
use anyhow::Context;
use clap::Args;
use yoto_terminal::output;
use yoto_terminal::progress::ProgressDisplay;

pub(crate) const HELP: &str = "\
The capture must be UPLOADED (its ingest was cancelled, or failed for another reason than its files) or
REJECTED (for example by an earlier version). Its files must still exist: those of a rejected capture are
removed after the time of grace. `yoto subject show` lists the captures of a person.

Example:
  yoto subject ingest captures/0b55bd0e-0b5c-4c7e-9b0c-0d6d3c0e7d7a";

/// A capture to read again.
#[derive(Debug, Args)]
pub(crate) struct Ingest {
    /// The capture, captures/ID.
    capture: String,
    /// Return at once, without waiting for the ingest job.
    #[arg(long)]
    no_wait: bool,
    #[command(flatten)]
    server: Server,
}

impl Ingest {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let capture = client.ingest_capture(&self.capture).await?;
        let mut display = ProgressDisplay::new(self.capture.clone());
        if self.no_wait {
            display.finish(&format!("ingest runs as {}", capture.ingest_job));
            output::put("ingest_job", capture.ingest_job);
            return Ok(());
        }
        let job = wait_for_new(&client, &capture.ingest_job, &mut display).await;
        let job = job.with_context(|| format!("{} was not accepted", self.capture))?;
        say_ingested(&job, &self.capture, &[], display);
        let capture = client.get_capture(&self.capture).await?;
        output::put("capture", output::message(&capture));
        Ok(())
    }
}
