//! `yoto subject export`: all that the service holds of a person, as files that other programs read.

mod captures;
mod consents;
mod jobs;
mod models;

use crate::args::Server;
use anyhow::{Context, ensure};
use clap::Args;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use yoto_client::YotoClient;
use yoto_proto::v1::Subject;
use yoto_terminal::output;
use yoto_terminal::progress::count;

pub(crate) const HELP: &str = "\
The folder has:
  person.json        what the service knows of them: name, note, consents, links, captures, models, jobs, and
                     `left_out`
  captures/ID/       the frames and masks that are kept, poses.json, thumbnail and check report. `yoto subject add`
                     reads this folder
  models/ID/STEP/    person.safetensors: their own parameters in a checkpoint; refined-poses.json
  consents/ID/       the file that proves a consent
  jobs/ID/           files of renders and exports, and scores of evaluations, that show them alone

A file that also shows somebody else is left out, and named under `left_out` in person.json. The shared parameters of a
model belong to all its people and are not in the folder.

Examples:
  yoto subject export ada --out ada
  yoto subject export ada --out ada && tar -cf ada.tar ada";

/// Name of the file about the person.
const FILE: &str = "person.json";

/// A person whose data are written.
#[derive(Debug, Args)]
pub(crate) struct Export {
    /// The person, by name.
    name: String,
    /// Folder for the files. It must be new or empty, so that no file of an earlier export or of another person is in
    /// it.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    server: Server,
}

/// A person, and the folder of their files.
struct PersonExport<'a> {
    client: &'a YotoClient,
    subject: &'a Subject,
    out: &'a Path,
}

/// What one part of the service holds about a person.
#[derive(Default)]
struct ExportedPart {
    /// For `person.json`.
    about: Vec<Value>,
    /// What is not in the folder, and why.
    left_out: Vec<String>,
    files: Vec<PathBuf>,
}

impl Export {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let subject = client.find_subject(&self.name).await?;
        ensure_empty(&self.out)?;
        let person = PersonExport {
            client: &client,
            subject: &subject,
            out: &self.out,
        };
        let consents = person.consents().await?;
        let shares = client.list_shares(&subject.name).await?;
        let captures = person.captures().await?;
        let models = person.models().await?;
        let jobs = person.jobs().await?;
        let parts = [&consents, &captures, &models, &jobs];
        let left_out: Vec<&String> = parts.iter().flat_map(|part| &part.left_out).collect();
        let about = json!({
            "subject": output::message(&subject),
            "consents": consents.about,
            "shares": output::messages(&shares),
            "captures": captures.about,
            "models": models.about,
            "jobs": jobs.about,
            "left_out": left_out,
        });
        for why in &left_out {
            tell!("left out: {why}");
        }
        let mut files: Vec<PathBuf> = parts.iter().flat_map(|it| &it.files).cloned().collect();
        // Last: a folder with it is complete.
        let text = serde_json::to_vec_pretty(&about).context("writing what is known")?;
        files.push(person.write(Path::new(FILE), &text)?);
        output::put("files", output::paths(&files));
        output::put("person", about);
        say!("{}", self.out.join(FILE).display());
        say!(
            "{} of {} in {}, {} left out",
            count(files.len(), "file"),
            subject.display_name,
            self.out.display(),
            count(left_out.len(), "thing"),
        );
        Ok(())
    }
}

impl PersonExport<'_> {
    /// Writes a file at a `place` in the folder; its path.
    fn write(&self, place: &Path, bytes: &[u8]) -> anyhow::Result<PathBuf> {
        let path = self.out.join(place);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("making the folder {}", folder.display()))?;
        }
        std::fs::write(&path, bytes).with_context(|| format!("writing {}", path.display()))?;
        Ok(path)
    }
}

/// Checks that nothing is in the folder `out`, which need not be there.
fn ensure_empty(out: &Path) -> anyhow::Result<()> {
    let reading = || format!("reading {}", out.display());
    match std::fs::read_dir(out) {
        Ok(mut entries) => {
            ensure!(
                entries.next().is_none(),
                "{} is not empty: choose another folder (--out)",
                out.display()
            );
            Ok(())
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error).with_context(reading),
    }
}

/// The last segment of a resource's name, for a folder.
fn id(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}
