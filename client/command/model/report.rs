//! `yoto report`: a model in one file to send.

use crate::args::Server;
use crate::files::{folder_of, keep};
use anyhow::Context;
use clap::Args;
use std::io::Write;
use std::path::PathBuf;
use tempfile::NamedTempFile;
use yoto_terminal::output;

const AFTER_HELP: &str = "\
The report is one page that needs no service and runs no script: the people with what the check of
their captures has found, held-out frames beside their renders, trainings with curves, the newest
evaluation beside the paper's figures, pictures of the newest render (with the filmed frames, if it
was made with --compare truth), the measured trade-off, checkpoints, and how long jobs ran. It
shows people: send it only to whom they allow.

Example:
  yoto report duo --out duo.html";

/// Write what a model is, how it was trained and what it is worth as one page.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Report {
    /// The model, by name.
    model: String,
    /// The page to write; a file of this name is replaced.
    #[arg(long, value_name = "FILE", default_value = "report.html")]
    out: PathBuf,
    #[command(flatten)]
    server: Server,
}

impl Report {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let model = client.find_model(&self.model).await?;
        let page = client.model_report(&model.name).await?;
        let writing = || format!("writing {}", self.out.display());
        let mut part = NamedTempFile::new_in(folder_of(&self.out)).with_context(writing)?;
        part.write_all(&page).with_context(writing)?;
        keep(part, &self.out).with_context(writing)?;
        output::put("files", output::paths(&[&self.out]));
        say!("{}", self.out.display());
        Ok(())
    }
}
