//! One person's avatar from one clip: everything between a video and a page, in one call.
//!
//! ```text
//! clip ─ capture (import, check) ─► service: upload, train ─► pictures (orbit, motion) ─► page
//! ```
//!
//! Everything after the check goes through the API of a service of its own, as in the demo.

mod capture;
pub(crate) mod command;
mod live;
mod live_page;
mod make;
mod motion;
mod page;
mod report;
mod summary;

pub(crate) use report::AvatarReport;

use crate::show;
use crate::studio::folder;
use anyhow::{Context, ensure};
use live::Live;
use make::{Places, make};
use motion::ShownMotion;
use std::path::{Path, PathBuf};
use std::time::Instant;
use yoto_import::motion::Motion;
use yoto_import::{Format, Options};
use yoto_proto::v1::TrainSpec;
use yoto_terminal::output;
use yoto_terminal::progress::duration;

/// Name of this command, on the folders that it may replace.
const MAKER: &str = "avatar";
/// The page, the one that plays the person, the report of the model, and the folders beside them.
const PAGE: &str = "index.html";
const PLAYER: &str = "play.html";
const REPORT: &str = "report.html";
/// What was said, in full.
const LOG: &str = "log.txt";
const FOLDERS: [&str; 4] = ["capture", "check", "pictures", "service"];
/// Length of the person in training images and renders if no size is asked for, pixels.
const PERSON: u32 = 512;
/// Longest side of training images and renders then, pixels.
const LARGEST: u32 = 1024;

/// What to make an avatar of, and how.
#[derive(Debug)]
pub(crate) struct AvatarOptions {
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
    /// Longest side of training images and renders, pixels. By default the person is [`PERSON`] pixels long where the
    /// clip has them, and the side is at most [`LARGEST`].
    pub size: Option<u32>,
    /// The training, of no model yet.
    pub train: TrainSpec,
    /// Motion to render, in place of one of this program's own.
    pub motion: Option<Motion>,
    /// Train even when the check fails.
    pub despite_check: bool,
    /// Open the page in a browser as soon as there is one.
    pub open: bool,
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

/// Makes the avatar: `index.html`, `play.html`, `report.html`, `report.json` and what they show, in the folder of the options.
///
/// # Errors
/// The first failure; a capture whose check fails is one, unless the options say otherwise.
pub(crate) async fn run(options: &AvatarOptions) -> anyhow::Result<AvatarReport> {
    let started = Instant::now();
    let out = &options.out;
    ensure_replaceable(options)?;
    // Files of an earlier run stay until the capture of this run is checked.
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
    std::fs::rename(&log, &moved)
        .with_context(|| format!("moving {} to {}", log.display(), moved.display()))?;
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
        Some(motion) => ShownMotion::Given(motion),
        None if captured.has_smpl_joints => ShownMotion::BuiltIn,
        None => ShownMotion::Clip(captured.frames.clone()),
    };
    let mut report = AvatarReport::new(options, captured, checked);
    let page = out.join(PAGE);
    let mut live = Live::start(&page, &report)?;
    tell!("the training shows in {}", page.display());
    if options.open {
        let page = page.clone();
        // A browser that starts may keep its caller waiting.
        tokio::task::spawn_blocking(move || show::in_browser(&page));
    }
    let places = Places {
        out,
        capture: folder,
        pictures,
        data,
    };
    let made = async {
        let made = make(options, &report, &shown, places, &live).await?;
        report.trained(made.trained);
        report.rendered(out, &made.orbit, &made.moved);
        report.seconds.total = started.elapsed().as_secs_f64();
        let path = out.join("report.json");
        let json = serde_json::to_vec_pretty(&report).context("writing the report")?;
        std::fs::write(&path, json).with_context(|| format!("writing {}", path.display()))?;
        live.end().await;
        page::write(&page, &report, shown.caption())
    };
    if let Err(error) = made.await {
        if let Err(unwritten) = live.stop(&format!("{error:#}")).await {
            tell!("note: {unwritten:#}");
        }
        return Err(error);
    }
    tell!(
        "done in {}; all notes are in {}",
        duration(report.seconds.total),
        out.join(LOG).display()
    );
    Ok(report)
}
