//! The result of all readers: the people of every frame and their points.

use crate::ImportError;
use crate::clip::{Clip, FrameNumbering, fault};
use crate::geometry::Vec3;
use crate::hierarchy::{GlobalPose, JointHierarchy};
use crate::source::{Part, is_number};
use std::path::Path;
use std::sync::Arc;
use yoto_formats::rle::RunLengths;
use yoto_pose::{FacePoints, HandPoints, KeyPointSet};

/// Points above this confidence locate a person.
pub(super) const SURE: f64 = 0.3;
/// This number of frames beyond the clip's last is left out without a note: decoders disagree about the last
/// frames.
const SLACK: usize = 2;

/// A note names at most this number of frames.
const NAMED: usize = 8;

/// One person in one frame.
#[derive(Clone, Debug)]
pub(super) struct Detection {
    /// The detector's number for the person, if it follows people.
    pub person: Option<String>,
    /// `[N]`: x and y in pixels from the picture's corner, confidence.
    pub picture: Vec<[f64; 3]>,
    /// `[N]`, metres in the camera's axes; empty without depths.
    pub space: Vec<Vec3>,
    /// The person's mask, if the detector wrote one.
    pub mask: Option<Arc<RunLengths>>,
    /// The detector's own skeleton, if it has one.
    pub own: Option<OwnPose>,
    /// All points of the left and the right hand with depths, if the detector looks at hands.
    pub hands: [Option<HandPoints>; 2],
    /// The face, if the detector looks at faces.
    pub face: Option<FacePoints>,
}

/// A skeleton of the detector's own in one frame.
#[derive(Clone, Debug)]
pub(super) struct OwnPose {
    /// In the camera's axes, metres; the joints of [`Detections::hierarchy`].
    pub placed: GlobalPose,
    /// Focal length of the frame's camera, pixels; its axis is in the middle of the picture.
    pub focal: f64,
}

impl Detection {
    /// The box around the sure points, x0, y0, x1, y1.
    pub(super) fn bounds(&self) -> Option<[f64; 4]> {
        let sure = || self.picture.iter().filter(|point| point[2] > SURE);
        sure().next()?;
        let least = |axis: usize| sure().map(|point| point[axis]).fold(f64::MAX, f64::min);
        let most = |axis: usize| sure().map(|point| point[axis]).fold(f64::MIN, f64::max);
        Some([least(0), least(1), most(0), most(1)])
    }
}

/// The people of one frame.
#[derive(Clone, Debug)]
pub(super) struct FrameDetections {
    /// Number of the frame, from 0 unless [`Detections::first`] says otherwise.
    pub number: usize,
    /// The picture's name, if the file has it.
    pub image: Option<String>,
    pub people: Vec<Detection>,
}

/// The contents of a detector's files.
#[derive(Clone, Debug)]
pub(super) struct Detections {
    /// The detector's name.
    pub name: &'static str,
    pub set: KeyPointSet,
    /// In the order of their numbers.
    pub frames: Vec<FrameDetections>,
    /// Number of the first frame, if the detector always counts from it.
    pub first: Option<usize>,
    /// Number of the first frame as most files of the detector have it, if they differ.
    pub usual: usize,
    /// Focal length that the points in space belong to, pixels.
    pub focal: Option<f64>,
    /// The joints of the detector's own skeleton, if it has one.
    pub hierarchy: Option<JointHierarchy>,
    /// Names of two files of different takes that have a frame's number in common, if there are any.
    pub clash: Option<[String; 2]>,
    /// Numbers of people who were joined, with the number that each goes by.
    pub other_ids: Vec<(String, String)>,
    /// Assumptions about the files.
    pub notes: Vec<String>,
}

