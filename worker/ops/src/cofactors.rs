//! Inverses of 3x3 matrices in Burn's own tensor operations.

use burn::tensor::Tensor;

/// The inverses of `[K, 3, 3]`, by cofactors, and the determinants `[K, 1, 1]`. The inverse of a singular
/// matrix is not finite.
pub fn inverse(m: Tensor<3>) -> (Tensor<3>, Tensor<3>) {
    let [k, _, _] = m.dims();
    let row = |i: usize| m.clone().slice([0..k, i..i + 1, 0..3]).reshape([k, 3]);
    let (a, b, c) = (row(0), row(1), row(2));
    let cross = |u: &Tensor<2>, v: &Tensor<2>| {
        let at = |t: &Tensor<2>, i: usize| t.clone().slice([0..k, i % 3..i % 3 + 1]);
        let part = |i: usize| at(u, i + 1) * at(v, i + 2) - at(u, i + 2) * at(v, i + 1);
        Tensor::cat(vec![part(0), part(1), part(2)], 1)
    };
    let first = cross(&b, &c);
    let determinant = (a.clone() * first.clone()).sum_dim(1).reshape([k, 1, 1]);
    let columns = [first, cross(&c, &a), cross(&a, &b)].map(|c| c.reshape([k, 3, 1]));
    let inverse = Tensor::cat(columns.to_vec(), 2) / determinant.clone();
    (inverse, determinant)
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[test]
    fn an_inverse_undoes_a_matrix_that_is_no_rotation() {
        let device = Device::flex();
        let m = Tensor::<3>::from_floats(
            [[[1.0, 0.2, -0.3], [0.4, 1.5, 0.1], [-0.2, 0.6, 0.9]]],
            &device,
        );
        let (inverse, determinant) = inverse(m.clone());
        let product: Vec<f32> = inverse
            .matmul(m)
            .reshape([9])
            .try_into_vec_as()
            .expect("f32");
        for (i, value) in product.iter().enumerate() {
            let expected = if i % 4 == 0 { 1.0 } else { 0.0 };
            assert!((value - expected).abs() < 1e-6, "{product:?}");
        }
        // 1 · 1.29 − 0.2 · 0.38 − 0.3 · 0.54.
        let determinant: Vec<f32> = determinant.reshape([1]).try_into_vec_as().expect("f32");
        assert!((determinant[0] - 1.052).abs() < 1e-6, "{determinant:?}");
    }
}
