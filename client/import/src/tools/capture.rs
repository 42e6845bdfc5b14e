//! The capture of a person that a tool found in a clip.

use super::tool::Tool;
use crate::clip::{Clip, fault, left_out, listed};
use crate::geometry::{Mat3, Vec3, add, matvec, sub, transpose};
use crate::proof::{ImportChoice, Masks, Numbers, ToolOutput, ratio};
use crate::track::{Camera, WorldPose, empty_track, smpl_skeleton};
use crate::{ImportError, Imported, Options};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Endings of videos, lower case.
const VIDEOS: [&str; 6] = [".mp4", ".mov", ".m4v", ".mkv", ".webm", ".avi"];

/// The capture of a person among those that `tool` `found` in the clip `source`.
///
/// # Errors
/// When the clip or its masks can't be read, or are of another clip; when no reading of the tool's
/// numbers agrees with the masks.
pub(crate) fn capture(
    tool: &Tool,
    found: &ToolOutput,
    source: &Path,
    options: &Options,
) -> Result<Imported, ImportError> {
    let at = options.poses.as_deref().unwrap_or(source);
    let mut notes = vec![summary(tool, found)];
    let found = &found.joined(&mut notes);
    notes.extend(found.notes.iter().cloned());
    let clip = if options.poses.is_some() {
        Clip::open(source, options)?
    } else {
        let inside = clip_in(source)?;
        notes.push(format!("the clip: {}", inside.display()));
        Clip::open(&inside, options)?
    };
    notes.extend(clip.notes.iter().cloned());
    ensure_size(found, &clip, at, tool)?;
    clip.selected(options)?;
    let numbers = Numbers::find(found, &clip, at, &mut notes)?;
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
        None => Masks::find(options.masks.as_deref(), found, &clip)?,
    };
    let choice = ImportChoice::find(
        &tool.documented,
        found,
        &masks,
        numbers,
        &clip,
        at,
        options,
        &mut notes,
    )?;
    let mut capture = imported(&choice, numbers, &clip, at, options, notes)?;
    capture.track.distortion = found.distortion;
    capture.found.doubts.extend(clip.notes.iter().cloned());
    if found.people.len() > 1 && options.person.is_none() {
        let taken = &choice.person.name;
        capture.found.doubts.push(format!(
            "person {taken} of {} is taken: --person names another",
            found.people.len()
        ));
    }
    if masks.is_empty() {
        let unproven = "there are no masks, so nothing proves the poses (--masks)";
        capture.found.doubts.push(unproven.to_owned());
    }
    Ok(capture)
}

/// `4D-Humans (PHALP): 2 people, 301 frames`.
fn summary(tool: &Tool, found: &ToolOutput) -> String {
    let people = match found.people.len() {
        1 => "1 person".to_owned(),
        many => format!("{many} people"),
    };
    let poses = found.people.iter().flat_map(|person| &person.seen);
    let frames: std::collections::BTreeSet<usize> = poses.map(|seen| seen.number).collect();
    format!(
        "{}: {people}, {} frames",
        tool.documented.tool,
        frames.len()
    )
}

/// The video of a tool's folder, if there is one alone.
fn clip_in(source: &Path) -> Result<PathBuf, ImportError> {
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

fn ensure_size(found: &ToolOutput, clip: &Clip, at: &Path, tool: &Tool) -> Result<(), ImportError> {
    let Some(size) = found.size else {
        return Ok(());
    };
    if ratio(size, clip.size.map(f64::from)).is_some() {
        return Ok(());
    }
    let message = format!(
        "{} saw images of {:.0}x{:.0}, the clip has {}x{}: was it cut or turned?",
        tool.documented.tool, size[0], size[1], clip.size[0], clip.size[1]
    );
    Err(fault(at, "SIZE_MISMATCH", message))
}
/// The capture of the chosen person.
fn imported(
    choice: &ImportChoice<'_>,
    numbers: Numbers,
    clip: &Clip,
    at: &Path,
    options: &Options,
    mut notes: Vec<String>,
) -> Result<Imported, ImportError> {
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
        if let Some(world) = &seen.camera_pose {
            (camera, placed) = world.move_to_world(camera, placed);
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
    let fps = options.fps_or(clip.fps, &mut notes);
    let mut track = empty_track(smpl_skeleton(choice.rest.joints.clone()), clip.size, fps);
    let indices: Vec<usize> = frames.keys().copied().collect();
    let masks;
    (track.frames, masks) = frames.into_values().unzip();
    Ok(Imported {
        track,
        pictures: clip.pictures(&indices, masks),
        available: clip.frames,
        notes,
        found: crate::Findings::default(),
    })
}

/// Changes the focal length, and with it the distance, so that the body stays where it is seen.
fn refocus(camera: &mut Camera, placed: &mut WorldPose, focal: f64) {
    let by = focal / camera.k[0][0];
    camera.k[0][0] *= by;
    camera.k[1][1] *= by;
    let rotation: Mat3 = std::array::from_fn(|i| std::array::from_fn(|j| camera.e[i][j]));
    let shift: Vec3 = std::array::from_fn(|i| camera.e[i][3]);
    let mut seen = add(matvec(&rotation, placed.root), shift);
    seen[2] *= by;
    placed.root = matvec(&transpose(&rotation), sub(seen, shift));
}
