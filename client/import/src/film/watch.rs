//! Runs the pose model on the frames of a clip.

use super::parts::PartModels;
use crate::clip::{Clip, fault, for_each};
use crate::matting::png;
use crate::{ImportError, Progress, Stage};
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use yoto_landmarks::{BodySquare, PersonLandmarks, Watcher};
use yoto_pose::{FrameKeyPoints, KeyPointSet, patches};

/// Least visibility of a seen point.
const VISIBLE: f32 = 0.5;
/// Fewest seen points of a frame: with fewer, more of the body is guessed than seen.
const FEWEST: usize = 8;

/// A frame that shows the person.
pub(super) struct Watched {
    /// The frame's number.
    pub index: usize,
    pub points: FrameKeyPoints,
    /// A grey PNG of coverage.
    pub mask: Arc<[u8]>,
    /// Place, size and colours of the body.
    pub figure: Option<BodySquare>,
    pub scene: Scene,
}

/// Cells of a picture across and down.
const CELLS: [usize; 2] = [16, 9];

/// A picture in few numbers, to tell scenes apart: the green channel in the middle of each cell.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Scene(Vec<u8>);

impl Scene {
    fn of(rgb: &[u8], [width, height]: [usize; 2]) -> Self {
        let places = (0..CELLS[1]).flat_map(|y| (0..CELLS[0]).map(move |x| [x, y]));
        let level = |[x, y]: [usize; 2]| {
            let (column, row) = (
                (2 * x + 1) * width / (2 * CELLS[0]),
                (2 * y + 1) * height / (2 * CELLS[1]),
            );
            rgb.get((row * width + column) * 3 + 1).copied()
        };
        Self(places.filter_map(level).collect())
    }

    /// Mean difference of levels.
    pub(super) fn differs(&self, other: &Self) -> f32 {
        let pairs = self.0.iter().zip(&other.0);
        let sum: u32 = pairs.map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
        sum as f32 / self.0.len().max(1) as f32
    }
}

/// Most frames that wait between two stages: enough to keep both busy, in little memory.
const AHEAD: usize = 2;

/// A decoded frame, `[height, width, 3]`.
struct Decoded {
    index: usize,
    rgb: Arc<Vec<u8>>,
}

/// A frame that shows the person, as decoded or as a copy of the one before.
enum Sighting {
    New(Decoded, Box<PersonLandmarks>),
    /// A copy of the frame before, which shows the person.
    Again(usize),
}

/// Searches the frames `wanted` for the person that `watcher` follows, and for their hands and face by `parts`.
pub(super) fn watch(
    watcher: &mut Watcher,
    parts: &mut PartModels,
    clip: &Clip,
    wanted: &[usize],
    progress: &Progress,
) -> Result<Vec<Watched>, ImportError> {
    let size = clip.size.map(|side| side as usize);
    watch_with(clip, wanted, progress, parts, |frame, rgb| {
        let seen = watcher.look(frame, rgb, size);
        seen.map_err(|error| fault(clip.path(), "UNDECODABLE", error.to_string()))
    })
}

/// Passes the frames `wanted` through three stages, each in order and on a thread of its own: decoding, `look`, and what
/// needs the person's place (hands, face, mask, colours). Only `look` depends on the frame before, since it expects the person where they were.
fn watch_with(
    clip: &Clip,
    wanted: &[usize],
    progress: &Progress,
    parts: &mut PartModels,
    look: impl FnMut(usize, &[u8]) -> Result<Option<PersonLandmarks>, ImportError>,
) -> Result<Vec<Watched>, ImportError> {
    let running = progress.start(Stage::People);
    let (decoded, frames) = sync_channel(AHEAD);
    let (found, unfinished) = sync_channel(AHEAD);
    thread::scope(|scope| {
        let decoding = scope.spawn(move || decode(clip, wanted, &decoded));
        let finishing = scope.spawn(move || finish(clip, parts, &unfinished));
        let done = |done| running.count(done, wanted.len());
        let looked = look_at(frames, &found, look, done);
        drop(found);
        let decoded = decoding.join().unwrap_or_else(|panic| resume_unwind(panic));
        let finished = finishing
            .join()
            .unwrap_or_else(|panic| resume_unwind(panic));
        // A stage that fails ends those before it, so the fault of the last one is the cause.
        let watched = finished?;
        looked?;
        decoded?;
        Ok(watched)
    })
}

fn decode(clip: &Clip, wanted: &[usize], decoded: &SyncSender<Decoded>) -> Result<(), ImportError> {
    for_each(clip, wanted, |index, rgb| {
        let rgb = Arc::new(rgb.to_vec());
        pass_on(clip, decoded, Decoded { index, rgb })
    })
}

/// Gives `it` to the next stage.
fn pass_on<T>(clip: &Clip, to: &SyncSender<T>, it: T) -> Result<(), ImportError> {
    let ended = |_| {
        fault(
            clip.path(),
            "INTERNAL",
            "the search for the person has ended",
        )
    };
    to.send(it).map_err(ended)
}

/// Looks at each frame that differs from the one before. `done` receives the number of frames so far.
fn look_at(
    frames: Receiver<Decoded>,
    found: &SyncSender<Sighting>,
    mut look: impl FnMut(usize, &[u8]) -> Result<Option<PersonLandmarks>, ImportError>,
    mut done: impl FnMut(usize),
) -> Result<(), ImportError> {
    let mut last: Option<(Arc<Vec<u8>>, bool)> = None;
    for (number, frame) in frames.into_iter().enumerate() {
        done(number);
        let before = last.as_ref().filter(|(rgb, _)| *rgb == frame.rgb);
        let passed = if let Some((_, is_found)) = before {
            is_found.then(|| Sighting::Again(frame.index))
        } else {
            let seen = look(frame.index, &frame.rgb)?.filter(is_seen);
            last = Some((frame.rgb.clone(), seen.is_some()));
            seen.map(|seen| Sighting::New(frame, Box::new(seen)))
        };
        // The next stage ends early only by a fault of its own.
        if let Some(passed) = passed
            && found.send(passed).is_err()
        {
            return Ok(());
        }
    }
    Ok(())
}

