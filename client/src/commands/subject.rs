//! `yoto subject`: people and the captures of them.

use super::import::ImportOptions;
use super::{Server, correction::CorrectionArgs, table};
use crate::api::YotoClient;
use crate::capture_dir::CaptureDir;
use crate::import::{Format, TrackForm};
use crate::progress::ProgressDisplay;
use anyhow::Context;
use clap::{Args, Subcommand};
use std::path::PathBuf;
use tempfile::TempDir;
use yoto_proto::v1::{Subject, job_result, subject};

const ADD_HELP: &str = "\
Layout of the capture folder:
  poses.json             skeleton, image_size, fps, frames [index, pose, translation, K, E]
  frames/000000.png …    one image a frame, over black (or train/frames/…)
  masks/000000.png …     8-bit coverage of the person (or train/masks/…)

Examples:
  yoto subject add ada --capture captures/ada --consent 'signed 2026-03-01'
  yoto subject add bob --capture captures/bob --no-wait
  yoto subject add eve --from zju --capture CoreView_377 --smpl SMPL_NEUTRAL.npz
  (what --from takes is told by `yoto import --help`)
  yoto subject add eve --capture captures/eve --extrinsics c2w --units camera=mm

`yoto capture check captures/eve` says which of the options below are needed, if any.";

const LIST_HELP: &str = "\
Example:
  yoto subject list";

/// Add and list people.
#[derive(Debug, Args)]
pub(super) struct SubjectCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Add a person: upload a capture folder and wait until it is ready for training.
    #[command(after_help = ADD_HELP)]
    Add(Box<Add>),
    /// List the people the service knows.
    #[command(after_help = LIST_HELP)]
    List {
        #[command(flatten)]
        server: Server,
    },
}

#[derive(Debug, Args)]
struct Add {
    /// What to call the person.
    name: String,
    /// Folder with poses.json, frames and masks, or what --from says.
    #[arg(long, value_name = "DIR")]
    capture: PathBuf,
    /// Which program wrote the capture; it is imported first.
    #[arg(long, value_name = "FORMAT")]
    from: Option<Format>,
    #[command(flatten)]
    import: ImportOptions,
    /// Under which consent the recordings are used; kept with the person.
    #[arg(long, value_name = "NOTE", default_value = "")]
    consent: String,
    /// Return once everything is uploaded; the service goes on by itself.
    #[arg(long)]
    no_wait: bool,
    #[command(flatten)]
    correction: CorrectionArgs,
    #[command(flatten)]
    server: Server,
}

impl SubjectCommand {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        match self.action {
            Action::Add(add) => add.run().await,
            Action::List { server } => list(&server).await,
        }
    }
}

impl Add {
    /// A new subject, or the one of this name that an earlier upload left without a good capture.
    async fn subject(&self, client: &YotoClient) -> anyhow::Result<Subject> {
        let known = client.list_subjects().await?;
        match known.into_iter().find(|s| s.display_name == self.name) {
            None => Ok(client.create_subject(&self.name, &self.consent).await?),
            Some(subject) => {
                let state = subject.state();
                anyhow::ensure!(
                    matches!(state, subject::State::Uploading | subject::State::Rejected),
                    "there is a person called '{}' already ({}, {})",
                    self.name,
                    subject.name,
                    state.as_str_name()
                );
                Ok(subject)
            }
        }
    }

    /// The capture as a folder of our own, where another program wrote it; it goes away once
    /// everything is uploaded.
    fn imported(&self) -> anyhow::Result<Option<TempDir>> {
        let Some(format) = self.from else {
            anyhow::ensure!(
                !self.import.any(),
                "--rest-joints, --view, --poses, --fps and --frames belong to an import: say --from"
            );
            return Ok(None);
        };
        let folder = tempfile::tempdir().context("making a temporary folder")?;
        self.import
            .import(format, &self.capture, folder.path(), TrackForm::Json)?;
        Ok(Some(folder))
    }

    async fn run(self) -> anyhow::Result<()> {
        let imported = self.imported()?;
        let folder = imported.as_ref().map_or(&*self.capture, TempDir::path);
        let capture = CaptureDir::open_corrected(folder, &self.correction.correction())?;
        let client = self.server.connect().await?;
        let subject = self.subject(&client).await?;

        let mut display = ProgressDisplay::new(self.name.clone());
        let (mut sent, total) = (0, capture.bytes);
        let on_bytes = |bytes| {
            sent += bytes;
            display.bytes(sent, total);
        };
        let uploaded = client
            .upload_capture(&subject.name, capture.files, on_bytes)
            .await?;
        if self.no_wait {
            display.finish(&format!("uploaded; ingest runs as {}", uploaded.ingest_job));
            println!("{}", subject.name);
            return Ok(());
        }
        let job = client
            .wait_for_job(&uploaded.ingest_job, |job| display.job(job))
            .await;
        let job = job
            .with_context(|| format!("the capture {} was not accepted", self.capture.display()))?;
        match job.result.and_then(|result| result.kind) {
            Some(job_result::Kind::Ingest(ingest)) => {
                display.finish(&format!(
                    "ready, {} frames of {}x{}",
                    ingest.frames, ingest.width, ingest.height
                ));
                for warning in &ingest.warnings {
                    eprintln!("warning: {warning}");
                }
            }
            _ => display.finish("ready"),
        }
        println!("{}", subject.name);
        Ok(())
    }
}

async fn list(server: &Server) -> anyhow::Result<()> {
    let subjects = server.connect().await?.list_subjects().await?;
    let row = |subject: &subject::State| subject.as_str_name().to_owned();
    let rows: Vec<Vec<String>> = subjects
        .iter()
        .map(|subject| {
            let captures = subject.captures.len().to_string();
            vec![
                subject.name.clone(),
                subject.display_name.clone(),
                row(&subject.state()),
                captures,
                subject.consent_note.clone(),
            ]
        })
        .collect();
    println!(
        "{}",
        table::table(&["NAME", "PERSON", "STATE", "CAPTURES", "CONSENT"], &rows)
    );
    Ok(())
}
