//! The demo, end to end: a client with its own service.
//!
//! Everything between the synthetic people and the final files uses the API, so the demo shows
//! the results of any client.

mod people;
mod render;
mod score;
mod sheet;

use crate::api::YotoClient;
use crate::embedded::{Embedded, EmbeddedOptions};
use crate::progress::{ProgressDisplay, duration};
use anyhow::{Context, bail, ensure};
use people::Actor;
use std::path::{Path, PathBuf};
use std::time::Instant;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_lab::report::{Report, Settings};
use yoto_proto::v1::{Model, PoseRefinement, Subject, TrainResult, TrainSpec, job_result};

/// Quality tier and variant of the demo's model.
const TIER: &str = "fast";
const VARIANT: &str = "yoto";
/// Marks a folder of a demo, which the next demo may replace.
const MARKER: &str = "made-by-yoto-demo";

/// What to show.
#[derive(Debug, Clone)]
pub struct DemoOptions {
    /// Output folder.
    pub out: PathBuf,
    /// Number of people in the model.
    pub subjects: usize,
    /// Side of the pictures, pixels.
    pub size: u32,
    /// Seconds of training.
    pub seconds: f64,
    /// Random seed.
    pub seed: u64,
    /// Weights of the networks of LPIPS, where there are any.
    pub lpips: Option<LpipsWeights>,
}

/// The main output files, with descriptions.
pub fn products(options: &DemoOptions) -> Vec<(PathBuf, &'static str)> {
    let mut files = vec![
        (
            sheet::novel_views(&options.out),
            "each person: truth, render; cameras never trained on",
        ),
        (
            sheet::novel_poses(&options.out),
            "the same in poses never trained on",
        ),
        (
            options.out.join("orbit-*-animation.png"),
            "each person from all around; open in a browser",
        ),
    ];
    if options.subjects > 1 {
        files.push((
            sheet::motion(&options.out),
            "above: person 1 filmed; below: person 2 in that motion",
        ));
        files.push((
            options.out.join("motion-transfer.png"),
            "the same, moving; open in a browser",
        ));
    }
    files.push((options.out.join("report.json"), "the figures"));
    files
}

/// Runs the demo and writes `report.json`.
///
/// # Errors
/// The first failure.
pub async fn run(options: &DemoOptions) -> anyhow::Result<Report> {
    let started = Instant::now();
    let (subjects, size, seed) = (options.subjects, options.size, options.seed);
    let data = fresh_service_folder(&options.out)?;
    tell!(
        "filming {subjects} {} at {size}x{size}",
        if subjects == 1 { "person" } else { "people" }
    );
    let actors = tokio::task::spawn_blocking(move || people::film(subjects, size, seed)).await??;
    for actor in &actors {
        actor.write_capture(&capture_folder(&options.out, &actor.name))?;
    }

    let mut service = Embedded::start(EmbeddedOptions {
        data,
        listen: None,
        worker: true,
        ingest: yoto_ingest::IngestSettings::default(),
        lpips: options.lpips.clone(),
    })
    .await
    .context("starting the embedded service")?;
    tell!("computing on {}", service.device());
    if let Some(hint) = yoto_device::hint_on_cpu() {
        tell!("{hint}");
    }
    let client = service.client();
    let outcome = tokio::select! {
        outcome = drive(&client, options, &actors) => outcome,
        failed = service.failed() => Err(failed.into()),
        interrupted = tokio::signal::ctrl_c() => {
            interrupted?;
            Err(anyhow::anyhow!("interrupted"))
        }
    };
    let stopped = service
        .shutdown()
        .await
        .context("stopping the embedded service");
    let report = outcome?;
    stopped?;
    let path = options.out.join("report.json");
    report
        .write(&path)
        .with_context(|| format!("writing {}", path.display()))?;
    tell!("done in {}", duration(started.elapsed().as_secs_f64()));
    Ok(report)
}

