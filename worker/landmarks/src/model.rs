//! The pose model's files.

use crate::network::Network;
use crate::region::{Beyond, Region, View};
use crate::{LandmarkError, Outline, detector, landmarks};
use std::path::{Path, PathBuf};

/// Name of the detector's file.
const DETECTOR: &str = "pose_detection.tflite";
/// Names of the landmark model's file, the most accurate first.
const LANDMARKS: [&str; 3] = [
    "pose_landmark_heavy.tflite",
    "pose_landmark_full.tflite",
    "pose_landmark_lite.tflite",
];
/// Largest file that is read, bytes.
const MAX_BYTES: u64 = 256 << 20;

/// BlazePose: a detector of people and a model of their landmarks.
#[derive(Debug)]
pub struct PoseModel {
    name: String,
    anchors: Vec<[f32; 2]>,
    detector: Network,
    /// Outputs of the detector: boxes, scores.
    found: [usize; 2],
    landmarks: Network,
    /// Outputs of the landmark model: points, likelihoods, space, score, mask.
    outputs: [usize; 5],
}

/// The landmark model's result for a region.
pub(crate) struct Looked {
    /// Likelihood of a person, from 0 to 1.
    pub(crate) score: f32,
    pub(crate) landmarks: Option<landmarks::Landmarks>,
}

impl PoseModel {
    /// Opens the model in the folder `path`, or the landmark model `path` with the detector beside it.
    ///
    /// In a folder, the most accurate of heavy, full and lite is used.
    ///
    /// # Errors
    /// If a file is missing, can't be read, or is not a model that this crate can run.
    pub fn open(path: &Path) -> Result<Self, LandmarkError> {
        let (folder, file) = if path.is_dir() {
            let files = LANDMARKS.iter().map(|name| path.join(name));
            let file = files.into_iter().find(|file| file.exists());
            let file = file.ok_or_else(|| LandmarkError::Empty(path.to_owned()))?;
            (path, file)
        } else {
            (path.parent().unwrap_or(Path::new("")), path.to_owned())
        };
        let (detector, found) = open(
            &folder.join(DETECTOR),
            detector::SIDE,
            [
                &[1, detector::BOXES, detector::NUMBERS][..],
                &[1, detector::BOXES, 1],
            ],
        )?;
        let (cells, points) = (landmarks::CELLS, landmarks::POINTS);
        let (landmarks, outputs) = open(
            &file,
            landmarks::SIDE,
            [
                &[1, points * landmarks::NUMBERS][..],
                &[1, cells, cells, points],
                &[1, points * 3],
                &[1, 1],
                &[1, landmarks::SIDE, landmarks::SIDE, 1],
            ],
        )?;
        Ok(Self {
            name: file.file_stem().unwrap_or_default().display().to_string(),
            anchors: detector::anchors(),
            detector,
            found,
            landmarks,
            outputs,
        })
    }

    /// Name of the landmark model, for people.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The regions of people in the picture, the most certain first.
    pub(crate) fn find(&mut self, view: View) -> Vec<Region> {
        let whole = Region::whole(view.width, view.height);
        let input = self.detector.input();
        whole.cut(view, detector::SIDE, [-1.0, 1.0], Beyond::Black, input);
        self.detector.run();
        let [boxes, scores] = self.found.map(|at| self.detector.result(at));
        detector::people(&self.anchors, boxes, scores, whole)
    }

    /// The landmarks of the person in `region`.
    pub(crate) fn look(&mut self, view: View, region: Region) -> Looked {
        let input = self.landmarks.input();
        region.cut(view, landmarks::SIDE, [0.0, 1.0], Beyond::Nearest, input);
        self.landmarks.run();
        let [points, likelihoods, space, score, _] =
            self.outputs.map(|at| self.landmarks.result(at));
        let outputs = landmarks::Outputs {
            points,
            likelihoods,
            space,
        };
        Looked {
            score: score.first().copied().unwrap_or(0.0),
            landmarks: outputs.landmarks(region),
        }
    }

    /// The outline of the person in `region`, which must be the last one of [`look`](Self::look).
    pub(crate) fn outline(&self, view: View, region: Region) -> Outline {
        let [.., logits] = self.outputs;
        let logits = self.landmarks.result(logits);
        Outline::new(logits, region, [view.width, view.height])
    }
}

/// Reads a network with a square input picture of `side` pixels and exactly the outputs of the `shapes`, in this order.
pub(crate) fn open_network<const N: usize>(
    path: &Path,
    side: usize,
    shapes: [&[usize]; N],
) -> Result<Network, LandmarkError> {
    let network = with_side(path, side)?;
    if network.shapes().eq(shapes) {
        return Ok(network);
    }
    Err(LandmarkError::Model {
        path: PathBuf::from(path),
        message: format!("does not have outputs of the shapes {shapes:?}"),
    })
}

/// Reads a network with a square input picture of `side` pixels.
fn with_side(path: &Path, side: usize) -> Result<Network, LandmarkError> {
    let bad = |message: String| LandmarkError::Model {
        path: PathBuf::from(path),
        message,
    };
    let network = Network::read(&read(path)?).map_err(bad)?;
    if network.input_len() != side * side * 3 {
        return Err(bad(format!("does not take pictures of {side}x{side}")));
    }
    Ok(network)
}

/// Reads a network with a square input picture of `side` pixels and outputs of the `shapes`. Returns the network and the
/// indices of the outputs.
fn open<const N: usize>(
    path: &Path,
    side: usize,
    shapes: [&[usize]; N],
) -> Result<(Network, [usize; N]), LandmarkError> {
    let bad = |message: String| LandmarkError::Model {
        path: PathBuf::from(path),
        message,
    };
    let network = with_side(path, side)?;
    let mut indices = [0; N];
    for (index, shape) in indices.iter_mut().zip(shapes) {
        let found = network.output(shape);
        *index = found.ok_or_else(|| bad(format!("has no output of the shape {shape:?}")))?;
    }
    Ok((network, indices))
}

fn read(path: &Path) -> Result<Vec<u8>, LandmarkError> {
    let fault = |error| LandmarkError::Read {
        path: path.to_owned(),
        error,
    };
    let meta = match std::fs::metadata(path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return Err(LandmarkError::Missing(path.to_owned()));
        }
        meta => meta.map_err(fault)?,
    };
    if meta.len() > MAX_BYTES {
        return Err(LandmarkError::Model {
            path: path.to_owned(),
            message: format!("{} bytes are too many for a pose model", meta.len()),
        });
    }
    std::fs::read(path).map_err(fault)
}
