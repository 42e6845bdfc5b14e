//! The demo, end to end: a client with its own service.
//!
//! Everything between the synthetic people and the final files uses the API, so the demo shows
//! the results of any client.

pub(crate) mod command;
mod page;
mod people;
mod render;
mod report;
mod score;
mod sheet;

use crate::model::report as model_report;
use crate::studio::players::write_pages;
use crate::studio::service::with_service;
use crate::studio::shots::Shots;
use crate::studio::training::train;
use crate::studio::{folder, person};
use anyhow::Context;
use people::Actor;
use report::{DemoReport, Settings};
use std::path::{Path, PathBuf};
use std::time::Instant;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_client::YotoClient;
use yoto_ingest::IngestSettings;
use yoto_proto::tiers::DEFAULT_TIER;
use yoto_proto::v1::TrainSpec;
use yoto_terminal::progress::duration;

/// Quality tier and variant of the demo's model.
const TIER: &str = DEFAULT_TIER;
const VARIANT: &str = "yoto";

/// What to show.
#[derive(Debug, Clone)]
pub(crate) struct DemoOptions {
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
    /// Weights of the networks of LPIPS, if present.
    pub lpips: Option<LpipsWeights>,
}

/// The main output files, with descriptions; the pages come last, where a terminal shows them.
pub(crate) fn products(options: &DemoOptions) -> Vec<(PathBuf, &'static str)> {
    let mut files = vec![
        (
            options.out.join("report.json"),
            "quality and times, as JSON",
        ),
        (
            options.out.join("report.html"),
            "the model in one page to send",
        ),
        (
            sheet::novel_views(&options.out),
            "each person: truth, render; cameras never trained on",
        ),
        (
            sheet::novel_poses(&options.out),
            "each person: truth, render; poses never trained on",
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
        files.push((
            sheet::between(&options.out),
            "from person 1 to person 2 in ten steps",
        ));
    }
    files.push((
        options.out.join("*.html"),
        "each person to rotate, move and bend; open in a browser",
    ));
    files.push((
        page::path(&options.out),
        "everything on one page; open in a browser",
    ));
    files
}

/// The page that leads to everything else.
pub(crate) fn index(options: &DemoOptions) -> PathBuf {
    page::path(&options.out)
}

/// Runs the demo and writes `report.json`.
///
/// # Errors
/// The first failure.
pub(crate) async fn run(options: &DemoOptions) -> anyhow::Result<DemoReport> {
    let started = Instant::now();
    let (subjects, size, seed) = (options.subjects, options.size, options.seed);
    let data = folder::fresh(&options.out, "service", "demo")?;
    tell!(
        "filming {subjects} synthetic {} with one camera each, at {size}x{size} pixels",
        if subjects == 1 { "person" } else { "people" }
    );
    let actors = tokio::task::spawn_blocking(move || people::film(subjects, size, seed)).await??;
    for actor in &actors {
        actor.write_capture(&capture_folder(&options.out, &actor.name))?;
    }
    let ingest = IngestSettings::default();
    let report = with_service(data, ingest, options.lpips.clone(), async |client| {
        drive(client, options, &actors).await
    })
    .await?;
    let path = options.out.join("report.json");
    report
        .write(&path)
        .with_context(|| format!("writing {}", path.display()))?;
    let names: Vec<&str> = actors.iter().map(|actor| &*actor.name).collect();
    page::write(&options.out, &names, &report)?;
    tell!("done in {}", duration(started.elapsed().as_secs_f64()));
    Ok(report)
}

/// The part that uses the API.
async fn drive(
    client: &YotoClient,
    options: &DemoOptions,
    actors: &[Actor],
) -> anyhow::Result<DemoReport> {
    let mut subjects = Vec::new();
    for actor in actors {
        let folder = capture_folder(&options.out, &actor.name);
        let consent = "synthetic person of yoto demo";
        subjects.push(person::upload(client, &actor.name, consent, &folder).await?);
    }
    let model = client.create_model("demo", TIER, VARIANT).await?;
    for subject in &subjects {
        client.add_identity(&model.name, &subject.name).await?;
    }
    let names: Vec<&str> = actors.iter().map(|actor| &*actor.name).collect();
    let label = format!("training of one model of {}", names.join(", "));
    let trained = train(
        client,
        &label,
        TrainSpec {
            model: model.name.clone(),
            seconds: options.seconds,
            seed: options.seed,
            image_size: options.size,
            ..TrainSpec::default()
        },
        |_| (),
    )
    .await?;

    let studio = render::Studio {
        shots: Shots {
            client,
            model: &model,
        },
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
            let pictures = studio.between(moves, wears).await?;
            sheet::write_between(&options.out, pictures)?;
        }
        _ => tell!("left out: motion transfer and mixtures, which need two people (--subjects 2)"),
    }
    sheet::write_held_out(&options.out, actors, &renders)?;

    let paths = actors.iter();
    let paths = paths.map(|actor| options.out.join(format!("{}.html", actor.name)));
    let paths: Vec<PathBuf> = paths.collect();
    let pages: Vec<_> = subjects.iter().zip(paths.iter().map(|it| &**it)).collect();
    write_pages(client, &model, &pages).await?;
    model_report::write(client, &model.name, &options.out.join("report.html")).await?;

    let scores = score::subjects(actors, &renders)?;
    let settings = Settings {
        tier: TIER.into(),
        variant: VARIANT.into(),
        size: options.size,
        seed: options.seed,
    };
    Ok(score::report(scores, &renders, trained, settings))
}

fn capture_folder(out: &Path, name: &str) -> PathBuf {
    out.join("captures").join(name)
}