/// The part that uses the API.
async fn drive(
    client: &YotoClient,
    options: &DemoOptions,
    actors: &[Actor],
) -> anyhow::Result<Report> {
    let mut subjects = Vec::new();
    for actor in actors {
        subjects.push(upload(client, &options.out, actor).await?);
    }
    let model = client.create_model("demo", TIER, VARIANT).await?;
    for subject in &subjects {
        client.add_identity(&model.name, &subject.name).await?;
    }
    let trained = train(client, &model, options).await?;

    let studio = render::Studio {
        client,
        model: &model,
        out: &options.out,
        size: options.size,
    };
    let mut renders = Vec::new();
    for (actor, subject) in actors.iter().zip(&subjects) {
        renders.push(studio.held_out(actor, subject).await?);
        studio.orbit(actor, subject).await?;
    }
    match (actors, subjects.as_slice()) {
        ([driver, ..], [moves, wears, ..]) => {
            let pictures = studio.motion_transfer(moves, wears).await?;
            sheet::write_motion(&options.out, driver, &pictures)?;
        }
        _ => tell!("motion transfer needs two people; with one it is left out"),
    }
    sheet::write_held_out(&options.out, actors, &renders)?;

    let scores = score::subjects(actors, &renders)?;
    let settings = Settings {
        tier: TIER.into(),
        variant: VARIANT.into(),
        size: options.size,
        seed: options.seed,
        sharing: None,
        changed: Vec::new(),
    };
    Ok(score::report(scores, &renders, trained, settings))
}

/// Adds one person and waits until their capture is ready.
async fn upload(client: &YotoClient, out: &Path, actor: &Actor) -> anyhow::Result<Subject> {
    let capture = crate::capture_dir::CaptureDir::open(&capture_folder(out, &actor.name))?;
    let subject = client
        .create_subject(&actor.name, "synthetic person of yoto demo")
        .await?;
    let mut display = ProgressDisplay::new(actor.name.clone());
    let (mut sent, total, frames) = (0, capture.bytes, capture.frames());
    let uploaded = client
        .upload_capture(&subject.name, capture.files, |bytes| {
            sent += bytes;
            display.bytes(sent, total);
        })
        .await?;
    let job = client
        .wait_for_job(&uploaded.ingest_job, |job| display.job(job))
        .await;
    job.with_context(|| format!("ingesting the capture of {}", actor.name))?;
    display.finish(&format!("{} frames uploaded and ingested", frames));
    Ok(subject)
}

async fn train(
    client: &YotoClient,
    model: &Model,
    options: &DemoOptions,
) -> anyhow::Result<TrainResult> {
    let spec = TrainSpec {
        model: model.name.clone(),
        seconds: options.seconds,
        steps: 0,
        seed: options.seed,
        image_size: options.size,
        checkpoint_seconds: 0.0,
        refine_poses: PoseRefinement::Unspecified.into(),
    };
    let job = client.train(spec).await?;
    let mut display = ProgressDisplay::new("training");
    let job = client
        .wait_for_job(&job.name, |job| display.job(job))
        .await?;
    match job.result.and_then(|result| result.kind) {
        Some(job_result::Kind::Train(result)) => {
            display.finish(&format!(
                "{} steps in {}",
                result.steps,
                duration(result.train_seconds)
            ));
            Ok(result)
        }
        _ => bail!("{} succeeded without a training result", job.name),
    }
}

fn capture_folder(out: &Path, name: &str) -> PathBuf {
    out.join("captures").join(name)
}

/// An empty folder for the service. The folder of an earlier demo is replaced; any other folder
/// is not changed.
fn fresh_service_folder(out: &Path) -> anyhow::Result<PathBuf> {
    let folder = out.join("service");
    if folder.exists() {
        ensure!(
            folder.join(MARKER).is_file(),
            "{} exists and was not made by an earlier demo; move it away or choose another --out",
            folder.display()
        );
        std::fs::remove_dir_all(&folder)
            .with_context(|| format!("removing {}", folder.display()))?;
    }
    std::fs::create_dir_all(&folder).with_context(|| format!("creating {}", folder.display()))?;
    let marker = folder.join(MARKER);
    std::fs::write(&marker, "The next yoto demo replaces this folder.\n")
        .with_context(|| format!("writing {}", marker.display()))?;
    Ok(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_demos_own_folder_is_replaced() {
        let out = tempfile::tempdir().expect("temporary folder");
        let folder = fresh_service_folder(out.path()).expect("makes one");
        let old = folder.join("old");
        std::fs::write(&old, b"x").expect("writes");
        fresh_service_folder(out.path()).expect("replaces its own");
        assert!(!old.exists());

        std::fs::remove_file(folder.join(MARKER)).expect("removes");
        std::fs::write(&old, b"x").expect("writes");
        let error = fresh_service_folder(out.path()).expect_err("not its own");
        assert!(
            error.to_string().contains("not made by an earlier demo"),
            "{error}"
        );
        assert!(old.exists());
    }
}
