//! `yoto subject erase` and `erasure`: a person is removed from everything, and the report of it.

use crate::args::Server;
use anyhow::{Context, bail, ensure};
use clap::Args;
use std::io::{IsTerminal, Write};
use std::time::Duration;
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
    /// The erased person, by the name that they had, or the id of the erasure or of the person: erasures/ID, subjects/ID, or
    /// the beginning of an ID.
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
        let erasure = found(client.list_erasures().await?, &self.of)?;
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

/// Fewest characters of an id that tell which one is meant.
const ID_CHARACTERS: usize = 4;

/// The newest erasure of a person who was called `of`, or the one with that id, or of the person with that id.
fn found(all: Vec<Erasure>, of: &str) -> anyhow::Result<Erasure> {
    let hash = sha256_hex(of.as_bytes());
    if let Some(erasure) = all.iter().find(|it| it.name_sha256 == hash) {
        return Ok(erasure.clone());
    }
    let names = |it: &Erasure, of: &str| {
        let id = |name: &str| name.split_once('/').map(|(_, id)| id.to_owned());
        let ids = [id(&it.name), id(&it.subject)].into_iter().flatten();
        [&it.name, &it.subject].into_iter().any(|name| name == of)
            || (of.len() >= ID_CHARACTERS && ids.into_iter().any(|id| id.starts_with(of)))
    };
    let mut matching = all.into_iter().filter(|it| names(it, of));
    match (matching.next(), matching.next()) {
        (Some(erasure), None) => Ok(erasure),
        (Some(one), Some(other)) => bail!("'{of}' may be {} or {}", one.name, other.name),
        (None, _) => {
            bail!("nobody called '{of}' was erased, and no erasure or erased person has this id")
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_erasure_is_found_by_the_name_and_by_each_id() {
        let erasure = |id: &str, subject: &str, name: &str| Erasure {
            name: format!("erasures/{id}"),
            subject: format!("subjects/{subject}"),
            name_sha256: sha256_hex(name.as_bytes()),
            ..Erasure::default()
        };
        let all = vec![
            erasure("0b55bd0e-1", "77aa-1", "ada"),
            erasure("0b55cc0e-2", "77bb-2", "bob"),
        ];
        let of = |of: &str| found(all.clone(), of).map(|it| it.subject);
        for ada in [
            "ada",
            "erasures/0b55bd0e-1",
            "0b55bd0e-1",
            "0b55b",
            "subjects/77aa-1",
            "77aa",
        ] {
            assert_eq!(of(ada).ok().as_deref(), Some("subjects/77aa-1"), "{ada}");
        }
        assert_eq!(of("bob").ok().as_deref(), Some("subjects/77bb-2"));
        for none in ["0b55", "0b5", "erasures/0b55", "carl"] {
            assert!(of(none).is_err(), "{none}");
        }
    }
}
