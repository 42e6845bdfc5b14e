//! One person's avatar from one clip: everything between a video and a page, in one call.
//!
//! ```text
//! clip ─ capture (import, check) ─► service: upload, train ─► pictures (orbit, motion) ─► page
//! ```
//!
//! Everything after the check goes through the API of a service of its own, as in the demo.

mod capture;
pub(crate) mod command;
mod motion;
mod page;
mod report;
mod summary;

pub use report::Report;

use crate::studio::players::write_pages;
use crate::studio::service::with_service;
use crate::studio::shots::{Shot, Shots};
use crate::studio::training::train;
use crate::studio::{folder, person};
use anyhow::{Context, ensure};
use motion::Shown;
use std::path::{Path, PathBuf};
use std::time::Instant;
use yoto_import::{Format, Options, motion::Motion};
use yoto_ingest::IngestSettings;
use yoto_proto::tiers::DEFAULT_TIER;
use yoto_proto::v1::{Orbit, TrainSpec, render_spec};
use yoto_terminal::output;
use yoto_terminal::progress::duration;

/// Name of this command, on the folders that it may replace.
const MAKER: &str = "avatar";
/// Quality tier and variant of the model.
const TIER: &str = DEFAULT_TIER;
const VARIANT: &str = "yoto";
/// The page, the one that plays the person, and the folders beside them.
const PAGE: &str = "index.html";
const PLAYER: &str = "play.html";
/// What was said, in full.
const LOG: &str = "log.txt";
const FOLDERS: [&str; 4] = ["capture", "check", "pictures", "service"];
/// Length of the person in training images and renders if no size is asked for, pixels.
const PERSON: u32 = 512;
/// Longest side of training images and renders then, pixels.
const LARGEST: u32 = 1024;
/// Views of the orbit.
const ORBIT_VIEWS: u32 = 24;
/// Frames per second of the orbit's animation: it goes around in two seconds.
const ORBIT_FPS: f32 = 12.0;

/// What to make an avatar of, and how.
#[derive(Debug)]
pub struct AvatarOptions {
    /// The clip, or a capture.
    pub source: PathBuf,
    /// Its format.
    pub format: Format,
    /// Inputs of the import.
    pub import: Options,
    /// Name of the person.
    pub name: String,
    /// Folder for everything.
    pub out: PathBuf,
    /// Longest side of training images and renders, pixels. By default that of the clip, at most
    /// [`LARGEST`].
    pub size: Option<u32>,
    /// The training, of no model yet.
    pub train: TrainSpec,
    /// Motion to render, in place of one of this program's own.
    pub motion: Option<Motion>,
    /// Train even when the check fails.
    pub despite_check: bool,
}

/// Checks that no file of the user would be replaced.
fn ensure_replaceable(options: &AvatarOptions) -> anyhow::Result<()> {
    let out = &options.out;
    let own = FOLDERS.iter().map(|name| out.join(name));
    if let (Ok(source), Ok(out)) = (options.source.canonicalize(), out.canonicalize()) {
        ensure!(
            !source.starts_with(&out),
            "{} is in the folder for the results: choose another --out",
            options.source.display()
        );
    }
    let page = out.join(PAGE);
    let is_own = own.into_iter().any(|folder| folder::is_of(&folder, MAKER));
    for file in [page, out.join(LOG)] {
        ensure!(
            is_own || !file.exists(),
            "{} is there already and was not made by an earlier `yoto {MAKER}`: choose another --out",
            file.display()
        );
    }
    Ok(())
}

/// The folders of results, empty.
fn folders(out: &Path) -> anyhow::Result<[PathBuf; 4]> {
    let [capture, check, pictures, service] = FOLDERS.map(|name| folder::fresh(out, name, MAKER));
    Ok([capture?, check?, pictures?, service?])
}

