//! `yoto subject poses`: the poses of a person as a training has refined them.

use crate::args::Server;
use crate::args::correction::CorrectionArgs;
use crate::args::media::MediaArgs;
use anyhow::{Context, bail, ensure};
use clap::Args;
use image::ImageFormat;
use std::path::{Path, PathBuf};
use yoto_client::YotoClient;
use yoto_import::FfmpegArg;
use yoto_import::capture_check::refined_sheet;
use yoto_import::capture_dir::DecodedCapture;
use yoto_proto::v1::{Model, Subject};
use yoto_terminal::output;

const AFTER_HELP: &str = "\
A training refines the poses of people whose bodies wander off their masks (`yoto train --help`).
Renders of their own frames and of their motion use the refined poses. The file that this command
writes is a poses.json of the frames that were trained on, with all corrections applied.

Examples:
  yoto subject poses ada --refined ada/refined.json
  yoto subject poses ada --refined refined.json --model duo --sheet sheet.png --capture captures/ada";

/// Write the poses of a person as a training has refined them.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct SubjectPoses {
    /// Name of the person.
    name: String,
    /// File for the refined pose track, as JSON.
    #[arg(long, value_name = "FILE")]
    refined: PathBuf,
    /// Model whose training refined the poses; needed for a person in several models.
    #[arg(long)]
    model: Option<String>,
    /// Also draw both skeletons on frames of --capture.
    #[arg(long, value_name = "PNG", requires = "capture")]
    sheet: Option<PathBuf>,
    /// The person's capture, with the options with which it was added.
    #[arg(long, value_name = "CAPTURE", requires = "sheet")]
    capture: Option<PathBuf>,
    #[command(flatten)]
    media: MediaArgs,
    #[command(flatten)]
    correction: CorrectionArgs,
    #[command(flatten)]
    ffmpeg: FfmpegArg,
    #[command(flatten)]
    server: Server,
}

impl SubjectPoses {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let subject = client.find_subject(&self.name).await?;
        let model = model_of(&client, &subject, self.model.as_deref()).await?;
        let track = client.refined_poses(&model.name, &subject.name).await?;
        let json = serde_json::to_vec(&track).context("writing the pose track")?;
        write(&self.refined, &json)?;
        say!("poses: {}", self.refined.display());
        let files: Vec<&PathBuf> = [&self.refined].into_iter().chain(&self.sheet).collect();
        output::put("files", output::paths(&files));
        if let (Some(sheet), Some(capture)) = (&self.sheet, &self.capture) {
            let options = self.media.options(self.correction.correction());
            let decoded = DecodedCapture::open(capture, &options, self.ffmpeg.program())?;
            let mut png = std::io::Cursor::new(Vec::new());
            refined_sheet(&decoded, &track)?
                .write_to(&mut png, ImageFormat::Png)
                .context("encoding the sheet")?;
            write(sheet, png.get_ref())?;
            say!("sheet: {}", sheet.display());
        }
        Ok(())
    }
}

/// The model called `name`, or without a name the only one with a slot for `subject`.
async fn model_of(
    client: &YotoClient,
    subject: &Subject,
    name: Option<&str>,
) -> anyhow::Result<Model> {
    if let Some(name) = name {
        return Ok(client.find_model(name).await?);
    }
    let has = |model: &Model| model.slots.iter().any(|it| it.subject == subject.name);
    let mut models: Vec<Model> = client.list_models().await?;
    models.retain(has);
    let names: Vec<&str> = models.iter().map(|it| &*it.display_name).collect();
    ensure!(
        names.len() <= 1,
        "'{}' is in several models; say which with --model: {}",
        subject.display_name,
        names.join(", ")
    );
    match models.pop() {
        Some(model) => Ok(model),
        None => bail!("no model has a slot for '{}'", subject.display_name),
    }
}

fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    if let Some(folder) = path.parent().filter(|it| !it.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("making the folder {}", folder.display()))?;
    }
    std::fs::write(path, bytes).with_context(|| format!("writing {}", path.display()))
}
