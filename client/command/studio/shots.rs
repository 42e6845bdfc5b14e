//! Render jobs of one trained model, and their files.

use anyhow::{Context, bail};
use std::path::{Path, PathBuf};
use yoto_client::YotoClient;
use yoto_proto::v1::{Between, Job, Model, RenderSpec, Subject, job_result, render_spec};
use yoto_terminal::progress::ProgressDisplay;

/// Name of a render job's animation.
const ANIMATION: &str = "animation.png";

/// Renders with one trained model.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shots<'a> {
    /// A client of the model's service.
    pub client: &'a YotoClient,
    /// The trained model.
    pub model: &'a Model,
}

/// What to render, and where to.
#[derive(Debug)]
pub(crate) struct Shot<'a> {
    /// For the progress.
    pub label: String,
    /// The person.
    pub subject: &'a Subject,
    /// Mixtures of the person and another one, in place of the person.
    pub between: Option<Between>,
    /// The views.
    pub what: render_spec::What,
    /// Folder for the pictures.
    pub folder: PathBuf,
    /// File for an animation of them, and its frames per second.
    pub animation: Option<(PathBuf, f32)>,
}

/// The files of a finished render job.
#[derive(Debug)]
pub(crate) struct Finished {
    /// The job.
    pub job: Job,
    /// The pictures, in order.
    pub frames: Vec<PathBuf>,
    /// Time that rendering took.
    pub seconds_per_frame: f64,
}

impl Shots<'_> {
    /// Runs one render job and fetches its files.
    ///
    /// # Errors
    /// When the job fails or its files can't be written.
    pub(crate) async fn render(&self, shot: Shot<'_>) -> anyhow::Result<Finished> {
        let spec = RenderSpec {
            model: self.model.name.clone(),
            subject: shot.subject.name.clone(),
            what: Some(shot.what),
            between: shot.between,
            animate: shot.animation.is_some(),
            fps: shot.animation.as_ref().map_or(0.0, |(_, fps)| *fps),
            ..RenderSpec::default()
        };
        let queued = self.client.create_render(spec).await?;
        let mut display = ProgressDisplay::new(shot.label);
        let job = self
            .client
            .wait_for_job(&queued.name, |job| display.job(job))
            .await?;
        let Some(job_result::Kind::Render(result)) =
            job.result.as_ref().and_then(|result| result.kind.as_ref())
        else {
            bail!("{} succeeded without a render result", job.name);
        };
        let seconds_per_frame = result.seconds_per_frame;
        let objects = self.client.list_objects(&job.name).await?;
        let mut frames = self
            .client
            .fetch_objects(&objects, &shot.folder, &mut |_| ())
            .await?;
        if let Some((target, _)) = shot.animation {
            let made = frames.iter().position(|path| path.ends_with(ANIMATION));
            let made = made.with_context(|| format!("{} made no {ANIMATION}", job.name))?;
            move_file(&frames.remove(made), &target)?;
        }
        display.finish_in_detail(&format!(
            "{} pictures, {seconds_per_frame:.2} s each",
            frames.len()
        ));
        Ok(Finished {
            job,
            frames,
            seconds_per_frame,
        })
    }
}

fn move_file(from: &Path, to: &Path) -> anyhow::Result<()> {
    std::fs::rename(from, to).with_context(|| format!("writing {}", to.display()))
}
