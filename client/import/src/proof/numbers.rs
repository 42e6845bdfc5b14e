//! The map from a tool's frames to the clip's frames.

use super::found::{PoseEstimate, ToolOutput};
use crate::ImportError;
use crate::clip::{Clip, FrameNumbering, beyond, fault, too_far};
use std::path::Path;

/// A tool may count this many frames more or fewer than the clip has: decoders disagree about the last ones.
const SLACK: usize = 2;
/// The rate that tools convert clips to.
const COMMON: f64 = 30.0;

/// The rule that maps a tool's frames to the clip's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Numbers {
    /// By the names of the pictures.
    Names,
    /// The file counts from this number.
    From(usize),
    /// The tool saw a copy with another frame rate: numbers are multiplied by the ratio of the rates.
    Times(f64),
}

impl Numbers {
    /// The rule for `found`, with notes about what it assumes.
    ///
    /// # Errors
    /// When the tool saw another clip.
    pub(crate) fn find(
        found: &ToolOutput,
        clip: &Clip,
        at: &Path,
        notes: &mut Vec<String>,
    ) -> Result<Self, ImportError> {
        let seen = || found.people.iter().flat_map(|person| &person.seen);
        let named = |seen: &PoseEstimate| {
            seen.image
                .as_ref()
                .is_some_and(|name| clip.named(name).is_some())
        };
        if seen().all(named) {
            return Ok(Self::Names);
        }
        let last = seen().map(|seen| seen.number).max().unwrap_or_default();
        let first = seen().map(|seen| seen.number).min();
        let count = found.frames.unwrap_or(last + 1);
        if let Some(fps) = clip.fps.filter(|_| count.abs_diff(clip.frames) > SLACK) {
            let converted = clip.frames as f64 * COMMON / fps;
            if found.frames.is_some() && (converted - count as f64).abs() <= 1.0 + 0.01 * converted
            {
                notes.push(format!(
                    "the poses are of a copy of {COMMON} frames per second ({count} frames), the clip has \
                     {fps:.3} ({}): each pose goes to the frame nearest in time",
                    clip.frames
                ));
                return Ok(Self::Times(fps / COMMON));
            }
        }
        let counting = FrameNumbering::of(seen().map(|seen| seen.number), clip.frames, 0);
        if last == clip.frames && counting.first > 0 {
            notes.push("the tool counts frames from 1".to_owned());
            return Ok(Self::From(1));
        }
        if first == Some(1) && !counting.is_sure {
            notes.push(
                "the first pose is of frame 1: frames are counted from 0, as the tool documents; masks tell \
                 (--masks)"
                    .to_owned(),
            );
        }
        if last >= too_far(clip.frames) {
            let message = format!(
                "a pose of frame {last}, but {} has {} frames: is this the clip that the tool saw?",
                clip.path().display(),
                clip.frames
            );
            return Err(fault(at, "SIZE_MISMATCH", message));
        }
        let poses = seen().filter(|seen| seen.number >= clip.frames);
        let numbers: std::collections::BTreeSet<usize> = poses.map(|seen| seen.number).collect();
        notes.extend(beyond("poses", numbers.len(), clip.frames));
        if found.frames.is_some() && count != clip.frames {
            notes.push(format!(
                "the tool's clip has {count} frames, this one {}: their first frames are taken to be \
                 the same",
                clip.frames
            ));
        }
        Ok(Self::From(0))
    }

    /// The frame of `seen`, `shift` frames later; `None` outside of the clip.
    pub(crate) fn frame(self, seen: &PoseEstimate, clip: &Clip, shift: i64) -> Option<usize> {
        let frame = match self {
            Self::Names => clip.named(seen.image.as_deref()?)?,
            Self::From(first) => seen.number.checked_sub(first)?,
            Self::Times(ratio) => {
                let frame = (seen.number as f64 * ratio).round();
                // Of several poses for one frame, the nearest in time.
                let nearest = (frame / ratio).round() as usize;
                (ratio >= 1.0 || nearest == seen.number).then_some(frame as usize)?
            }
        };
        let frame = usize::try_from(i64::try_from(frame).ok()? + shift).ok()?;
        (frame < clip.frames).then_some(frame)
    }
}
