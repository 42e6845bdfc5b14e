//! The observations that a fit explains, in the form for residuals.

use crate::check::{SEEN, extent};
use crate::markers::Markers;
use crate::options::FitOptions;
use crate::{FrameKeyPoints, KeyPoints, parts};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{length, scale, sub};

/// Prior of an unknown focal length, as a multiple of the longer side: that of an ordinary phone.
const USUAL_FOCAL: f64 = 1.2;
/// Error of a key point, as a share of the body's extent in the picture.
const PIXEL_SHARE: f64 = 0.006;

/// Confidence from which a point tells whether it stands still.
const SURELY: f64 = 0.5;
/// Largest speed of a point that stands still, extents of the body per second, and the least and largest time over which it is
/// measured, seconds.
const STILL: f64 = 0.12;
const MOMENT: [f64; 2] = [0.06, 0.25];

/// A key point that was seen in a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Detection {
    pub marker: usize,
    /// Pixels from the picture's middle.
    pub pixel: [f64; 2],
    /// From 0 to 1.
    pub confidence: f64,
    /// How much more exact it is than a point of the body's detector.
    pub precision: f64,
}

/// A direction between two key points in space, as guessed by the detector.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Direction {
    pub markers: [usize; 2],
    /// Unit vector in the camera's axes.
    pub towards: Vec3,
    /// Distance between the two points by the detector, metres.
    pub length: f64,
    /// Error of a point perpendicular to the direction, metres.
    pub error: f64,
    /// Whether a detector told it that looks at a hand or a face alone.
    pub is_close: bool,
}

/// Error of the body's points in space, metres.
const BODY_ERROR: f64 = 0.07;

/// The depth of a bone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Depth {
    pub markers: [usize; 2],
    /// Depth of the second marker behind the first, metres.
    pub depth: f64,
    /// Standard deviation, metres.
    pub spread: f64,
}

/// The observations of one frame.
#[derive(Clone, Debug)]
pub(crate) struct Observed {
    /// Seconds.
    pub time: f64,
    /// Extent of the person in the picture, pixels.
    pub extent: f64,
    pub detections: Vec<Detection>,
    pub directions: Vec<Direction>,
    /// Depths of bones; empty before [`deepen`](crate::lift::deepen()).
    pub depths: Vec<Depth>,
    /// Points in space, `[N]`, of all markers; empty without a guess of depth.
    pub space: Vec<Vec3>,
    /// Whether each point stands still in the picture, `[N]`.
    pub still: Vec<bool>,
}

/// A fit's observations and settings.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    pub markers: Markers,
    pub frames: Vec<Observed>,
    /// Middle of the pictures, pixels.
    pub centre: [f64; 2],
    /// Standard deviation of a point with confidence 1, pixels.
    pub pixels: f64,
    /// Given or prior focal length, pixels.
    pub focal: f64,
    /// Whether the focal length is given.
    pub focal_known: bool,
    /// Longer side of the pictures, pixels.
    pub longer: f64,
    /// Whether a network finds the depths of the points.
    pub lift: bool,
    /// Whether the person is assumed to stand upright on average.
    pub upright: bool,
    /// Height of the floor above the camera by the first guess, metres; `None` before it, and where nothing tells.
    pub floor: Option<f64>,
}

impl Problem {
    /// The problem for checked key points.
    pub(crate) fn new(points: &KeyPoints, options: &FitOptions) -> Self {
        let markers = Markers::of(points.set);
        let [width, height] = points.image_size.map(f64::from);
        let (centre, longer) = ([0.5 * width, 0.5 * height], width.max(height));
        let focal = options.focal.unwrap_or(USUAL_FOCAL * longer);
        let observe = |frame| {
            let mut observed = observe(frame, &markers, centre, points.fps);
            parts::see(
                &mut observed,
                &markers,
                frame,
                [centre[0], centre[1], focal],
            );
            observed
        };
        let mut frames: Vec<Observed> = points.frames.iter().map(observe).collect();
        mark_still(&mut frames, markers.markers.len());
        let mut extents: Vec<f64> = frames.iter().map(|frame| frame.extent).collect();
        Self {
            pixels: PIXEL_SHARE * quantile(&mut extents, 0.8),
            markers,
            frames,
            centre,
            focal,
            focal_known: options.focal.is_some(),
            longer,
            lift: options.lift,
            upright: options.upright,
            floor: None,
        }
    }

