//! Splatting in Burn's own tensor operations: every splat at every pixel, without tiles. Only the depths
//! are read from the device, to sort the splats.

use super::light::LIGHTS;
use super::{LOW_PASS, MAX_ALPHA, MIN_ALPHA, NEAR, Splats, View};
use burn::tensor::activation::sigmoid;
use burn::tensor::{Int, Tensor, TensorData};

/// The columns of a matrix, `[N, 1]` each.
fn columns<const C: usize>(rows: &Tensor<2>) -> [Tensor<2>; C] {
    std::array::from_fn(|c| rows.clone().narrow(1, c, 1))
}

fn dot<const C: usize>(a: &[Tensor<2>; C], b: &[Tensor<2>; C]) -> Tensor<2> {
    let products = a.iter().zip(b).map(|(a, b)| a.clone() * b.clone());
    products.reduce(|sum, term| sum + term).expect("C is not 0")
}

fn scaled<const C: usize>(a: &[Tensor<2>; C], b: &[f32; C]) -> Tensor<2> {
    let products = a.iter().zip(b).map(|(a, b)| a.clone() * *b);
    products.reduce(|sum, term| sum + term).expect("C is not 0")
}

/// See [`super::splat`].
///
/// # Panics
/// If the device can't be read.
pub fn splat(splats: Splats, view: &View) -> Tensor<2> {
    let splats = splats.with_view_colours(view);
    let device = splats.means.device();
    let [n, _] = splats.means.dims();
    let t: [Tensor<2>; 12] = columns(&splats.transforms);
    let mean: [Tensor<2>; 3] = columns(&splats.means);
    // In the body frame: A and A μ + t
    let linear: [[Tensor<2>; 3]; 3] =
        std::array::from_fn(|r| std::array::from_fn(|c| t[4 * r + c].clone()));
    let body: [Tensor<2>; 3] =
        std::array::from_fn(|r| dot(&linear[r], &mean) + t[4 * r + 3].clone());
    let camera_mean: [Tensor<2>; 3] = std::array::from_fn(|r| {
        let [a, b, c, shift] = view.e[r];
        scaled(&body, &[a, b, c]) + shift
    });

    // R(q / |q|)
    let length = (splats.rotations.clone() * splats.rotations.clone())
        .sum_dim(1)
        .sqrt();
    let [w, x, y, z]: [Tensor<2>; 4] = columns(&(splats.rotations / length));
    let twice = |a: &Tensor<2>, b: &Tensor<2>| a.clone() * b.clone() * 2.0;
    let one = |a: Tensor<2>| a.neg() + 1.0;
    let rotation = [
        [
            one(twice(&y, &y) + twice(&z, &z)),
            twice(&x, &y) - twice(&w, &z),
            twice(&x, &z) + twice(&w, &y),
        ],
        [
            twice(&x, &y) + twice(&w, &z),
            one(twice(&x, &x) + twice(&z, &z)),
            twice(&y, &z) - twice(&w, &x),
        ],
        [
            twice(&x, &z) - twice(&w, &y),
            twice(&y, &z) + twice(&w, &x),
            one(twice(&x, &x) + twice(&y, &y)),
        ],
    ];
    let column = |c: usize| -> [Tensor<2>; 3] { std::array::from_fn(|r| rotation[r][c].clone()) };
    let deviations: [Tensor<2>; 3] = columns(&splats.scales.exp());
    // W R = E A R, column by column
    let axes: [[Tensor<2>; 3]; 3] = std::array::from_fn(|c| {
        let in_body: [Tensor<2>; 3] = std::array::from_fn(|r| dot(&linear[r], &column(c)));
        std::array::from_fn(|r| {
            let [a, b, c, _] = view.e[r];
            scaled(&in_body, &[a, b, c])
        })
    });
    let depth = camera_mean[2].clone().clamp_min(NEAR);
    let [[fx, skew, cx], [_, fy, cy]] = view.k;
    let across = scaled(
        &[camera_mean[0].clone(), camera_mean[1].clone()],
        &[fx, skew],
    );
    let down = camera_mean[1].clone() * fy;
    let square = depth.clone() * depth.clone();
    // J W R S, column by column
    let projected_axes: [[Tensor<2>; 3]; 2] = [
        std::array::from_fn(|k| {
            let [a, b, c] = &axes[k];
            let moved = (a.clone() * fx + b.clone() * skew) / depth.clone()
                - across.clone() / square.clone() * c.clone();
            moved * deviations[k].clone()
        }),
        std::array::from_fn(|k| {
            let [_, b, c] = &axes[k];
            let moved = b.clone() * fy / depth.clone() - down.clone() / square.clone() * c.clone();
            moved * deviations[k].clone()
        }),
    ];
    // Σ' = J W Σ Wᵀ Jᵀ + LOW_PASS I (3DGS, eq. 5)
    let xx = dot(&projected_axes[0], &projected_axes[0]) + LOW_PASS;
    let xy = dot(&projected_axes[0], &projected_axes[1]);
    let yy = dot(&projected_axes[1], &projected_axes[1]) + LOW_PASS;
    let determinant = xx.clone() * yy.clone() - xy.clone() * xy.clone();
    // The centre in the picture
    let u = across / depth.clone() + cx;
    let v = down / depth + cy;

    // n = A R e₃ / |A R e₃| in the world, and the light there
    let normal: [Tensor<2>; 3] = std::array::from_fn(|r| dot(&linear[r], &column(2)));
    let long = dot(&normal, &normal).sqrt();
    let [nx, ny, nz]: [Tensor<2>; 3] =
        std::array::from_fn(|r| scaled(&normal, &view.world[r]) / long.clone());
    let terms = Tensor::cat(
        vec![
            nx.clone(),
            ny.clone(),
            nz.clone(),
            nx.clone() * ny.clone(),
            ny.clone() * nz.clone(),
            nz.clone() * nx.clone(),
            nx.clone() * nx - ny.clone() * ny,
            nz.clone() * nz * 3.0 - 1.0,
        ],
        1,
    );
    assert_eq!(terms.dims(), [n, LIGHTS]);
    let colours = splats.colours * (terms.matmul(splats.light.transpose()) + 1.0);

    // Near to far, without those behind the camera.
    let depths: Vec<f32> = camera_mean[2].clone().try_into_vec_as().expect("f32");
    let mut order: Vec<i64> = (0..n as i64)
        .filter(|i| depths[*i as usize] > NEAR)
        .collect();
    order.sort_by(|a, b| depths[*a as usize].total_cmp(&depths[*b as usize]));
    let count = order.len();
    let order = Tensor::<1, Int>::from_data(TensorData::new(order, [count]), &device);
    let sorted = |tensor: Tensor<2>| tensor.select(0, order.clone());
    let (width, height) = (view.width, view.height);
    let pixels = |of: &dyn Fn(usize) -> usize| {
        let centres: Vec<f32> = (0..width * height).map(|i| of(i) as f32 + 0.5).collect();
        Tensor::<2>::from_data(TensorData::new(centres, [1, width * height]), &device)
    };
    let dx = pixels(&|i| i % width) - sorted(u);
    let dy = pixels(&|i| i / width) - sorted(v);
    // α = min(o exp(−dᵀ Σ'⁻¹ d / 2), MAX_ALPHA) (eq. 4)
    let power = (dx.clone() * dx.clone() * sorted(yy / determinant.clone())
        - dx * dy.clone() * sorted(xy / determinant.clone()) * 2.0
        + dy.clone() * dy * sorted(xx / determinant))
        * -0.5;
    let opacity = sorted(sigmoid(splats.opacities).unsqueeze_dim(1));
    let alpha = (power.exp() * opacity).clamp_max(MAX_ALPHA);
    let clear = alpha.clone().lower_elem(MIN_ALPHA);
    let alpha = alpha.mask_fill(clear, 0.0);
    // C = Σ T α c with T ← T (1 − α) (eq. 2 and 3)
    let mut transmittance = Tensor::<2>::ones([1, width * height], &device);
    let mut weights = Vec::with_capacity(count);
    for i in 0..count {
        let alpha = alpha.clone().narrow(0, i, 1);
        weights.push(transmittance.clone() * alpha.clone());
        transmittance = transmittance * (alpha.neg() + 1.0);
    }
    let weights = Tensor::cat(weights, 0).transpose();
    let opacity = weights.clone().sum_dim(1);
    Tensor::cat(vec![weights.matmul(sorted(colours)), opacity], 1)
}
