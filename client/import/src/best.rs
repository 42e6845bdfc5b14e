//! The best frames of a clip to train on: those that differ most in pose and view, the sharp ones first.
//!
//! Frames are taken one by one, each the farthest from all that were taken, by `pose`, times its
//! `sharpness` among the frames around it. So a still pose is taken once, from its sharpest frame,
//! before anything is taken twice.

mod pictures;
mod pose;
mod select;
mod sharpness;

use crate::{ImportError, Imported, Pictures};
use std::num::NonZeroUsize;
use std::path::Path;

/// Keeps the `count` best frames of `imported`, in their order, and notes it. All pictures are
/// decoded, one at a time; videos other than H.264 in MP4 or MOV by the program `ffmpeg`, which is
/// searched for when it has no name. `progress` receives frames done and all frames.
///
/// # Errors
/// [`ImportError::BadCapture`] when a picture or mask can't be decoded or has another size,
/// [`ImportError::File`] when the file system fails.
pub fn choose(
    imported: &mut Imported,
    count: NonZeroUsize,
    ffmpeg: Option<&Path>,
    progress: impl FnMut(usize, usize),
) -> Result<(), ImportError> {
    let (count, total) = (count.get(), imported.track.frames.len());
    if count >= total {
        imported.notes.push(format!(
            "the best {count} frames are asked for, and there are {total}: all are taken"
        ));
        return Ok(());
    }
    let sharp = pictures::sharpness(imported, ffmpeg, progress)?;
    let skeleton = &imported.track.skeleton;
    let frames = imported.track.frames.iter();
    let poses: Vec<Vec<f64>> = frames
        .map(|frame| pose::features(skeleton, frame))
        .collect();
    let taken = select::farthest(&poses, &sharpness::among_neighbours(&sharp), count);
    keep(&mut imported.track.frames, &taken);
    match &mut imported.pictures {
        Pictures::Files(files) => keep(files, &taken),
        Pictures::Video { masks, .. } | Pictures::Decoded { masks, .. } => keep(masks, &taken),
        Pictures::Capture(frames) => keep(&mut frames.positions, &taken),
    }
    imported.notes.push(format!(
        "{count} of {total} frames are taken, by pose, view and sharpness"
    ));
    Ok(())
}

/// Keeps the entries that are marked in `taken`.
fn keep<T>(entries: &mut Vec<T>, taken: &[bool]) {
    let mut marks = taken.iter();
    entries.retain(|_| marks.next().copied().unwrap_or(false));
}

#[cfg(test)]
mod tests;
