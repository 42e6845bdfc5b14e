//! `yoto report`: a model in one file to send.

use crate::args::Server;
use crate::files::{folder_of, keep};
use anyhow::Context;
use clap::Args;
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;
use yoto_client::YotoClient;
use yoto_terminal::output;

const AFTER_HELP: &str = "\
The report is one page that needs no service and runs no script: the people with the check of
their captures, held-out frames beside their renders, trainings with curves, the newest
evaluation beside the paper's figures, pictures of the newest render (with the filmed frames, if it
was made with --compare truth), the measured trade-off, checkpoints, and how long jobs ran. It
shows people: send it only to those whom they have allowed to see it.

Example:
  yoto report duo --out duo.html";

/// Write a page about a model: its people, its trainings and its quality.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct WriteReport {
    /// The model, by name.
    model: String,
    /// File for the page; a file of this name is replaced.
    #[arg(long, value_name = "FILE", default_value = "report.html")]
    out: PathBuf,
    #[command(flatten)]
    server: Server,
}

/// Writes the report of the model with this resource name to the file `out`, which is replaced.
///
/// # Errors
/// When the service has no report, or the file can't be written.
pub(crate) async fn write(client: &YotoClient, model: &str, out: &Path) -> anyhow::Result<()> {
    let page = client.model_report(model).await?;
    let writing = || format!("writing {}", out.display());
    let mut part = NamedTempFile::new_in(folder_of(out)).with_context(writing)?;
    part.write_all(&page).with_context(writing)?;
    keep(part, out).with_context(writing)
}

impl WriteReport {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let model = client.find_model(&self.model).await?;
        write(&client, &model.name, &self.out).await?;
        output::put("files", output::paths(&[&self.out]));
        say!("{}", self.out.display());
        Ok(())
    }
}
