//! Measures a trained model in a folder, without a service.

use crate::captures::{self, Recording, Split};
use crate::display::Screen;
use crate::measure;
use crate::training::{lpips, pick_device};
use anyhow::{Context, ensure};
use std::path::PathBuf;
use yoto_avatar::evaluate::{Examiner, Protocol, Score};
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_avatar::render::Renderer;
use yoto_avatar::train::ModelState;
use yoto_capture::skeleton::Skeleton;
use yoto_proto::v1::{Progress, Scores};

/// Largest distance between a capture's rest joints and those of its slot, metres: rounding
/// errors of files.
const SAME_BODY: f64 = 1e-4;

/// Settings of a measurement.
#[derive(Debug, Clone)]
pub struct ModelDirOptions {
    /// Folder with a checkpoint's weights and state.
    pub model_dir: PathBuf,
    /// Capture folders, one for each of the model's slots, in their order.
    pub captures: Vec<PathBuf>,
    /// A protocol's name.
    pub protocol: String,
    /// Longest side of compared pictures, unless the protocol has its own, pixels; 0 keeps the
    /// pictures' size.
    pub size: u32,
    /// At most this many pictures of each kind and person.
    pub pictures: usize,
    /// Weights of the networks of LPIPS; without them it is not measured.
    pub lpips: Option<LpipsWeights>,
}

/// Figures of a model.
#[derive(Debug, Clone)]
pub struct Measured {
    /// The model's variant.
    pub variant: String,
    /// Training steps of the model.
    pub step: u64,
    /// The protocol's name.
    pub protocol: String,
    /// Figures by person and kind of pictures; means last.
    pub rows: Vec<(String, Scores)>,
    /// The kinds of pictures.
    pub headings: Vec<String>,
    /// Means over the people, one for each heading.
    pub means: Vec<Scores>,
}

/// Measures.
///
/// # Errors
/// When model or captures can't be read or don't match, or the protocol has no figures.
pub fn run(options: &ModelDirOptions, screen: &dyn Screen) -> anyhow::Result<Measured> {
    let protocol = Protocol::named(&options.protocol)?;
    ensure!(
        protocol.figures,
        "'{}' has no figures: its pictures are for visual comparison",
        protocol.name
    );
    let dir = &options.model_dir;
    let state = ModelState::read(dir)
        .with_context(|| format!("the model {} (is it a checkpoint's folder?)", dir.display()))?;
    let recordings = captures::read_all(&options.captures, options.size, protocol, screen)?;
    check_slots(&state.slots, &recordings)?;
    let missing = protocol.missing(recordings.iter().map(|it| it.name.as_str()));
    if !missing.is_empty() {
        screen.note(&format!(
            "{} is of {} subjects; without {} the mean is not comparable with published ones",
            protocol.name,
            protocol.subjects.len(),
            missing.join(", ")
        ));
    }
    let picked = pick_device(screen);
    let renderer = Renderer::load(dir, &picked.device)
        .with_context(|| format!("the model {}", dir.display()))?;
    let examiner = Examiner::new(renderer, protocol, lpips(options.lpips.as_ref(), &picked)?);
    let (mut rows, mut headings, mut means) = (Vec::new(), Vec::new(), Vec::new());
    let mut display = screen.begin("evaluating");
    for split in Split::of(protocol) {
        let mut scores = Vec::new();
        for (slot, recording) in recordings.iter().enumerate() {
            let mut done = 0;
            let of = recording.subset(*split, options.pictures).count();
            let name = format!("{}, {}", recording.name, split.title());
            let on_picture = |_: &_, _: &_| {
                done += 1;
                display.progress(&Progress {
                    phase: format!("{name}, picture {done} of {of}"),
                    fraction: done as f64 / of as f64,
                    ..Progress::default()
                });
                Ok(())
            };
            let pictures = options.pictures;
            let score = measure::person(&examiner, slot, recording, *split, pictures, on_picture)?;
            rows.push((name, Scores::from(&score)));
            scores.push(score);
        }
        headings.push(split.title().to_owned());
        means.push(Scores::from(&Score::mean(&scores)));
    }
    display.finish(&format!("{} people", recordings.len()));
    let mean_rows = headings.iter().zip(&means);
    rows.extend(mean_rows.map(|(title, mean)| (format!("mean, {title}"), *mean)));
    Ok(Measured {
        variant: state.config.variant.name().to_owned(),
        step: state.step,
        protocol: protocol.name.to_owned(),
        rows,
        headings,
        means,
    })
}

/// Checks that captures and slots have the same bodies; otherwise one person's appearance would be
/// compared with another's.
fn check_slots(slots: &[Option<Skeleton>], recordings: &[Recording]) -> anyhow::Result<()> {
    for (slot, recording) in recordings.iter().enumerate() {
        let name = &recording.name;
        let body = slots
            .get(slot)
            .and_then(Option::as_ref)
            .with_context(|| format!("the model has no person in slot {slot}, for {name}"))?;
        let theirs = Skeleton::from_track(&recording.shard.track.skeleton)
            .with_context(|| format!("the skeleton of {name}"))?;
        let apart =
            |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).any(|(a, b)| (a - b).abs() > SAME_BODY);
        let other = body.rest.iter().zip(&theirs.rest).any(|(a, b)| apart(a, b));
        ensure!(
            body.parents == theirs.parents && !other,
            "slot {slot} of the model is not the body of {name}; give the captures in the order \
             that the model was trained with"
        );
    }
    Ok(())
}