impl Detections {
    /// Detections from frames in any order.
    pub(super) fn new(
        name: &'static str,
        set: KeyPointSet,
        mut frames: Vec<FrameDetections>,
    ) -> Self {
        frames.sort_by_key(|frame| frame.number);
        Self {
            name,
            set,
            frames,
            first: Some(0),
            usual: 0,
            focal: None,
            hierarchy: None,
            clash: None,
            other_ids: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Points with numbers that are not finite count as unseen, and depths with such numbers as none, with a note.
    pub(super) fn sieve(&mut self) {
        let (mut points, mut depths, mut frames) = (0, 0, Vec::new());
        for seen in &mut self.frames {
            let earlier = (points, depths);
            for person in &mut seen.people {
                for point in &mut person.picture {
                    if !point.iter().all(|value| is_number(*value)) {
                        *point = [0.0; 3];
                        points += 1;
                    }
                }
                if !person
                    .space
                    .as_flattened()
                    .iter()
                    .all(|value| is_number(*value))
                {
                    person.space.clear();
                    depths += 1;
                }
            }
            if earlier != (points, depths) {
                frames.push(seen.number.to_string());
            }
        }
        if !frames.is_empty() {
            let more = if frames.len() > NAMED { ", …" } else { "" };
            frames.truncate(NAMED);
            self.notes.push(format!(
                "not finite: {points} points, which count as unseen, and the depths of {depths} poses, in frames {}{more}",
                frames.join(", ")
            ));
        }
    }

    /// The numbering of the frames; `None` where the pictures' names identify the frames.
    pub(super) fn counting(&self, clip: &Clip) -> Option<FrameNumbering> {
        let named = |seen: &FrameDetections| clip.named(seen.image.as_deref()?);
        if self.frames.iter().all(|seen| named(seen).is_some()) {
            return None;
        }
        Some(match self.first {
            Some(first) => FrameNumbering {
                first,
                is_sure: true,
            },
            None => {
                let numbers = self.frames.iter().map(|seen| seen.number);
                FrameNumbering::of(numbers, clip.frames, self.usual)
            }
        })
    }

    /// The clip's frame of each frame, by the pictures' names or by the numbers, which count from `first`; `None`
    /// beyond the clip.
    ///
    /// # Errors
    /// When the numbers belong to another clip.
    pub(super) fn numbers(
        &self,
        first: Option<usize>,
        clip: &Clip,
        at: &Path,
    ) -> Result<Vec<Option<usize>>, ImportError> {
        let Some(first) = first else {
            let named = |seen: &FrameDetections| clip.named(seen.image.as_deref()?);
            return Ok(self.frames.iter().map(named).collect());
        };
        let last = self.frames.last().map_or(0, |seen| seen.number);
        if last >= clip.frames + first + SLACK {
            let message = format!(
                "points of frame {last}, but {} has {} frames: is this the clip that {} saw?",
                clip.path().display(),
                clip.frames,
                self.name
            );
            return Err(fault(at, "SIZE_MISMATCH", message));
        }
        let number = |seen: &FrameDetections| {
            let number = seen.number.checked_sub(first)?;
            (number < clip.frames).then_some(number)
        };
        Ok(self.frames.iter().map(number).collect())
    }
}

/// The first `N` of flat x, y, confidence, of pixels counted from the first pixel's centre.
pub(super) fn flat(part: &Part<'_>, wanted: usize) -> Result<Vec<[f64; 3]>, ImportError> {
    let array = part.unchecked()?;
    if array.shape.iter().filter(|side| **side != 1).count() > 1 {
        return Err(part.fault("SIZE_MISMATCH", "rows instead of numbers in a row"));
    }
    let values = array.values;
    let (points, rest) = values.as_chunks::<3>();
    if !rest.is_empty() || points.len() < wanted {
        let message = format!(
            "{} numbers: {wanted} points of x, y and confidence are needed",
            values.len()
        );
        return Err(part.fault("SIZE_MISMATCH", message));
    }
    Ok(points
        .iter()
        .take(wanted)
        .map(|&point| from_centre(point))
        .collect())
}

/// A point whose pixels are counted from the first pixel's centre, from the corner instead.
/// Detectors write zeros for what they don't see, and scores of heat maps that pass 1.
pub(super) fn from_centre([x, y, confidence]: [f64; 3]) -> [f64; 3] {
    [x + 0.5, y + 0.5, confidence.clamp(0.0, 1.0)]
}

/// A whole number from 0 on.
pub(super) fn whole(part: &Part<'_>) -> Result<usize, ImportError> {
    let number = part.number()?;
    if number >= 0.0 && number.fract() == 0.0 {
        return Ok(number as usize);
    }
    Err(part.fault("OUT_OF_RANGE", format!("{number} is not a frame number")))
}

/// The numbers in a file's name, without its ending.
pub(super) fn numbers_in(name: &str) -> Vec<usize> {
    let stem = Path::new(name).file_stem().and_then(|stem| stem.to_str());
    let digits = stem
        .unwrap_or_default()
        .split(|c: char| !c.is_ascii_digit());
    digits.filter_map(|digits| digits.parse().ok()).collect()
}
