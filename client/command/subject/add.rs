//! `yoto subject add`: a person, and the upload of a capture.

use crate::args::Server;
use crate::args::capture::ImportOptions;
use crate::args::correction::CorrectionArgs;
use crate::args::media::MediaArgs;
use crate::upload_files::upload_files;
use crate::waiting::wait_for_new;
use anyhow::Context;
use clap::Args;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use yoto_client::YotoClient;
use yoto_import::capture_dir::CaptureDir;
use yoto_import::{Format, TrackForm};
use yoto_proto::v1::{Job, Subject, job_result, subject};
use yoto_terminal::output::{self, others};
use yoto_terminal::progress::ProgressDisplay;

pub(super) const HELP: &str = "\
A capture is a folder, or a zip, tar or tar.gz of one; the media may be in train/:
  poses.json             skeleton, image_size, fps, frames [index, pose, translation, K, E]
  frames/000000.png …    pictures (PNG, JPEG, WebP), or frames.zip, frames.tar, or video.mp4
  masks/000000.png …     coverage of the person, or masks.zip, masks.tar, masks.mp4, or
                         background.png, the view without the person, or none: alpha channel
  media.json             how to read them, with the same settings as the options below
A film without poses is a capture too, if a worker of the service has a pose model (serve --pose-model).

H.264 in MP4 or MOV is decoded by the service; other videos need ffmpeg on its worker.

Examples:
  yoto subject add ada captures/ada --consent 'signed 2026-03-01'
  yoto subject add ada captures/ada --frames video
  yoto subject add cleo walk.mp4
  yoto subject add bob bob.tar.gz --every 2 --range 100..400 --no-wait
  yoto subject add eve CoreView_377 --from zju --smpl SMPL_NEUTRAL.npz
  (`yoto import --help` describes the formats of --from)
  yoto subject add eve captures/eve --extrinsics c2w --units camera=mm

`yoto capture check captures/eve` says which of the options below are needed, if any.

An upload continues after a lost connection, also when the same command is run again within a day.";

#[derive(Debug, Args)]
pub(super) struct Add {
    /// Name of the person.
    name: String,
    /// The capture: a folder, an archive or a film, or a capture in the format of --from.
    #[arg(value_name = "CAPTURE", required_unless_present = "capture_flag")]
    capture: Option<PathBuf>,
    /// The same as an option.
    #[arg(
        long = "capture",
        value_name = "CAPTURE",
        conflicts_with = "capture",
        hide = true
    )]
    capture_flag: Option<PathBuf>,
    /// Format of the capture; it is imported first.
    #[arg(long, value_name = "FORMAT")]
    from: Option<Format>,
    #[command(flatten)]
    import: ImportOptions,
    #[command(flatten)]
    media: MediaArgs,
    /// The consent under which the recordings are used; stored with the person.
    #[arg(long, value_name = "NOTE", default_value = "")]
    consent: String,
    /// Upload another capture of a person who already has one. From then on, trainings use the new capture.
    #[arg(long)]
    again: bool,
    /// Return after the upload, without waiting for the ingest job.
    #[arg(long)]
    no_wait: bool,
    #[command(flatten)]
    correction: CorrectionArgs,
    #[command(flatten)]
    server: Server,
}