/// Makes the avatar: `index.html`, `play.html`, `report.json` and what they show, in the folder of the options.
///
/// # Errors
/// The first failure; a capture whose check fails is one, unless the options say otherwise.
pub async fn run(options: &AvatarOptions) -> anyhow::Result<Report> {
    let started = Instant::now();
    let out = &options.out;
    ensure_replaceable(options)?;
    // The files of an earlier run stay until this one has a capture that can be trained.
    let attempt = folder::fresh(out, "attempt", MAKER)?;
    let log = attempt.join(LOG);
    output::log::start(&log).with_context(|| format!("writing {}", log.display()))?;
    let (captured, checked) = tokio::task::block_in_place(|| {
        let captured = capture::import(options, &attempt.join("capture"))?;
        let checks = attempt.join("check");
        let ffmpeg = options.import.ffmpeg.as_deref();
        let folder = attempt.join("capture");
        let checked = capture::check(&folder, &checks, ffmpeg, options.despite_check)?;
        anyhow::Ok((captured, checked))
    })?;
    let [folder, checks, pictures, data] = folders(out)?;
    for (made, target) in [("capture", &folder), ("check", &checks)] {
        folder::move_into(&attempt.join(made), target)?;
    }
    let moved = out.join(LOG);
    std::fs::rename(&log, &moved).with_context(|| format!("writing {}", moved.display()))?;
    detail!(
        "the body over the frames: {}",
        checks.join("sheet.png").display()
    );
    std::fs::remove_dir_all(&attempt).with_context(|| format!("removing {}", attempt.display()))?;
    summary::lines(&captured, &checked)
        .iter()
        .for_each(|line| tell!("{line}"));
    // This program's own motion moves SMPL's joints.
    let shown = match &options.motion {
        Some(motion) => Shown::Given(motion),
        None if captured.has_smpl_joints => Shown::BuiltIn,
        None => Shown::Clip(captured.frames.clone()),
    };
    let mut report = Report::new(options, captured, checked);
    let size = report.size;
    let ingest = IngestSettings {
        ffmpeg: options.import.ffmpeg.clone(),
        ..IngestSettings::default()
    };
    let made = with_service(data, ingest, None, async |client| {
        let consent = "made by `yoto avatar` on the user's own machine";
        let subject = person::upload(client, &options.name, consent, &folder).await?;
        let model = client.create_model(&options.name, TIER, VARIANT).await?;
        client.add_identity(&model.name, &subject.name).await?;
        let label = format!("training of {}", options.name);
        let trained = train(
            client,
            &label,
            TrainSpec {
                model: model.name.clone(),
                image_size: size,
                ..options.train.clone()
            },
        )
        .await?;
        for note in &trained.notes {
            detail!("note: {note}");
        }
        let shots = Shots {
            client,
            model: &model,
        };
        let orbit = shots
            .render(Shot {
                between: None,
                label: format!("{} from all around", options.name),
                subject: &subject,
                what: render_spec::What::Orbit(Orbit {
                    frame: report.orbit_frame,
                    views: ORBIT_VIEWS,
                    size,
                }),
                folder: pictures.join("orbit"),
                animation: Some((out.join("orbit.png"), ORBIT_FPS)),
            })
            .await?;
        let (what, fps) = shown.what(&subject, size, report.fps)?;
        let moved = shots
            .render(Shot {
                between: None,
                label: format!("{} in a motion", options.name),
                subject: &subject,
                what,
                folder: pictures.join("motion"),
                animation: Some((out.join("motion.png"), fps)),
            })
            .await?;
        let player = out.join(PLAYER);
        write_pages(client, &model, &[(&subject, &player)]).await?;
        Ok((trained, orbit, moved))
    })
    .await?;
    let (trained, orbit, moved) = made;
    report.trained(trained);
    report.rendered(out, &orbit, &moved);
    report.seconds.total = started.elapsed().as_secs_f64();
    let path = out.join("report.json");
    let json = serde_json::to_vec_pretty(&report).context("writing the report")?;
    std::fs::write(&path, json).with_context(|| format!("writing {}", path.display()))?;
    page::write(&out.join(PAGE), &report, shown.caption())?;
    tell!(
        "done in {}; all notes are in {}",
        duration(report.seconds.total),
        out.join(LOG).display()
    );
    Ok(report)
}
