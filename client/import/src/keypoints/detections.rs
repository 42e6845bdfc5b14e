//! What all readers give: the people of every frame, and where their points are.

use crate::clip::{Clip, fault};
use crate::geometry::Vec3;
use crate::source::Part;
use crate::tree::{Placed, Tree};
use std::path::Path;
use std::sync::Arc;
use yoto_client::ClientError;
use yoto_formats::rle::RunLengths;
use yoto_pose::KeyPointSet;

/// Points of a higher confidence show where a person is.
pub(super) const SURE: f64 = 0.3;
/// Frames beyond the clip's last that are left out without a note: decoders disagree about the last
/// ones.
const SLACK: usize = 2;

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
}

/// A skeleton of the detector's own in one frame.
#[derive(Clone, Debug)]
pub(super) struct OwnPose {
    /// In the camera's axes, metres; the joints of [`Detections::tree`].
    pub placed: Placed,
    /// Focal length of the frame's camera, pixels; its axis is in the middle of the picture.
    pub focal: f64,
}

impl Detection {
    /// The box around the sure points, x0, y0, x1, y1.
    pub fn bounds(&self) -> Option<[f64; 4]> {
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
    /// Focal length that the points in space belong to, pixels.
    pub focal: Option<f64>,
    /// The joints of the detector's own skeleton, if it has one.
    pub tree: Option<Tree>,
}

impl Detections {
    /// Of frames in any order.
    pub fn new(name: &'static str, set: KeyPointSet, mut frames: Vec<FrameDetections>) -> Self {
        frames.sort_by_key(|frame| frame.number);
        Self {
            name,
            set,
            frames,
            first: Some(0),
            focal: None,
            tree: None,
        }
    }

    /// The clip's frame of each frame, by the pictures' names or the numbers; `None` beyond the
    /// clip.
    ///
    /// # Errors
    /// When the numbers are another clip's.
    pub fn numbers(&self, clip: &Clip, at: &Path) -> Result<Vec<Option<usize>>, ClientError> {
        let named = |seen: &FrameDetections| clip.named(seen.image.as_deref()?);
        let names: Vec<Option<usize>> = self.frames.iter().map(named).collect();
        if names.iter().all(Option::is_some) {
            return Ok(names);
        }
        let last = self.frames.last().map_or(0, |seen| seen.number);
        let counts_from_one = self.frames.first().is_some_and(|seen| seen.number > 0);
        let first = match self.first {
            Some(first) => first,
            None => usize::from(counts_from_one && last == clip.frames),
        };
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
pub(super) fn flat(part: &Part<'_>, wanted: usize) -> Result<Vec<[f64; 3]>, ClientError> {
    let values = part.vector()?;
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
pub(super) fn whole(part: &Part<'_>) -> Result<usize, ClientError> {
    let number = part.number()?;
    if number >= 0.0 && number.fract() == 0.0 {
        return Ok(number as usize);
    }
    Err(part.fault("OUT_OF_RANGE", format!("{number} is no number of a frame")))
}

/// The numbers in a file's name, without its ending.
pub(super) fn numbers_in(name: &str) -> Vec<usize> {
    let stem = Path::new(name).file_stem().and_then(|stem| stem.to_str());
    let digits = stem
        .unwrap_or_default()
        .split(|c: char| !c.is_ascii_digit());
    digits.filter_map(|digits| digits.parse().ok()).collect()
}
