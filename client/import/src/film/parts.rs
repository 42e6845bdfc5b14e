//! Hands and face of the person, by models that look at them alone. A folder without such a model's file is used without it.

use crate::clip::fault;
use crate::{ImportError, Options};
use std::path::Path;
use yoto_landmarks::{FaceLandmarks, FaceModel, HandLandmarks, HandModel, PersonLandmarks};
use yoto_pose::{FacePoints, FrameKeyPoints, HandPoints};

/// The models beside the pose model.
#[derive(Debug, Default)]
pub(super) struct PartModels {
    hands: Option<HandModel>,
    face: Option<FaceModel>,
}

impl PartModels {
    /// Opens those models that are there and wanted.
    pub(super) fn open(options: &Options) -> Result<Self, ImportError> {
        let Some(path) = options.pose_model.as_deref() else {
            return Ok(Self::default());
        };
        let folder = if path.is_dir() {
            Some(path)
        } else {
            path.parent()
        };
        let folder = folder.unwrap_or(Path::new(""));
        let unusable = |code: &'static str| {
            move |error: yoto_landmarks::LandmarkError| fault(path, code, error.to_string())
        };
        let hands = match options.no_hands {
            true => None,
            false => HandModel::open(folder).map_err(unusable("HAND_MODEL"))?,
        };
        let face = match options.no_face {
            true => None,
            false => FaceModel::open(folder).map_err(unusable("FACE_MODEL"))?,
        };
        Ok(Self { hands, face })
    }

    /// Puts hands and face of the person in the picture `rgb`, `[height, width, 3]`, into `points`.
    pub(super) fn look(
        &mut self,
        rgb: &[u8],
        size: [usize; 2],
        person: &PersonLandmarks,
        points: &mut FrameKeyPoints,
    ) {
        if let Some(model) = &mut self.hands {
            let seen = model.look(rgb, size, person);
            points.hands = seen.map(|hand| hand.as_ref().map(hand_points));
        }
        if let Some(model) = &mut self.face {
            let seen = model.look(rgb, size, person);
            points.face = seen.as_ref().and_then(face_points);
        }
    }
}

fn hand_points(hand: &HandLandmarks) -> HandPoints {
    HandPoints {
        picture: hand.picture.map(|[x, y, _]| [x, y].map(f64::from)),
        space: hand.space.map(|point| point.map(f64::from)),
        confidence: f64::from(hand.score),
    }
}

fn face_points(face: &FaceLandmarks) -> Option<FacePoints> {
    let points = face.picture.iter().map(|point| point.map(f64::from));
    FacePoints::of_mesh(&points.collect::<Vec<_>>(), f64::from(face.score))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder without the files is used without them. A file that is not a model is a fault, which names it.
    #[test]
    fn a_broken_model_of_a_part_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let options = Options {
            pose_model: Some(folder.path().to_owned()),
            ..Options::default()
        };
        let parts = PartModels::open(&options).expect("no models");
        assert!(parts.hands.is_none() && parts.face.is_none());
        for name in ["face_landmark.tflite", "hand_landmark_full.tflite"] {
            let path = folder.path().join(name);
            std::fs::write(&path, b"not a model").expect("a file");
            let error = PartModels::open(&options).expect_err("a broken file");
            assert!(error.to_string().contains(name), "{error}");
            let unwanted = Options {
                no_hands: true,
                no_face: true,
                ..options.clone()
            };
            assert!(PartModels::open(&unwanted).is_ok());
            std::fs::remove_file(&path).expect("the file");
        }
    }
}
