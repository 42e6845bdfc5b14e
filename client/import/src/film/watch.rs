//! What the pose model sees in the frames of a clip.

use crate::clip::{Clip, fault, for_each};
use crate::matting::png;
use std::sync::Arc;
use yoto_client::ClientError;
use yoto_landmarks::{PoseModel, Seen, Watcher};
use yoto_pose::{FrameKeyPoints, KeyPointSet, patches};
use yoto_terminal::progress::ProgressDisplay;

/// Visibility from which on a point counts as seen.
const VISIBLE: f32 = 0.5;
/// Fewest seen points of a frame: with fewer, more of the body is guessed than seen.
const FEWEST: usize = 8;

/// A frame in which the person was found.
pub(super) struct Watched {
    /// The frame's number.
    pub index: usize,
    pub points: FrameKeyPoints,
    /// A grey PNG of coverage.
    pub mask: Arc<[u8]>,
}

/// Looks for the person in the frames `wanted`.
pub(super) fn watch(
    model: PoseModel,
    clip: &Clip,
    wanted: &[usize],
) -> Result<Vec<Watched>, ClientError> {
    let mut watcher = Watcher::new(model);
    let mut display = ProgressDisplay::new("people");
    let mut watched = Vec::new();
    let mut done = 0;
    let size = clip.size.map(|side| side as usize);
    for_each(clip, wanted, |index, rgb| {
        display.count("frame", done, wanted.len());
        done += 1;
        let seen = watcher.look(rgb, size);
        let seen = seen.map_err(|error| fault(clip.path(), "UNDECODABLE", error.to_string()))?;
        if let Some(seen) = seen.filter(is_seen) {
            let mut points = key_points(index as u32, &seen);
            points.colours = patches(KeyPointSet::BlazePose33, &points, rgb, size);
            watched.push(Watched {
                index,
                points,
                mask: png(&seen.mask, clip)?,
            });
        }
        Ok(())
    })?;
    display.clear();
    Ok(watched)
}

fn is_seen(seen: &Seen) -> bool {
    let visible = seen.picture.iter().filter(|point| point[3] >= VISIBLE);
    visible.count() >= FEWEST
}

fn key_points(index: u32, seen: &Seen) -> FrameKeyPoints {
    let picture = seen.picture.iter();
    let space = seen.space.iter();
    FrameKeyPoints {
        index,
        picture: picture
            .map(|&[x, y, _, visibility]| [x, y, visibility].map(f64::from))
            .collect(),
        space: space
            .map(|&[x, y, z, _]| [x, y, z].map(f64::from))
            .collect(),
        colours: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(visible: usize) -> Seen {
        let mut picture = [[1.0, 2.0, 3.0, 0.1]; 33];
        for point in picture.iter_mut().take(visible) {
            point[3] = 0.9;
        }
        Seen {
            picture,
            space: [[0.1, 0.2, 0.3, 0.9]; 33],
            mask: Vec::new(),
            score: 1.0,
        }
    }

    #[test]
    fn a_body_that_is_mostly_guessed_is_not_seen() {
        assert!(is_seen(&seen(FEWEST)));
        assert!(!is_seen(&seen(FEWEST - 1)));
    }

    #[test]
    fn key_points_have_visibility_as_confidence() {
        let points = key_points(7, &seen(1));
        assert_eq!(points.index, 7);
        assert_eq!(points.picture.len(), 33);
        assert_eq!(points.picture[0], [1.0, 2.0, f64::from(0.9f32)]);
        assert_eq!(points.space[5], [0.1f32, 0.2, 0.3].map(f64::from));
    }
}
