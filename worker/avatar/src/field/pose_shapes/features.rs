//! Features of a pose, and those of the poses that were filmed.

use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::rodrigues;

/// Numbers per joint: R − I, row-major.
pub(super) const FEATURES: usize = 9;

/// How far beyond its filmed range a feature still takes part, as a share of the range (docs/research/splats.md, "Pose blend shapes").
const BEYOND: f32 = 3.0;

/// `[9 K]`: R − I of each of the first K `joints`; 0 for the root, since clothes do not move when a person turns.
pub(super) fn features(pose: &Pose, joints: usize) -> Vec<f32> {
    let mut all = vec![0.0; FEATURES];
    for rotation in pose.rotations.iter().take(joints).skip(1) {
        let turned = rodrigues(rotation.map(f64::from));
        let less = |i: usize| turned[i / 3][i % 3] - f64::from(u8::from(i.is_multiple_of(4)));
        all.extend((0..FEATURES).map(|i| less(i) as f32));
    }
    all
}

/// The range of each feature in the filmed poses, which has the rest pose in it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FeatureRange {
    /// `[2, 9 K]`: the least, then the greatest.
    bounds: Vec<f32>,
}

impl FeatureRange {
    /// The rest pose alone.
    pub(crate) fn nothing(joints: usize) -> Self {
        Self {
            bounds: vec![0.0; 2 * FEATURES * joints],
        }
    }

    /// Widens the ranges to those of `poses`.
    pub(crate) fn add<'a>(&mut self, poses: impl Iterator<Item = &'a Pose>) {
        let half = self.bounds.len() / 2;
        let (least, greatest) = self.bounds.split_at_mut(half);
        for pose in poses {
            for (i, value) in features(pose, half / FEATURES).into_iter().enumerate() {
                least[i] = least[i].min(value);
                greatest[i] = greatest[i].max(value);
            }
        }
    }

    /// The range with the `bounds` of [`Self::bounds`].
    pub(crate) fn from_bounds(bounds: Vec<f32>) -> Self {
        Self { bounds }
    }

    /// `[2, 9 K]`: the least of each feature, then the greatest.
    pub(crate) fn bounds(&self) -> &[f32] {
        &self.bounds
    }

    /// The range of each feature, widened by [`BEYOND`] on both sides.
    pub(crate) fn limits(&self) -> Limits {
        let (least, greatest) = self.bounds.split_at(self.bounds.len() / 2);
        let beyond = |(from, to): (&f32, &f32)| to + BEYOND * (to - from);
        let below = greatest.iter().zip(least).map(beyond);
        let above = least.iter().zip(greatest).map(beyond);
        Limits(below.chain(above).collect())
    }
}

/// The values between which features take part. Nothing is known of clothes far from filmed poses, and a line through these
/// leads far off.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Limits(Vec<f32>);

impl Limits {
    /// The limits with the `numbers` of [`Self::as_slice`].
    pub(crate) fn of(numbers: Vec<f32>) -> Self {
        Self(numbers)
    }

    /// `[2, 9 K]`: the least of each feature, then the greatest.
    pub(crate) fn as_slice(&self) -> &[f32] {
        &self.0
    }

    /// `features` `[9 K]` within the limits.
    pub(crate) fn clamp(&self, mut features: Vec<f32>) -> Vec<f32> {
        let (least, greatest) = self.0.split_at(self.0.len() / 2);
        for (value, (least, greatest)) in features.iter_mut().zip(least.iter().zip(greatest)) {
            // Mixtures of people may have bounds that cross by a rounding error.
            *value = value.min(*greatest).max(*least);
        }
        features
    }
}
