//! Files of programs that find the poses of people in a video, with the clip itself.
//!
//! One file per tool reads its files to [`Found`](tool::Found): people, frames, rotations, translations
//! and cameras. The rest is common to all: which person ([`choice`]), rest joints ([`rest`]), which frame
//! of the clip a pose is of ([`frames`]), masks ([`masks`]), what the numbers mean ([`reading`]) and
//! whether that is true ([`proof`]).
//!
//! ```text
//! tool's files → recognise → Found ┐
//! clip, masks ─────────────────────┴→ choice (rest × masks × readings, by proof) → track
//! ```

mod choice;
mod easymocap;
mod ex_avatar;
mod frames;
mod gvhmr;
mod lhm;
mod masks;
mod phalp;
mod prompthmr;
mod proof;
mod reading;
mod recognise;
mod rest;
mod romp;
mod to_world;
mod tool;
mod track_proof;
mod tram;
mod wham;

pub(super) use easymocap::{Calibration, calibration};
pub(super) use frames::left_out;
pub(super) use masks::{Masks, MasksByFrame, masks_given};
pub(super) use proof::LEAST;
pub(super) use reading::Focal;
pub(super) use recognise::has_files;
pub(super) use tool::{Found, Seen, Tool};
pub(super) use track_proof::{agreement, prove, said_agreement};

use super::clip::{Clip, fault, listed};
use super::geometry::{Mat3, Vec3, add, apply, sub, transpose};
use super::track::{Camera, Placed, empty_track, smpl_skeleton};
use super::{Imported, Options, given};
use choice::Choice;
use frames::Numbers;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use yoto_client::ClientError;

/// Endings of videos, lower case.
const VIDEOS: [&str; 6] = [".mp4", ".mov", ".m4v", ".mkv", ".webm", ".avi"];
/// Frames per second of a clip that has no times.
const FPS: f64 = 30.0;

/// Reads the tool's files in `options.poses`, of the clip `source`; `forced` if the user says which tool
/// wrote them.
pub(super) fn read(
    source: &Path,
    options: &Options,
    forced: Option<Tool>,
) -> Result<Imported, ClientError> {
    let at = options.poses.as_deref().unwrap_or(source);
    let (tool, found) = recognise::read(at, forced, options)?;
    given::ensure_read(tool.format(), source, options)?;
    let mut notes = vec![summary(tool, &found)];
    notes.extend(found.notes.iter().cloned());
    let ffmpeg = options.ffmpeg.as_deref();
    let clip = if options.poses.is_some() {
        Clip::open(source, ffmpeg)?
    } else {
        let inside = clip_in(source)?;
        notes.push(format!("the clip: {}", inside.display()));
        Clip::open(&inside, ffmpeg)?
    };
    ensure_size(&found, &clip, at, tool)?;
    clip.selected(options)?;
    let numbers = Numbers::find(&found, &clip, at, &mut notes)?;
    let masks = match &options.matting {
        Some(model) => {
            let people = found.people.iter().flat_map(|person| &person.seen);
            let frames = people.filter_map(|seen| numbers.frame(seen, &clip, 0));
            vec![Masks::made(
                model,
                frames.collect(),
                &clip,
                options,
                &mut notes,
            )?]
        }
        None => Masks::find(options.masks.as_deref(), &found, &clip)?,
    };
    let choice = Choice::find(
        tool, &found, &masks, numbers, &clip, at, options, &mut notes,
    )?;
    let mut capture = imported(&choice, numbers, &clip, at, options, notes)?;
    capture.track.distortion = found.distortion;
    Ok(capture)
}

/// `4D-Humans (PHALP): 2 people, 301 frames`.
fn summary(tool: Tool, found: &Found) -> String {
    let people = match found.people.len() {
        1 => "1 person".to_owned(),
        many => format!("{many} people"),
    };
    let poses = found.people.iter().flat_map(|person| &person.seen);
    let frames: std::collections::BTreeSet<usize> = poses.map(|seen| seen.number).collect();
    format!("{}: {people}, {} frames", tool.name(), frames.len())
}

/// The video of a tool's folder, if there is one alone.
fn clip_in(source: &Path) -> Result<PathBuf, ClientError> {
    let folder = if source.is_dir() {
        source
    } else {
        source.parent().unwrap_or(Path::new(""))
    };
    // GVHMR's copy of its input, beside videos of its results.
    let copy = folder.join("0_input_video.mp4");
    if copy.is_file() {
        return Ok(copy);
    }
    match &listed(folder, &VIDEOS)?[..] {
        [one] => Ok(one.clone()),
        _ => {
            let message = "these are a pose tool's files; the clip is needed as well: yoto import \
                           VIDEO --poses THESE, where VIDEO may be a folder of pictures";
            Err(fault(source, "MISSING", message))
        }
    }
}

