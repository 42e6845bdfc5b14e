//! Splatting in Burn's own tensor operations: every splat at every pixel, without tiles. Only the order
//! of the splats is read from the device.

use super::light::LIGHTS;
use super::{LEAST, LOW_PASS, MOST, NEAR, Sight, Splats};
use burn::tensor::activation::sigmoid;
use burn::tensor::{Int, Tensor, TensorData};

/// Columns of a tensor of rows.
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
pub fn splat(splats: Splats, sight: &Sight) -> Tensor<2> {
    let splats = splats.seen_from(sight);
    let device = splats.means.device();
    let [n, _] = splats.means.dims();
    let t: [Tensor<2>; 12] = columns(&splats.transforms);
    let mean: [Tensor<2>; 3] = columns(&splats.means);
    // Body frame: A μ + t, and A.
    let linear: [[Tensor<2>; 3]; 3] =
        std::array::from_fn(|r| std::array::from_fn(|c| t[4 * r + c].clone()));
    let body: [Tensor<2>; 3] =
        std::array::from_fn(|r| dot(&linear[r], &mean) + t[4 * r + 3].clone());
    let at: [Tensor<2>; 3] = std::array::from_fn(|r| {
        let [a, b, c, shift] = sight.e[r];
        scaled(&body, &[a, b, c]) + shift
    });

    let length = (splats.turns.clone() * splats.turns.clone())
        .sum_dim(1)
        .sqrt();
    let [w, x, y, z]: [Tensor<2>; 4] = columns(&(splats.turns / length));
    let twice = |a: &Tensor<2>, b: &Tensor<2>| a.clone() * b.clone() * 2.0;
    let one = |a: Tensor<2>| a.neg() + 1.0;
    let turn = [
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
    let column = |c: usize| -> [Tensor<2>; 3] { std::array::from_fn(|r| turn[r][c].clone()) };
    let deviations: [Tensor<2>; 3] = columns(&splats.scales.exp());
    // E A R, column by column.
    let turned: [[Tensor<2>; 3]; 3] = std::array::from_fn(|c| {
        let in_body: [Tensor<2>; 3] = std::array::from_fn(|r| dot(&linear[r], &column(c)));
        std::array::from_fn(|r| {
            let [a, b, c, _] = sight.e[r];
            scaled(&in_body, &[a, b, c])
        })
    });
    let depth = at[2].clone().clamp_min(NEAR);
    let [[fx, skew, cx], [_, fy, cy]] = sight.k;
    let across = scaled(&[at[0].clone(), at[1].clone()], &[fx, skew]);
    let down = at[1].clone() * fy;
    let square = depth.clone() * depth.clone();
    // J E A R S, of each axis.
    let flat: [[Tensor<2>; 3]; 2] = [
        std::array::from_fn(|k| {
            let [a, b, c] = &turned[k];
            let moved = (a.clone() * fx + b.clone() * skew) / depth.clone()
                - across.clone() / square.clone() * c.clone();
            moved * deviations[k].clone()
        }),
        std::array::from_fn(|k| {
            let [_, b, c] = &turned[k];
            let moved = b.clone() * fy / depth.clone() - down.clone() / square.clone() * c.clone();
            moved * deviations[k].clone()
        }),
    ];
    let xx = dot(&flat[0], &flat[0]) + LOW_PASS;
    let xy = dot(&flat[0], &flat[1]);
    let yy = dot(&flat[1], &flat[1]) + LOW_PASS;
    let determinant = xx.clone() * yy.clone() - xy.clone() * xy.clone();
    let u = across / depth.clone() + cx;
    let v = down / depth + cy;

    let normal: [Tensor<2>; 3] = std::array::from_fn(|r| dot(&linear[r], &column(2)));
    let long = dot(&normal, &normal).sqrt();
    let [nx, ny, nz]: [Tensor<2>; 3] =
        std::array::from_fn(|r| scaled(&normal, &sight.world[r]) / long.clone());
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
    let depths: Vec<f32> = at[2].clone().try_into_vec_as().expect("f32");
    let mut order: Vec<i64> = (0..n as i64)
        .filter(|i| depths[*i as usize] > NEAR)
        .collect();
    order.sort_by(|a, b| depths[*a as usize].total_cmp(&depths[*b as usize]));
    let seen = order.len();
    let order = Tensor::<1, Int>::from_data(TensorData::new(order, [seen]), &device);
    let sorted = |tensor: Tensor<2>| tensor.select(0, order.clone());
    let (width, height) = (sight.width, sight.height);
    let pixels = |of: &dyn Fn(usize) -> usize| {
        let places: Vec<f32> = (0..width * height).map(|i| of(i) as f32 + 0.5).collect();
        Tensor::<2>::from_data(TensorData::new(places, [1, width * height]), &device)
    };
    let dx = pixels(&|i| i % width) - sorted(u);
    let dy = pixels(&|i| i / width) - sorted(v);
    let power = (dx.clone() * dx.clone() * sorted(yy / determinant.clone())
        - dx * dy.clone() * sorted(xy / determinant.clone()) * 2.0
        + dy.clone() * dy * sorted(xx / determinant))
        * -0.5;
    let opacity = sorted(sigmoid(splats.opacities).unsqueeze_dim(1));
    let alpha = (power.exp() * opacity).clamp_max(MOST);
    let clear = alpha.clone().lower_elem(LEAST);
    let alpha = alpha.mask_fill(clear, 0.0);
    let mut through = Tensor::<2>::ones([1, width * height], &device);
    let mut weights = Vec::with_capacity(seen);
    for i in 0..seen {
        let alpha = alpha.clone().narrow(0, i, 1);
        weights.push(through.clone() * alpha.clone());
        through = through * (alpha.neg() + 1.0);
    }
    let weights = Tensor::cat(weights, 0).transpose();
    let opacity = weights.clone().sum_dim(1);
    Tensor::cat(vec![weights.matmul(sorted(colours)), opacity], 1)
}
