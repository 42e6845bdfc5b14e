//! Features of a pose, and those of the poses that were filmed.

use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::rodrigues;

/// Numbers per joint: R − I, row-major.
pub(super) const FEATURES: usize = 9;

/// `[9 K]`: R − I of each joint; 0 for the root, since clothes do not move when a person turns.
pub(super) fn features(pose: &Pose) -> Vec<f32> {
    let mut all = vec![0.0; FEATURES];
    for rotation in pose.rotations.iter().skip(1) {
        let turned = rodrigues(rotation.map(f64::from));
        let less = |i: usize| turned[i / 3][i % 3] - f64::from(u8::from(i.is_multiple_of(4)));
        all.extend((0..FEATURES).map(|i| less(i) as f32));
    }
    all
}

/// The range of each feature in the filmed poses, which has the rest pose in it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Filmed {
    /// `[2, 9 K]`: the least, then the greatest.
    bounds: Vec<f32>,
}

impl Filmed {
    /// The rest pose alone.
    pub fn nothing(joints: usize) -> Self {
        Self {
            bounds: vec![0.0; 2 * FEATURES * joints],
        }
    }

    /// Widens the ranges to those of `poses`.
    pub fn add<'a>(&mut self, poses: impl Iterator<Item = &'a Pose>) {
        let half = self.bounds.len() / 2;
        let (least, greatest) = self.bounds.split_at_mut(half);
        for pose in poses {
            for (i, value) in features(pose).into_iter().enumerate() {
                least[i] = least[i].min(value);
                greatest[i] = greatest[i].max(value);
            }
        }
    }

    /// As [`Self::bounds`] gives them.
    pub fn from_bounds(bounds: Vec<f32>) -> Self {
        Self { bounds }
    }

    /// `[2, 9 K]`: the least of each feature, then the greatest.
    pub fn bounds(&self) -> &[f32] {
        &self.bounds
    }

    /// `features` `[9 K]`, those beyond the filmed ones at the last that was filmed. Nothing is known of clothes there, and
    /// a line through filmed poses leads far off.
    pub fn clamp(&self, mut features: Vec<f32>) -> Vec<f32> {
        let (least, greatest) = self.bounds.split_at(self.bounds.len() / 2);
        for (value, (least, greatest)) in features.iter_mut().zip(least.iter().zip(greatest)) {
            // Mixtures of people may have bounds that cross by a rounding error.
            *value = value.min(*greatest).max(*least);
        }
        features
    }
}
