//! Follows one person from picture to picture.

use crate::colours::opponent;
use crate::people::{BodySquare, Colours, Target};
use crate::region::{Region, View};
use crate::{LandmarkError, Outline, PoseModel};

/// Least likelihood of a person by the landmark model.
const LOWEST_SCORE: f32 = 0.5;

/// Follows a person through the pictures of a clip.
///
/// The detector finds the person in the first picture. In the following pictures, the person is expected at the
/// last landmarks; if no person is there, the detector searches again. Of several people, one is followed
/// ([`Watcher::follow`]); a picture in which nobody can be told to be that person has nobody.
#[derive(Debug)]
pub struct Watcher {
    model: PoseModel,
    expected: Option<Region>,
    target: Option<Target>,
}

/// At most this number of people is examined in one picture, the most certain first.
const MOST_PEOPLE: usize = 5;
/// Least likelihood of a landmark in sight.
const IN_SIGHT: f32 = 0.5;

/// A person in a picture. The 33 points are BlazePose's.
#[derive(Clone, Debug)]
pub struct PersonLandmarks {
    /// x and y in pixels from the picture's corner, z in pixels from the hips (away from the camera
    /// is positive), visibility from 0 to 1.
    pub picture: [[f32; 4]; 33],
    /// Metres from the middle of the hips, in the camera's axes (x right, y down, z forward);
    /// visibility from 0 to 1.
    pub space: [[f32; 4]; 33],
    /// The person's outline.
    pub outline: Outline,
    /// Likelihood of a person, from 0 to 1.
    pub score: f32,
    /// Place, size and colours of the body; `None` if its square can't be told.
    pub figure: Option<BodySquare>,
}

impl Watcher {
    /// A watcher that has seen nothing yet.
    pub fn new(model: PoseModel) -> Self {
        Self {
            model,
            expected: None,
            target: None,
        }
    }

    /// Follows `target` from here on; `None` follows the first person found.
    pub fn follow(&mut self, target: Option<Target>) {
        self.target = target;
        self.expected = None;
    }

    /// The model.
    pub fn model(&self) -> &PoseModel {
        &self.model
    }

    /// The person in the picture `at` of the clip, `rgb`, `[height, width, 3]`, of `size` (width, height); `None` without a
    /// person, or if no person is surely the followed one.
    ///
    /// # Errors
    /// [`LandmarkError::Picture`] if `rgb` does not have that size.
    pub fn look(
        &mut self,
        at: usize,
        rgb: &[u8],
        size: [usize; 2],
    ) -> Result<Option<PersonLandmarks>, LandmarkError> {
        let view = view(rgb, size)?;
        if let Some(region) = self.expected.take()
            && let Some((seen, next)) = self.look_in(view, region)
            && self.is_target(at, &seen)
        {
            self.expected = next;
            return Ok(Some(seen));
        }
        let regions = self.model.find(view);
        if self.target.is_none() {
            let found = regions
                .first()
                .and_then(|region| self.look_in(view, *region));
            let (seen, next) = found.unzip();
            self.expected = next.flatten();
            return Ok(seen);
        }
        let mut best: Option<(f32, PersonLandmarks, Option<Region>)> = None;
        for region in regions.into_iter().take(MOST_PEOPLE) {
            let Some((seen, next)) = self.look_in(view, region) else {
                continue;
            };
            let target = self.target.as_ref().zip(seen.figure);
            let cost = target.and_then(|(target, figure)| target.cost(at, &figure));
            if let Some(cost) = cost
                && best.as_ref().is_none_or(|(least, ..)| cost < *least)
            {
                best = Some((cost, seen, next));
            }
        }
        Ok(best.map(|(_, seen, next)| {
            if let (Some(target), Some(figure)) = (&mut self.target, seen.figure) {
                target.saw(at, figure);
            }
            self.expected = next;
            seen
        }))
    }

    fn is_target(&mut self, at: usize, seen: &PersonLandmarks) -> bool {
        let Some(target) = &mut self.target else {
            return true;
        };
        let person = seen.figure.filter(|figure| target.is_person(at, figure));
        if let Some(figure) = person {
            target.saw(at, figure);
        }
        person.is_some()
    }

    /// The person in `region`, and where they are expected next.
    fn look_in(&mut self, view: View, region: Region) -> Option<(PersonLandmarks, Option<Region>)> {
        let looked = self.model.look(view, region);
        let landmarks = looked.landmarks.filter(|_| looked.score >= LOWEST_SCORE)?;
        let figure = landmarks.next.map(|square| BodySquare {
            hips: square.centre,
            side: square.side,
            colours: colours(view, &landmarks.picture),
        });
        let seen = PersonLandmarks {
            picture: landmarks.picture,
            space: landmarks.space,
            outline: self.model.outline(view, region),
            score: looked.score,
            figure,
        };
        Some((seen, landmarks.next))
    }
}

fn view(rgb: &[u8], [width, height]: [usize; 2]) -> Result<View<'_>, LandmarkError> {
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
    Ok(View { rgb, width, height })
}

/// Samples along each side of the torso, and along each thigh.
const SAMPLES: usize = 8;

/// The mean colours of the torso, between shoulders and hips, and of the thighs.
fn colours(view: View, points: &[[f32; 4]; 33]) -> Colours {
    let [shoulders, hips, knees] = [[11, 12], [23, 24], [25, 26]];
    let between = |a: [f32; 2], b: [f32; 2], share: f32| {
        [0, 1].map(|axis| a[axis] + share * (b[axis] - a[axis]))
    };
    let at = |point: usize| [points[point][0], points[point][1]];
    let is_seen = |all: &[[usize; 2]]| {
        let mut all = all.iter().flatten();
        all.all(|point| points[*point][3] >= IN_SIGHT)
    };
    let share = |step: usize| (step as f32 + 0.5) / SAMPLES as f32;
    let steps = || (0..SAMPLES).map(share);
    let torso = steps().flat_map(|down| {
        let ends = [0, 1].map(|side| between(at(shoulders[side]), at(hips[side]), down));
        steps().map(move |across| between(ends[0], ends[1], across))
    });
    let thighs = [0, 1]
        .into_iter()
        .flat_map(|side| steps().map(move |down| between(at(hips[side]), at(knees[side]), down)));
    [
        is_seen(&[shoulders, hips])
            .then(|| mean(view, torso))
            .flatten(),
        is_seen(&[hips, knees])
            .then(|| mean(view, thighs))
            .flatten(),
    ]
}

/// The mean of the pixels at `places` as lightness, red less green, and yellow less blue; `None` if fewer than half are in the
/// picture.
fn mean(view: View, places: impl Iterator<Item = [f32; 2]>) -> Option<[f32; 3]> {
    let (pixels, _) = view.rgb.as_chunks::<3>();
    let (mut sum, mut inside, mut all) = ([0.0f32; 3], 0u32, 0u32);
    for [x, y] in places {
        all += 1;
        let is_inside = x >= 0.0 && y >= 0.0 && x < view.width as f32 && y < view.height as f32;
        let pixel = pixels.get(y as usize * view.width + x as usize);
        if let Some(pixel) = pixel.filter(|_| is_inside) {
            inside += 1;
            let own = opponent(pixel.map(f32::from));
            sum = [0, 1, 2].map(|at| sum[at] + own[at]);
        }
    }
    (2 * inside >= all && inside > 0).then(|| sum.map(|sum| sum / inside as f32))
}
