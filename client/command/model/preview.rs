//! Pictures of a training under way, one for each checkpoint.

use std::path::{Path, PathBuf};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tonic::Code;
use yoto_client::{ClientError, YotoClient};
use yoto_proto::manifest::files::PREVIEW;
use yoto_proto::names;
use yoto_proto::v1::{Job, job_result};

/// Fetches the picture of each checkpoint during the training.
pub(crate) struct Previews {
    newest: watch::Sender<u64>,
    fetching: JoinHandle<Result<Vec<PathBuf>, ClientError>>,
}

impl Previews {
    /// Writes the pictures of `model` to `dir`, as `STEP.png`; `on_picture` receives step and path of each one.
    pub(crate) fn start(
        client: &YotoClient,
        model: &str,
        dir: PathBuf,
        on_picture: impl FnMut(u64, &Path) + Send + 'static,
    ) -> Self {
        let (newest, steps) = watch::channel(0);
        let (client, model) = (client.clone(), model.to_owned());
        Self {
            newest,
            fetching: tokio::spawn(
                async move { fetch(&client, &model, &dir, steps, on_picture).await },
            ),
        }
    }

    /// Takes note of the newest checkpoint in a state of the job.
    pub(crate) fn look(&self, job: &Job) {
        let reported = job.progress.as_ref().map_or(0, |it| it.checkpoint_step);
        let result = job.result.as_ref().and_then(|result| result.kind.as_ref());
        let last = match result {
            Some(job_result::Kind::Train(result)) => names::parse_checkpoint(&result.checkpoint),
            _ => return self.is_at(reported),
        };
        self.is_at(last.map_or(reported, |(_, step)| step));
    }

    fn is_at(&self, step: u64) {
        self.newest.send_if_modified(|known| {
            let is_newer = step > *known;
            *known = step.max(*known);
            is_newer
        });
    }

    /// The pictures, once the last one is there.
    pub(crate) async fn finish(self) -> anyhow::Result<Vec<PathBuf>> {
        drop(self.newest);
        Ok(self.fetching.await??)
    }
}

async fn fetch(
    client: &YotoClient,
    model: &str,
    dir: &Path,
    mut steps: watch::Receiver<u64>,
    mut on_picture: impl FnMut(u64, &Path),
) -> Result<Vec<PathBuf>, ClientError> {
    let mut paths: Vec<PathBuf> = Vec::new();
    // A resumed training begins at a checkpoint of an earlier one.
    while steps.changed().await.is_ok() {
        let step = *steps.borrow_and_update();
        let checkpoint = names::checkpoint(model, step);
        let fetched = match fetch_one(client, &checkpoint, step, dir).await {
            // The model no longer keeps it: newer checkpoints came faster than this fetch.
            Err(ClientError::Refused(refusal)) if refusal.code() == Code::NotFound => continue,
            fetched => fetched?,
        };
        for path in &fetched {
            on_picture(step, path);
        }
        paths.extend(fetched);
    }
    Ok(paths)
}

/// The preview of a checkpoint; a checkpoint of an interrupted training has none.
async fn fetch_one(
    client: &YotoClient,
    checkpoint: &str,
    step: u64,
    dir: &Path,
) -> Result<Vec<PathBuf>, ClientError> {
    let objects = client.list_objects(checkpoint).await?;
    let Some(mut preview) = objects.into_iter().find(|it| it.file == PREVIEW) else {
        return Ok(Vec::new());
    };
    preview.file = format!("{step:06}.png");
    client.fetch_objects(&[preview], dir, &mut |_| ()).await
}