impl Add {
    /// A new subject, or the existing one of this name without a valid capture.
    async fn subject(&self, client: &YotoClient) -> anyhow::Result<Subject> {
        let known = client.list_subjects().await?;
        let mut named: Vec<Subject> = known
            .into_iter()
            .filter(|it| it.display_name == self.name && it.state() != subject::State::Erased)
            .collect();
        // A person with captures comes before one who was only created.
        named.sort_by_key(|it| it.captures.is_empty());
        match named.into_iter().next() {
            None if self.again => anyhow::bail!(
                "there is no person called '{}' to upload another capture of",
                self.name
            ),
            None => Ok(client.create_subject(&self.name, &self.consent).await?),
            Some(subject) => {
                let state = subject.state();
                let empty = matches!(state, subject::State::Uploading | subject::State::Rejected);
                anyhow::ensure!(
                    state != subject::State::Uploaded,
                    "the files of '{}' are uploaded, and their ingest failed or was cancelled: `yoto subject \
                     show` names the capture, `yoto subject ingest` tries again, `yoto subject \
                     delete-capture` removes it",
                    self.name
                );
                anyhow::ensure!(
                    empty || (self.again && state == subject::State::Ready),
                    "there is a person called '{}' already, who is {}: choose another name, or --again \
                     uploads another capture of them once they are READY",
                    self.name,
                    state.as_str_name()
                );
                Ok(subject)
            }
        }
    }

    /// The imported capture in a temporary folder, if it is of another program; removed after
    /// the upload.
    fn imported(&self, path: &Path) -> anyhow::Result<Option<TempDir>> {
        let Some(format) = self.from else {
            anyhow::ensure!(
                !self.import.any(),
                "--rest-joints, --view, --poses, --fps, --person, --focal, --height and --best belong to \
                 an import: say --from"
            );
            return Ok(None);
        };
        let folder = tempfile::tempdir().context("making a temporary folder")?;
        self.import.import(
            format,
            path,
            folder.path(),
            TrackForm::Json,
            None,
            self.media.masks(),
        )?;
        Ok(Some(folder))
    }

    pub(super) async fn run(self) -> anyhow::Result<()> {
        let path = self.capture.iter().chain(&self.capture_flag).next();
        let path = path.context("which capture?")?.clone();
        let imported = self.imported(&path)?;
        let folder = imported.as_ref().map_or(&*path, TempDir::path);
        let mut options = self.media.options(self.correction.correction());
        if imported.is_some() {
            // The import has read them, and has written masks of its own.
            options.masks = None;
        }
        let capture = CaptureDir::open_with(folder, &options)?;
        for note in &capture.notes {
            tell!("{}: {note}", self.name);
        }
        let client = self.server.connect().await?;
        let files = upload_files(capture.files);
        // Before a person is created, who would then have no capture.
        client.fits(&files).await?;
        let subject = self.subject(&client).await?;

        let mut display = ProgressDisplay::new(self.name.clone());
        let (mut sent, total) = (0, capture.bytes);
        let on_bytes = |bytes| {
            sent += bytes;
            display.bytes(sent, total);
        };
        let uploaded = client
            .upload_capture(&subject.name, files, on_bytes)
            .await?;
        if self.no_wait {
            display.finish(&format!("uploaded; ingest runs as {}", uploaded.ingest_job));
            say!("{}", subject.name);
            output::put("subject", output::message(&subject));
            output::put("ingest_job", uploaded.ingest_job);
            return Ok(());
        }
        let job = wait_for_new(&client, &uploaded.ingest_job, &mut display).await;
        let job =
            job.with_context(|| format!("the capture {} was not accepted", path.display()))?;
        say_ingested(&job, &self.name, &capture.notes, display);
        say!("{}", subject.name);
        let subject = client.get_subject(&subject.name).await?;
        output::put("subject", output::message(&subject));
        Ok(())
    }
}

/// Prints what an ingest job made of a capture of `name`, with its notes other than those in `told`.
pub(super) fn say_ingested(job: &Job, name: &str, told: &[String], display: ProgressDisplay) {
    let kind = job.result.as_ref().and_then(|result| result.kind.as_ref());
    let Some(job_result::Kind::Ingest(ingest)) = kind else {
        return display.finish("ready");
    };
    for note in ingest.notes.iter().filter(|note| !told.contains(note)) {
        tell!("{name}: {}", others(note));
    }
    display.finish(&format!(
        "ready, {} frames of {}x{}",
        ingest.frames, ingest.width, ingest.height
    ));
    for warning in &ingest.warnings {
        tell!("warning: {}", others(warning));
    }
}