/// Hands, face, masks and colours of the frames with the person.
fn finish(
    clip: &Clip,
    parts: &mut PartModels,
    found: &Receiver<Sighting>,
) -> Result<Vec<Watched>, ImportError> {
    let size = clip.size.map(|side| side as usize);
    let mut watched: Vec<Watched> = Vec::new();
    for found in found {
        let next = match found {
            Sighting::New(Decoded { index, rgb }, seen) => {
                let mut points = key_points(index as u32, &seen);
                parts.look(&rgb, size, &seen, &mut points);
                points.colours = patches(KeyPointSet::BlazePose33, &points, &rgb, size);
                let mask = png(&seen.outline.coverage(), clip)?;
                Some(Watched {
                    index,
                    points,
                    mask,
                    figure: seen.figure,
                    scene: Scene::of(&rgb, size),
                })
            }
            Sighting::Again(index) => watched.last().map(|last| last.again(index)),
        };
        watched.extend(next);
    }
    Ok(watched)
}

impl Watched {
    /// A copy for the frame `index`.
    fn again(&self, index: usize) -> Self {
        Self {
            index,
            points: FrameKeyPoints {
                index: index as u32,
                ..self.points.clone()
            },
            mask: self.mask.clone(),
            figure: self.figure,
            scene: self.scene.clone(),
        }
    }
}

fn is_seen(seen: &PersonLandmarks) -> bool {
    let visible = seen.picture.iter().filter(|point| point[3] >= VISIBLE);
    visible.count() >= FEWEST
}

fn key_points(index: u32, seen: &PersonLandmarks) -> FrameKeyPoints {
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
        ..FrameKeyPoints::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use yoto_landmarks::Outline;

    fn seen(visible: usize) -> PersonLandmarks {
        let mut picture = [[1.0, 2.0, 3.0, 0.1]; 33];
        for point in picture.iter_mut().take(visible) {
            point[3] = 0.9;
        }
        PersonLandmarks {
            picture,
            space: [[0.1, 0.2, 0.3, 0.9]; 33],
            outline: Outline::nobody([2, 1]),
            score: 1.0,
            figure: None,
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

    /// A clip of pictures of one colour each, 2 x 1 pixels.
    fn clip(folder: &Path, levels: &[u8]) -> Clip {
        for (frame, level) in levels.iter().enumerate() {
            let picture = image::RgbImage::from_pixel(2, 1, image::Rgb([*level; 3]));
            let path = folder.join(format!("{frame}.png"));
            picture.save(path).expect("a picture");
        }
        Clip::open(folder, &crate::Options::default()).expect("a clip")
    }

    /// The frames `wanted` with the landmarks that `look` finds in their pictures, without models of hands and face.
    fn watch_by(
        clip: &Clip,
        wanted: &[usize],
        mut look: impl FnMut(&[u8]) -> Result<Option<PersonLandmarks>, ImportError>,
    ) -> Result<Vec<Watched>, ImportError> {
        let (progress, mut parts) = (Progress::default(), PartModels::default());
        watch_with(clip, wanted, &progress, &mut parts, |_, rgb| look(rgb))
    }

    #[test]
    fn frames_keep_their_order_and_repeats_are_not_looked_at() {
        let folder = tempfile::tempdir().expect("a folder");
        // Nobody is in the frames of level 0.
        let levels = [10, 10, 20, 0, 0, 10, 30, 40, 40, 50];
        let clip = clip(folder.path(), &levels);
        let wanted: Vec<usize> = (0..levels.len()).collect();
        let mut looked = Vec::new();
        let watched = watch_by(&clip, &wanted, |rgb| {
            looked.push(rgb[0]);
            let mut seen = seen(33);
            seen.picture[0][0] = f32::from(rgb[0]);
            Ok((rgb[0] > 0).then_some(seen))
        });
        let watched = watched.expect("frames");
        assert_eq!(looked, [10, 20, 0, 10, 30, 40, 50]);
        let frames = watched
            .iter()
            .map(|it| (it.index, it.points.picture[0][0] as u8));
        let expected = [
            (0, 10),
            (1, 10),
            (2, 20),
            (5, 10),
            (6, 30),
            (7, 40),
            (8, 40),
            (9, 50),
        ];
        assert_eq!(frames.collect::<Vec<_>>(), expected);
        assert!(
            watched
                .iter()
                .all(|it| it.points.index as usize == it.index)
        );
    }

    #[test]
    fn a_fault_of_any_stage_ends_the_others() {
        let folder = tempfile::tempdir().expect("a folder");
        let levels: Vec<u8> = (1..40).collect();
        let clip = clip(folder.path(), &levels);
        let wanted: Vec<usize> = (0..levels.len()).collect();
        let mut looked = 0;
        let failed = watch_by(&clip, &wanted, |_| {
            looked += 1;
            Err(fault(clip.path(), "UNDECODABLE", "a strange picture"))
        });
        let error = failed.err().expect("a fault").to_string();
        assert!(
            error.contains("a strange picture") && looked == 1,
            "{error}"
        );
        let absent = watch_by(&clip, &[3, 99], |_| Ok(Some(seen(33))));
        let error = absent.err().expect("a fault").to_string();
        assert!(error.contains("a picture was taken away"), "{error}");
    }
}