fn ensure_size(found: &Found, clip: &Clip, at: &Path, tool: Tool) -> Result<(), ClientError> {
    let Some(size) = found.size else {
        return Ok(());
    };
    if reading::ratio(size, clip.size.map(f64::from)).is_some() {
        return Ok(());
    }
    let message = format!(
        "{} saw images of {:.0}x{:.0}, the clip has {}x{}: was it cut or turned?",
        tool.name(),
        size[0],
        size[1],
        clip.size[0],
        clip.size[1]
    );
    Err(fault(at, "SIZE_MISMATCH", message))
}

/// The capture of the chosen person.
fn imported(
    choice: &Choice<'_>,
    numbers: Numbers,
    clip: &Clip,
    at: &Path,
    options: &Options,
    mut notes: Vec<String>,
) -> Result<Imported, ClientError> {
    let wanted = clip.selected(options)?;
    let rest_root = choice.rest.joints.first().copied().unwrap_or_default();
    let mut frames = BTreeMap::new();
    let (mut unmasked, mut changed) = (Vec::new(), None);
    for seen in &choice.person.seen {
        let Some(index) = numbers.frame(seen, clip, choice.reading.shift) else {
            continue;
        };
        if wanted.binary_search(&index).is_err() || frames.contains_key(&index) {
            continue;
        }
        let mask = choice.masks.map(|masks| masks.of(seen, index));
        if mask.as_ref().is_some_and(Option::is_none) {
            unmasked.push(index);
            continue;
        }
        let mut camera = choice
            .reading
            .camera(seen, clip.size)
            .map_err(|message| fault(at, "SIZE_MISMATCH", format!("frame {index}: {message}")))?;
        let mut placed = choice.reading.placed(seen, choice.rest.pelvis(seen));
        if let Some(focal) = options.focal {
            changed.get_or_insert(camera.k[0][0]);
            refocus(&mut camera, &mut placed, focal);
        }
        if let Some(world) = &seen.to_world {
            (camera, placed) = world.place(camera, placed);
        }
        let frame = placed.frame(index as u32, rest_root, &camera);
        frames.insert(index, (frame, mask.flatten().into_iter().collect()));
    }
    if let (Some(from), Some(to)) = (changed, options.focal)
        && (from - to).abs() > 1e-6 * to
    {
        notes.push(format!(
            "the focal length is {to} px (--focal) in place of {from:.1}: distances from the camera are \
             {:.3} times as long",
            to / from
        ));
    }
    let absent: Vec<usize> = wanted
        .iter()
        .copied()
        .filter(|frame| !frames.contains_key(frame))
        .filter(|frame| !unmasked.contains(frame))
        .collect();
    left_out(&absent, "a pose of the person", |_| false, &mut notes);
    left_out(&unmasked, "a mask", |_| false, &mut notes);
    if frames.is_empty() {
        let message = "no frame is left that has a pose and, if there are masks, a mask";
        return Err(fault(at, "EMPTY", message));
    }
    let fps = clip.fps.filter(|fps| fps.is_finite());
    let fps = options.fps.or(fps).unwrap_or_else(|| {
        notes.push(format!(
            "no file says how fast the frames are: {FPS} a second (--fps)"
        ));
        FPS
    });
    let mut track = empty_track(smpl_skeleton(choice.rest.joints.clone()), clip.size, fps);
    let indices: Vec<usize> = frames.keys().copied().collect();
    let masks;
    (track.frames, masks) = frames.into_values().unzip();
    Ok(Imported {
        track,
        pictures: clip.pictures(&indices, masks),
        available: clip.frames,
        notes,
    })
}

/// Changes the focal length, and with it the distance, so that the body stays where it is seen.
fn refocus(camera: &mut Camera, placed: &mut Placed, focal: f64) {
    let by = focal / camera.k[0][0];
    camera.k[0][0] *= by;
    camera.k[1][1] *= by;
    let turn: Mat3 = std::array::from_fn(|i| std::array::from_fn(|j| camera.e[i][j]));
    let shift: Vec3 = std::array::from_fn(|i| camera.e[i][3]);
    let mut seen = add(apply(&turn, placed.root), shift);
    seen[2] *= by;
    placed.root = apply(&transpose(&turn), sub(seen, shift));
}
