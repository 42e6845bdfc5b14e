//! Landmarks of hands, by MediaPipe's hand model (Apache-2.0), which looks at a square around the hand.
//!
//! The wrist and knuckles of the pose model give the first square. The hand's own landmarks give a better one, which is looked at
//! again, and the landmarks of that look count.

mod square;

use crate::model::open_network;
use crate::network::Network;
use crate::region::{Beyond, Region, View};
use crate::{LandmarkError, PersonLandmarks};
use std::path::Path;

/// Name of the model's file.
const FILE: &str = "hand_landmark_full.tflite";
/// Pixels of the model's picture along a side.
const SIDE: usize = 224;
/// Points of a hand: the wrist, then four from the palm to the tip of thumb, index, middle, ring and little finger.
pub const HAND_POINTS: usize = 21;
/// Least likelihood of a hand.
const LOWEST_SCORE: f32 = 0.5;
/// Smallest hand that is looked at, pixels from the wrist to the first knuckles: fingers of smaller ones can't be told.
const SMALLEST: f32 = 8.0;
/// Least likelihood of the pose model's points of a hand in sight.
const IN_SIGHT: f32 = 0.5;
/// BlazePose's wrist, little finger and index finger, left before right.
const HANDS: [[usize; 3]; 2] = [[15, 17, 19], [16, 18, 20]];

/// The model.
#[derive(Debug)]
pub struct HandModel {
    network: Network,
}

/// A hand in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct HandLandmarks {
    /// x and y in pixels from the picture's corner, z in pixels from the wrist (away from the camera is positive).
    pub picture: [[f32; 3]; HAND_POINTS],
    /// Metres from the middle of the hand, in the camera's axes.
    pub space: [[f32; 3]; HAND_POINTS],
    /// Likelihood of a hand, from 0 to 1.
    pub score: f32,
    /// Likelihood that it is a right hand, from 0 to 1.
    pub right: f32,
}

impl HandModel {
    /// Opens the model in `folder`; `None` if the folder has none.
    ///
    /// # Errors
    /// If the file can't be read, or is not a model that this crate can run.
    pub fn open(folder: &Path) -> Result<Option<Self>, LandmarkError> {
        let path = folder.join(FILE);
        if !path.exists() {
            return Ok(None);
        }
        let points = &[1, 3 * HAND_POINTS][..];
        let network = open_network(&path, SIDE, [points, &[1, 1], &[1, 1], points])?;
        Ok(Some(Self { network }))
    }

    /// The hands of a person in the picture `rgb`, `[height, width, 3]`, left and right; `None` for one that can't be seen.
    pub fn look(
        &mut self,
        rgb: &[u8],
        [width, height]: [usize; 2],
        person: &PersonLandmarks,
    ) -> [Option<HandLandmarks>; 2] {
        let view = View { rgb, width, height };
        HANDS.map(|points| {
            let points = points.map(|point| person.picture[point]);
            if points.iter().any(|point| point[3] < IN_SIGHT) {
                return None;
            }
            let first = square::of_pose(points.map(|[x, y, ..]| [x, y]), SMALLEST)?;
            let rough = self.look_in(view, first)?;
            self.look_in(view, square::of_hand(&rough)?)
        })
    }

    fn look_in(&mut self, view: View, region: Region) -> Option<HandLandmarks> {
        region.cut(view, SIDE, [0.0, 1.0], Beyond::Black, self.network.input());
        self.network.run();
        let [points, score, right, space] = [0, 1, 2, 3].map(|at| self.network.result(at));
        let score = *score.first()?;
        let (points, space) = (points.as_chunks::<3>().0, space.as_chunks::<3>().0);
        let picture = |at: usize| {
            let [x, y, z] = points[at].map(|number| number / SIDE as f32);
            let [x, y] = region.to_picture([x, y]);
            [x, y, z * region.side]
        };
        let metres = |at: usize| {
            let [x, y, z] = space[at];
            let [x, y] = region.rotate([x, y]);
            [x, y, z]
        };
        let seen = HandLandmarks {
            picture: std::array::from_fn(picture),
            space: std::array::from_fn(metres),
            score,
            right: *right.first()?,
        };
        let mut numbers = seen.picture.iter().chain(&seen.space).flatten();
        let is_finite = numbers.all(|number| number.is_finite());
        (is_finite && score >= LOWEST_SCORE).then_some(seen)
    }
}
