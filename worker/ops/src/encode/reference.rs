//! The encoding in Burn's own tensor operations, which the tests compare the other form with.

use super::Bands;
use burn::tensor::Tensor;

/// See [`super::frequencies`].
pub fn frequencies(points: Tensor<2>, bands: &Bands) -> Tensor<2> {
    let mut parts = Vec::with_capacity(2 * bands.count);
    for (radians, weight) in bands.each() {
        let angle = points.clone() * radians;
        let scaled = |t: Tensor<2>| if weight == 1.0 { t } else { t * weight };
        parts.push(scaled(angle.clone().sin()));
        parts.push(scaled(angle.cos()));
    }
    Tensor::cat(parts, 1)
}
