//! The fit of a reading of the numbers to the masks.

use super::figure::CapsuleBody;
use super::observe::Observation;
use super::silhouette::{Canvas, Grid};
use crate::camera::Camera;
use crate::skeleton::{Pose, Skeleton};
use yoto_proto::correction::Correction;
use yoto_proto::pose_track::{Frame, PoseTrack};

/// Thicknesses of bodies with clothes, as factors on the figure. Each reading is judged at its best
/// thickness, so that none wins by the person's build.
const FATNESS: [f64; 3] = [0.85, 1.1, 1.4];

/// Pose and camera of one frame of a track, unchecked: wrong readings give wild numbers, which are only
/// drawn.
pub(super) fn view(frame: &Frame, size: [u32; 2]) -> (Pose, Camera) {
    let rotations = frame.pose.as_chunks::<3>().0;
    let pose = Pose {
        rotations: rotations.iter().map(|r| r.map(|v| v as f32)).collect(),
        translation: frame.translation.map(|v| v as f32),
    };
    let [width, height] = size;
    let camera = Camera {
        width,
        height,
        k: frame.k,
        e: frame.e,
    };
    (pose, camera)
}

/// A reading's fit.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// Mean overlap, 0 to 1.
    pub mean: f64,
    /// Overlap in each sampled frame.
    pub overlaps: Vec<f64>,
    /// The best thickness.
    pub fatness: f64,
}

impl Fit {
    /// Mean gain over `other` in the same frames, and its standard error.
    pub(super) fn gain_over(&self, other: &Self) -> (f64, f64) {
        let pairs = self.overlaps.iter().zip(&other.overlaps);
        mean_and_error(&pairs.map(|(a, b)| a - b).collect::<Vec<_>>())
    }
}

/// Mean of `values`, and the standard error of that mean.
pub(super) fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
    (mean, (variance / count).sqrt())
}

/// A sample of frames with their masks, on which readings are tried.
pub(super) struct Fitter<'a> {
    /// The track, cut to the sampled frames.
    track: PoseTrack,
    masks: Vec<&'a Observation>,
    canvas: Canvas,
}

impl<'a> Fitter<'a> {
    pub(super) fn new(track: &PoseTrack, sample: Vec<&'a Observation>) -> Self {
        let frames = sample.iter().map(|it| track.frames[it.position].clone());
        Self {
            track: PoseTrack {
                frames: frames.collect(),
                ..track.clone()
            },
            masks: sample,
            canvas: Canvas::new(Grid::of(track.image_size)),
        }
    }

    /// The fit of the numbers after `correction`; `None` if it can't be applied.
    pub(super) fn fit(&mut self, correction: &Correction) -> Option<Fit> {
        let track = correction.apply(&self.track).ok()?.track;
        let skeleton = Skeleton::from_track(&track.skeleton).ok()?;
        let figure = CapsuleBody::of(&skeleton);
        let posed: Vec<_> = track
            .frames
            .iter()
            .map(|frame| {
                let (pose, camera) = view(frame, track.image_size);
                (figure.posed(&pose), camera)
            })
            .collect();
        let fits = FATNESS.map(|fatness| {
            let pairs = posed.iter().zip(&self.masks);
            let overlaps: Vec<f64> = pairs
                .map(|((capsules, camera), seen)| {
                    seen.mask
                        .overlap(self.canvas.draw(capsules, camera, fatness))
                })
                .collect();
            let mean = mean_and_error(&overlaps).0;
            Fit {
                mean,
                overlaps,
                fatness,
            }
        });
        fits.into_iter().max_by(|a, b| a.mean.total_cmp(&b.mean))
    }
}
