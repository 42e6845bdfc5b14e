//! The observations that a fit explains, in the form that residuals read.

use crate::check::{SEEN, extent};
use crate::fit::FitOptions;
use crate::markers::Markers;
use crate::{FrameKeyPoints, KeyPoints};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{length, scale, sub};

/// A focal length's prior where none is given, by the longer side: an ordinary phone's.
const USUAL_FOCAL: f64 = 1.2;
/// Error of a key point, as a share of the body's extent in the picture.
const PIXEL_SHARE: f64 = 0.006;

/// A point seen in a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    pub marker: usize,
    /// Pixels from the picture's middle.
    pub at: [f64; 2],
    pub confidence: f64,
}

/// A direction guessed by the detector.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Direction {
    pub markers: [usize; 2],
    /// Of length 1, in the camera's axes.
    pub towards: Vec3,
    /// Distance of the two points as the detector guesses it, metres.
    pub length: f64,
}

/// What is known of one frame.
#[derive(Clone, Debug)]
pub(crate) struct Observed {
    /// Seconds.
    pub time: f64,
    /// Extent of the person in the picture, pixels.
    pub extent: f64,
    pub seen: Vec<Seen>,
    pub directions: Vec<Direction>,
    /// Points in space, `[N]`, of all markers; empty without a guess of depth.
    pub space: Vec<Vec3>,
}

/// A fit's observations and settings.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    pub markers: Markers,
    pub frames: Vec<Observed>,
    /// Middle of the pictures, pixels.
    pub centre: [f64; 2],
    /// Standard deviation of a certain point, pixels.
    pub pixels: f64,
    /// Focal length given or usual, pixels.
    pub focal: f64,
    /// Whether the focal length is given.
    pub focal_known: bool,
    /// Longer side of the pictures, pixels.
    pub longer: f64,
    /// Whether the person is taken to stand upright on the whole.
    pub upright: bool,
}

impl Problem {
    /// Of checked key points.
    pub fn new(points: &KeyPoints, options: &FitOptions) -> Self {
        let markers = Markers::of(points.set);
        let [width, height] = points.image_size.map(f64::from);
        let (centre, longer) = ([0.5 * width, 0.5 * height], width.max(height));
        let observe = |frame| observe(frame, &markers, centre, points.fps);
        let frames: Vec<Observed> = points.frames.iter().map(observe).collect();
        let mut extents: Vec<f64> = frames.iter().map(|frame| frame.extent).collect();
        Self {
            pixels: PIXEL_SHARE * quantile(&mut extents, 0.8),
            markers,
            frames,
            centre,
            focal: options.focal.unwrap_or(USUAL_FOCAL * longer),
            focal_known: options.focal.is_some(),
            longer,
            upright: options.upright,
        }
    }

    /// Whether depths are guessed in most frames.
    pub fn has_space(&self) -> bool {
        let with = self.frames.iter().filter(|frame| !frame.space.is_empty());
        2 * with.count() > self.frames.len()
    }
}

impl Observed {
    /// The same with left called right; `mirror` tells each point's like.
    pub fn relabelled(&self, mirror: &[usize]) -> Self {
        let other = |at: usize| mirror.get(at).copied().unwrap_or(at);
        let space = |at: usize| self.space.get(other(at)).copied();
        let mut relabelled = self.clone();
        for seen in &mut relabelled.seen {
            seen.marker = other(seen.marker);
        }
        for direction in &mut relabelled.directions {
            direction.markers = direction.markers.map(other);
        }
        relabelled.space = (0..self.space.len()).filter_map(space).collect();
        relabelled
    }

    /// The body that looks the same from the camera and faces the other way: left called right, and what
    /// was near far.
    pub fn turned_round(&self, mirror: &[usize]) -> Self {
        let mut round = self.relabelled(mirror);
        for direction in &mut round.directions {
            direction.towards[2] = -direction.towards[2];
        }
        round.space.iter_mut().for_each(|at| at[2] = -at[2]);
        round
    }
}

fn observe(frame: &FrameKeyPoints, markers: &Markers, centre: [f64; 2], fps: f64) -> Observed {
    let confidence = |at: usize| frame.picture.get(at).map_or(0.0, |point| point[2]);
    let seen = frame.picture.iter().enumerate();
    let seen = seen.filter(|(_, point)| point[2] >= SEEN);
    let direction = |&[from, to]: &[usize; 2]| {
        let (a, b) = (frame.space.get(from)?, frame.space.get(to)?);
        let (way, sure) = (sub(*b, *a), confidence(from).min(confidence(to)));
        let length = length(way);
        (length > 0.01 && sure >= SEEN).then(|| Direction {
            markers: [from, to],
            towards: scale(way, 1.0 / length),
            length,
        })
    };
    Observed {
        time: f64::from(frame.index) / fps,
        extent: extent(frame),
        seen: seen
            .map(|(marker, &[x, y, confidence])| Seen {
                marker,
                at: [x - centre[0], y - centre[1]],
                confidence,
            })
            .collect(),
        directions: markers.bones.iter().filter_map(direction).collect(),
        space: frame.space.clone(),
    }
}

/// The value below which `share` of `values` lie; 0 of none.
pub(crate) fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = (share * values.len() as f64) as usize;
    let last = values.len().saturating_sub(1);
    values.get(at.min(last)).copied().unwrap_or(0.0)
}
