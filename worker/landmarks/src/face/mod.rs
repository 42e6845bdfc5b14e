//! Landmarks of a face, by MediaPipe's face model (Apache-2.0), which looks at a square around the face.
//!
//! The pose model's points of the face give the first square. The face's own landmarks give a better one, which is looked at again, and
//! the landmarks of that look count.

mod square;

use crate::model::open_network;
use crate::network::Network;
use crate::region::{Beyond, Region, View};
use crate::{LandmarkError, PersonLandmarks};
use std::path::Path;

/// Name of the model's file.
const FILE: &str = "face_landmark.tflite";
/// Pixels of the model's picture along a side.
const SIDE: usize = 192;
/// Points of a face.
pub const FACE_POINTS: usize = 468;
/// Least likelihood of a face: MediaPipe's own.
const LOWEST_SCORE: f32 = 0.5;
/// Smallest face that is looked at, pixels across the pose model's points from ear to ear.
const SMALLEST: f32 = 12.0;

/// The model.
#[derive(Debug)]
pub struct FaceModel {
    network: Network,
}

/// A face in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct FaceLandmarks {
    /// x and y in pixels from the picture's corner, z in pixels from the head's middle (away from the camera is positive).
    pub picture: Vec<[f32; 3]>,
    /// Likelihood of a face, from 0 to 1.
    pub score: f32,
}

impl FaceModel {
    /// Opens the model in `folder`; `None` if the folder has none.
    ///
    /// # Errors
    /// If the file can't be read, or is not a model that this crate can run.
    pub fn open(folder: &Path) -> Result<Option<Self>, LandmarkError> {
        let path = folder.join(FILE);
        if !path.exists() {
            return Ok(None);
        }
        let shapes = [&[1, 1, 1, 3 * FACE_POINTS][..], &[1, 1, 1, 1]];
        let network = open_network(&path, SIDE, shapes)?;
        Ok(Some(Self { network }))
    }

    /// The face of a person in the picture `rgb`, `[height, width, 3]`; `None` if it can't be seen.
    pub fn look(
        &mut self,
        rgb: &[u8],
        [width, height]: [usize; 2],
        person: &PersonLandmarks,
    ) -> Option<FaceLandmarks> {
        let view = View { rgb, width, height };
        let first = square::of_pose(person, SMALLEST)?;
        let rough = self.look_in(view, first)?;
        self.look_in(view, square::of_face(&rough)?)
    }

    fn look_in(&mut self, view: View, region: Region) -> Option<FaceLandmarks> {
        region.cut(view, SIDE, [0.0, 1.0], Beyond::Black, self.network.input());
        self.network.run();
        let [points, score] = [0, 1].map(|at| self.network.result(at));
        let score = 1.0 / (1.0 + (-*score.first()?).exp());
        let place = |point: &[f32; 3]| {
            let [x, y, z] = point.map(|number| number / SIDE as f32);
            let [x, y] = region.to_picture([x, y]);
            [x, y, z * region.side]
        };
        let seen = FaceLandmarks {
            picture: points.as_chunks::<3>().0.iter().map(place).collect(),
            score,
        };
        let mut numbers = seen.picture.iter().flatten();
        let is_finite = numbers.all(|number| number.is_finite());
        (is_finite && score >= LOWEST_SCORE).then_some(seen)
    }
}
