//! Which frame of the clip each of a tool's frames is.

use super::tool::{Found, Seen};
use crate::clip::{Clip, fault};
use std::path::Path;
use yoto_client::ClientError;
use yoto_terminal::progress::count;

/// Frames by which a tool's count may differ from the clip's: decoders disagree about the last ones.
const SLACK: usize = 2;
/// The rate that tools convert clips to.
const COMMON: f64 = 30.0;

/// Numbers of frames are below this; longer ones in names are dates.
const MOST: usize = 1_000_000_000;

/// The last number in a file's name.
pub(super) fn number_in(name: &str) -> Option<usize> {
    let stem = Path::new(name).file_stem()?.to_str()?;
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let head = stem.get(..end)?;
    let start = head
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |at| at + 1);
    let number = head.get(start..)?.parse().ok();
    number.filter(|number| *number < MOST)
}

/// How a tool's frames become the clip's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Numbers {
    /// By the names of the pictures.
    Names,
    /// Less a first number.
    From(usize),
    /// Of a copy with another rate: times the ratio of the rates.
    Times(f64),
}

impl Numbers {
    /// The rule for `found`, with notes about what it assumes.
    ///
    /// # Errors
    /// When the tool's clip is another one.
    pub fn find(
        found: &Found,
        clip: &Clip,
        at: &Path,
        notes: &mut Vec<String>,
    ) -> Result<Self, ClientError> {
        let seen = || found.people.iter().flat_map(|person| &person.seen);
        let named = |seen: &Seen| {
            seen.image
                .as_ref()
                .is_some_and(|name| clip.named(name).is_some())
        };
        if seen().all(named) {
            return Ok(Self::Names);
        }
        let last = seen().map(|seen| seen.number).max().unwrap_or_default();
        let first = seen().map(|seen| seen.number).min().unwrap_or_default();
        let count = found.frames.unwrap_or(last + 1);
        if let Some(fps) = clip.fps.filter(|_| count.abs_diff(clip.frames) > SLACK) {
            let converted = clip.frames as f64 * COMMON / fps;
            if found.frames.is_some() && (converted - count as f64).abs() <= 1.0 + 0.01 * converted
            {
                notes.push(format!(
                    "the poses are of a copy of {COMMON} frames a second ({count} frames), the clip has \
                     {fps:.3} ({}): each pose goes to the frame nearest in time",
                    clip.frames
                ));
                return Ok(Self::Times(fps / COMMON));
            }
        }
        if last == clip.frames && first > 0 {
            notes.push("the tool counts frames from 1".to_owned());
            return Ok(Self::From(1));
        }
        if last >= clip.frames + SLACK {
            let message = format!(
                "a pose of frame {last}, but {} has {} frames: is this the clip that the tool saw?",
                clip.path().display(),
                clip.frames
            );
            return Err(fault(at, "SIZE_MISMATCH", message));
        }
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
    pub fn frame(self, seen: &Seen, clip: &Clip, shift: i64) -> Option<usize> {
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

/// Runs of numbers for people: `3, 7–9`.
fn runs(numbers: &[usize]) -> String {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for &number in numbers {
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == number => *last = number,
            _ => runs.push((number, number)),
        }
    }
    let named = runs.iter().take(8).map(|(first, last)| {
        if first == last {
            first.to_string()
        } else {
            format!("{first}–{last}")
        }
    });
    let mut text = named.collect::<Vec<_>>().join(", ");
    if runs.len() > 8 {
        text += ", …";
    }
    text
}

/// Tells which of `frames` lack something.
pub(crate) fn left_out(
    frames: &[usize],
    what: &str,
    has: impl Fn(&usize) -> bool,
    notes: &mut Vec<String>,
) {
    let without: Vec<usize> = frames.iter().copied().filter(|frame| !has(frame)).collect();
    if !without.is_empty() {
        notes.push(format!(
            "left out: {} without {what} ({})",
            count(without.len(), "frame"),
            runs(&without)
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_the_last_of_a_name() {
        assert_eq!(number_in("out/demo_2/frame_000012.jpg"), Some(12));
        assert_eq!(number_in("00001.json"), Some(1));
        assert_eq!(number_in("12b.png"), Some(12));
        assert_eq!(number_in("video.npz"), None);
        assert_eq!(number_in("20240131235959000.png"), None);
    }

    #[test]
    fn runs_are_short() {
        assert_eq!(runs(&[3, 7, 8, 9]), "3, 7–9");
        let many: Vec<usize> = (0..100).step_by(2).collect();
        assert!(runs(&many).ends_with("14, …"));
    }
}
