//! The distances of the joints of training poses from those of the exact ones.

use serde::{Deserialize, Serialize};
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::transform::{length, sub};

/// Mean distance of joints from their exact places over all frames, millimetres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseErrors {
    /// Error of the poses that training was given.
    pub given_mm: f64,
    /// Error of those poses as training has refined them; absent where it does not refine them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refined_mm: Option<f64>,
}

impl PoseErrors {
    /// The mean over people; `None` without any.
    pub(crate) fn mean(errors: &[Self]) -> Option<Self> {
        let count = errors.len() as f64;
        let refined: Option<Vec<f64>> = errors.iter().map(|it| it.refined_mm).collect();
        (!errors.is_empty()).then(|| Self {
            given_mm: errors.iter().map(|it| it.given_mm).sum::<f64>() / count,
            refined_mm: refined.map(|all| all.iter().sum::<f64>() / count),
        })
    }
}

/// Mean distance between the joints of pairs of poses, millimetres.
pub(crate) fn joints_apart<'a>(
    skeleton: &Skeleton,
    pairs: impl Iterator<Item = (&'a Pose, &'a Pose)>,
) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for (a, b) in pairs {
        let (a, b) = (skeleton.posed_joints(a), skeleton.posed_joints(b));
        sum += a
            .iter()
            .zip(&b)
            .map(|(a, b)| length(sub(*a, *b)))
            .sum::<f64>();
        count += a.len();
    }
    1e3 * sum / count.max(1) as f64
}
