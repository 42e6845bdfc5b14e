//! `yoto job fetch`: the files that a job has written.

use crate::files::{OutFolder, download, is_of_tradeoff};
use crate::show;
use crate::waiting::wait;
use anyhow::Context;
use std::path::PathBuf;
use yoto_client::YotoClient;
use yoto_proto::v1::{EvaluateResult, Job, NamedObject, job_result};
use yoto_terminal::output::{self, others};
use yoto_terminal::progress::ProgressDisplay;
use yoto_terminal::scores::scores_json;

/// File with the scores of an evaluation.
const SCORES: &str = "scores.json";

/// Waits for the job `name` and writes its files to `folder`; returns their paths.
pub(crate) async fn fetch(
    client: &YotoClient,
    name: &str,
    folder: &OutFolder,
) -> anyhow::Result<Vec<PathBuf>> {
    let mut display = ProgressDisplay::new(name);
    let job = wait(client, name, &mut display).await?;
    display.clear();
    output::put("job", output::message(&job));
    match job.result.as_ref().and_then(|result| result.kind.as_ref()) {
        Some(job_result::Kind::Render(_) | job_result::Kind::Export(_)) => {
            download(client, name, folder).await
        }
        Some(job_result::Kind::Train(result)) => download(client, &result.checkpoint, folder).await,
        Some(job_result::Kind::Evaluate(result)) => measured(client, &job, result, folder).await,
        Some(job_result::Kind::Ingest(_)) => {
            anyhow::bail!("{name} has no files: it read a capture, which stays with the service")
        }
        None => anyhow::bail!("{name} has no result"),
    }
}

/// Writes the scores of an evaluation, and the trade-off that it measured.
async fn measured(
    client: &YotoClient,
    job: &Job,
    result: &EvaluateResult,
    folder: &OutFolder,
) -> anyhow::Result<Vec<PathBuf>> {
    folder.ensure_free(|name| name == SCORES || is_of_tradeoff(name))?;
    for note in &result.notes {
        tell!("note: {}", others(note));
    }
    let out = &folder.out;
    let mut paths = Vec::new();
    for object in client.list_objects(&job.name).await? {
        paths.extend(tradeoff(client, &object, result, folder).await?);
    }
    let path = out.join(SCORES);
    let scores = serde_json::json!({
        "checkpoint": result.checkpoint,
        "protocol": result.protocol,
        "device": result.device,
        "notes": result.notes,
        "scores": scores_json(&show::score_rows(result)),
    });
    let json = serde_json::to_vec_pretty(&scores)
        .with_context(|| format!("the scores of {}", job.name))?;
    std::fs::create_dir_all(out)
        .and_then(|()| std::fs::write(&path, json))
        .with_context(|| format!("writing {}", path.display()))?;
    paths.push(path);
    Ok(paths)
}

/// Writes the trade-off in `object`, also as a table.
#[cfg(feature = "embedded")]
async fn tradeoff(
    client: &YotoClient,
    object: &NamedObject,
    result: &EvaluateResult,
    folder: &OutFolder,
) -> anyhow::Result<Vec<PathBuf>> {
    let json = client.object(object).await?;
    let tradeoff = crate::files::read_tradeoff(client, &result.checkpoint, &json).await?;
    Ok(tradeoff.write(&folder.out)?)
}

/// Writes the curve in `object` as it is.
#[cfg(not(feature = "embedded"))]
async fn tradeoff(
    client: &YotoClient,
    object: &NamedObject,
    _: &EvaluateResult,
    folder: &OutFolder,
) -> anyhow::Result<Vec<PathBuf>> {
    let out = &folder.out;
    std::fs::create_dir_all(out).with_context(|| format!("creating {}", out.display()))?;
    Ok(vec![client.fetch_object(object, out, &mut |_| ()).await?])
}
