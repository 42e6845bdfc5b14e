//! `yoto subject erase` and `erasure`: a person is removed from everything, and the report of it.

use crate::args::Server;
use anyhow::{Context, bail, ensure};
use clap::Args;
use std::io::{IsTerminal, Write};
use std::time::Duration;
use yoto_client::YotoClient;
use yoto_proto::sha256_hex;
use yoto_proto::v1::{Erasure, erasure};
use yoto_terminal::output;

pub(crate) const ERASE_HELP: &str = "\
Their jobs end, a job for each model writes every checkpoint again without them (others stay the same bit for bit), and
captures, uploads, renders, exports and measurements that show them are removed at once, without the time of grace.
Then all rows and folders are searched for what is left. A worker must run for models with other people. The
erasure can't be undone. Backups and files that were downloaded are not touched.

Examples:
  yoto subject erase ada                       asks for the name again
  yoto subject erase ada --yes --no-wait
  yoto subject erase ada --retrain             also trains new models without them";
pub(crate) const ERASURE_HELP: &str = "\
The report has the id that the person had and the SHA-256 of their name, but not the name. `--out` writes the
bytes that are signed (Ed25519); signature and key are in `--output json`.

Examples:
  yoto subject erasure ada
  yoto subject erasure erasures/0b55bd0e-0b5c-4c7e-9b0c-0d6d3c0e7d7a --out ada.json";

/// Pause between two looks at an erasure.
const POLL: Duration = Duration::from_millis(500);

/// A person to erase.
#[derive(Debug, Args)]
pub(crate) struct Erase {
    /// The person, by name.
    name: String,
    /// Do not ask for the name again.
    #[arg(long)]
    yes: bool,
    /// Do not wait for the end: the erasure continues by itself.
    #[arg(long)]
    no_wait: bool,
    /// Also train a new model from scratch for the other people of each model whose shared parameters were trained
    /// with the person. The report names the new models.
    #[arg(long)]
    retrain: bool,
    #[command(flatten)]
    server: Server,
}

/// An erasure to show.
#[derive(Debug, Args)]
pub(crate) struct ShowErasure {
    /// The erased person, by the name that they had, or the erasure: erasures/ID.
    of: String,
    /// Write the report to this file.
    #[arg(long, value_name = "FILE")]
    out: Option<std::path::PathBuf>,
    #[command(flatten)]
    server: Server,
}

impl Erase {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let subject = client.find_subject(&self.name).await?;
        if !self.yes {
            confirm(&subject.display_name)?;
        }
        let mut erasure = client
            .erase_subject(&subject.name, &subject.display_name, self.retrain)
            .await?;
        let mut told = String::new();
        while !self.no_wait && erasure.state() == erasure::State::Running {
            if erasure.message != told {
                told.clone_from(&erasure.message);
                tell!("{told}");
            }
            tokio::time::sleep(POLL).await;
            erasure = client.get_erasure(&erasure.name).await?;
        }
        show(&erasure)?;
        ensure!(
            erasure.state() != erasure::State::Failed,
            "the erasure has failed: repeat the command once that is mended"
        );
        Ok(())
    }
}

/// Asks for the person's name on the terminal.
fn confirm(name: &str) -> anyhow::Result<()> {
    ensure!(
        std::io::stdin().is_terminal(),
        "nobody can be asked for the name again here: say --yes to erase {name}"
    );
    let mut terminal = std::io::stderr();
    write!(terminal, "type the name again to erase them for ever: ")?;
    terminal.flush()?;
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer)?;
    ensure!(
        answer.trim() == name,
        "that is another name: nothing is erased"
    );
    Ok(())
}

impl ShowErasure {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let erasure = match self.of.starts_with("erasures/") {
            true => client.get_erasure(&self.of).await?,
            false => by_name(&client, &self.of).await?,
        };
        if let Some(path) = &self.out {
            ensure!(
                !erasure.report.is_empty(),
                "{} has no report yet",
                erasure.name
            );
            std::fs::write(path, &erasure.report)
                .with_context(|| format!("writing {}", path.display()))?;
        }
        show(&erasure)
    }
}

/// The newest erasure of a person who was called `name`.
async fn by_name(client: &YotoClient, name: &str) -> anyhow::Result<Erasure> {
    let hash = sha256_hex(name.as_bytes());
    let mut all = client.list_erasures().await?.into_iter();
    match all.find(|it| it.name_sha256 == hash) {
        Some(erasure) => Ok(erasure),
        None => bail!("nobody called '{name}' was erased"),
    }
}

/// Prints an erasure with its report.
fn show(erasure: &Erasure) -> anyhow::Result<()> {
    output::put("erasure", output::message(erasure));
    say!("{}: {}", erasure.name, erasure.state().as_str_name());
    if !erasure.message.is_empty() {
        say!("{}", erasure.message);
    }
    if !erasure.report.is_empty() {
        let report: serde_json::Value =
            serde_json::from_str(&erasure.report).context("reading the report")?;
        for line in report["says"].as_array().into_iter().flatten() {
            say!("{}", line.as_str().unwrap_or_default());
        }
        say!("{}", erasure.report);
        output::put("report", report);
    }
    Ok(())
}