    /// Whether most frames have points in space.
    pub(crate) fn has_space(&self) -> bool {
        let with = self.frames.iter().filter(|frame| !frame.space.is_empty());
        2 * with.count() > self.frames.len()
    }
}

impl Observed {
    /// These observations with left and right exchanged. `mirror` maps each point to its counterpart on the
    /// other side.
    pub(crate) fn relabelled(&self, mirror: &[usize]) -> Self {
        let other = |point: usize| mirror.get(point).copied().unwrap_or(point);
        let space = |point: usize| self.space.get(other(point)).copied();
        let mut relabelled = self.clone();
        for detection in &mut relabelled.detections {
            detection.marker = other(detection.marker);
        }
        for direction in &mut relabelled.directions {
            direction.markers = direction.markers.map(other);
        }
        for depth in &mut relabelled.depths {
            depth.markers = depth.markers.map(other);
        }
        relabelled.space = (0..self.space.len()).filter_map(space).collect();
        let still = |point: usize| self.still.get(other(point)).copied();
        relabelled.still = (0..self.still.len()).filter_map(still).collect();
        relabelled
    }

    /// The body with the same picture that faces the other way: left and right are exchanged, and depths
    /// are mirrored.
    pub(crate) fn turned_round(&self, mirror: &[usize]) -> Self {
        let mut round = self.relabelled(mirror);
        for direction in &mut round.directions {
            direction.towards[2] = -direction.towards[2];
        }
        for depth in &mut round.depths {
            depth.depth = -depth.depth;
        }
        round
            .space
            .iter_mut()
            .for_each(|point| point[2] = -point[2]);
        round
    }
}

fn observe(frame: &FrameKeyPoints, markers: &Markers, centre: [f64; 2], fps: f64) -> Observed {
    let confidence = |point: usize| frame.picture.get(point).map_or(0.0, |it| it[2]);
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
            error: BODY_ERROR,
            is_close: false,
        })
    };
    Observed {
        time: f64::from(frame.index) / fps,
        extent: extent(frame),
        detections: seen
            .map(|(marker, &[x, y, confidence])| Detection {
                marker,
                pixel: [x - centre[0], y - centre[1]],
                confidence,
                precision: 1.0,
            })
            .collect(),
        depths: Vec::new(),
        directions: markers.bones.iter().filter_map(direction).collect(),
        space: frame.space.clone(),
        still: Vec::new(),
    }
}

/// Marks the points of each frame that stand still: those that are where they were a moment before, and where they are a moment after.
fn mark_still(frames: &mut [Observed], points: usize) {
    let places: Vec<(f64, Vec<Option<[f64; 2]>>)> = (frames.iter())
        .map(|frame| {
            let mut places = vec![None; points];
            for detection in frame.detections.iter().filter(|it| it.confidence >= SURELY) {
                places[detection.marker] = Some(detection.pixel);
            }
            (frame.time, places)
        })
        .collect();
    let moments = MOMENT[0]..MOMENT[1];
    for (at, frame) in frames.iter_mut().enumerate() {
        let (now, own) = &places[at];
        let before = places[..at]
            .iter()
            .rev()
            .find(|it| moments.contains(&(now - it.0)));
        let after = places[at + 1..]
            .iter()
            .find(|it| moments.contains(&(it.0 - now)));
        let still = |point: usize, other: &(f64, Vec<Option<[f64; 2]>>)| -> Option<bool> {
            let ([x, y], [u, v]) = (own[point]?, other.1[point]?);
            let speed = (x - u).hypot(y - v) / (now - other.0).abs();
            Some(speed < STILL * frame.extent)
        };
        frame.still = (0..points)
            .map(|point| match (before, after) {
                (Some(before), Some(after)) => {
                    still(point, before) == Some(true) && still(point, after) == Some(true)
                }
                (Some(other), None) | (None, Some(other)) => still(point, other) == Some(true),
                (None, None) => false,
            })
            .collect();
    }
}

/// The quantile of `values` at `share`; 0 for no values.
pub(crate) fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let rank = (share * values.len() as f64) as usize;
    let last = values.len().saturating_sub(1);
    values.get(rank.min(last)).copied().unwrap_or(0.0)
}
