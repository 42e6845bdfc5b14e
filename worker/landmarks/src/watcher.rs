//! Follows one person from picture to picture.

use crate::region::{Region, View};
use crate::{LandmarkError, Outline, PoseModel};

/// Least likelihood of a person by the landmark model.
const LOWEST_SCORE: f32 = 0.5;

/// Follows a person through the pictures of a clip.
///
/// The detector finds the person in the first picture. In the following pictures, the person is expected at the
/// last landmarks; if no person is there, the detector searches again.
#[derive(Debug)]
pub struct Watcher {
    model: PoseModel,
    expected: Option<Region>,
}

/// A person in a picture. The 33 points are BlazePose's.
#[derive(Clone, Debug)]
pub struct Seen {
    /// x and y in pixels from the picture's corner, z in pixels from the hips (away from the camera
    /// is positive), visibility from 0 to 1.
    pub picture: [[f32; 4]; 33],
    /// Metres from the middle of the hips, in the camera's axes (x right, y down, z forward);
    /// visibility from 0 to 1.
    pub space: [[f32; 4]; 33],
    /// Where the person is.
    pub outline: Outline,
    /// Likelihood of a person, from 0 to 1.
    pub score: f32,
}

impl Watcher {
    /// A watcher that has seen nothing yet.
    pub fn new(model: PoseModel) -> Self {
        Self {
            model,
            expected: None,
        }
    }

    /// The model.
    pub fn model(&self) -> &PoseModel {
        &self.model
    }

    /// The person in a picture `rgb`, `[height, width, 3]`, of `size` (width, height); `None` without a
    /// person.
    ///
    /// # Errors
    /// [`LandmarkError::Picture`] if `rgb` does not have that size.
    pub fn look(
        &mut self,
        rgb: &[u8],
        [width, height]: [usize; 2],
    ) -> Result<Option<Seen>, LandmarkError> {
        let needed = width
            .checked_mul(height)
            .and_then(|pixels| pixels.checked_mul(3));
        if needed != Some(rgb.len()) || rgb.is_empty() {
            return Err(LandmarkError::Picture {
                width,
                height,
                bytes: rgb.len(),
            });
        }
        let view = View { rgb, width, height };
        if let Some(region) = self.expected.take()
            && let Some(seen) = self.look_in(view, region)
        {
            return Ok(Some(seen));
        }
        let region = self.model.find(view);
        Ok(region.and_then(|region| self.look_in(view, region)))
    }

    fn look_in(&mut self, view: View, region: Region) -> Option<Seen> {
        let looked = self.model.look(view, region);
        let landmarks = looked.landmarks.filter(|_| looked.score >= LOWEST_SCORE)?;
        self.expected = landmarks.next;
        Some(Seen {
            picture: landmarks.picture,
            space: landmarks.space,
            outline: self.model.outline(view, region),
            score: looked.score,
        })
    }
}
