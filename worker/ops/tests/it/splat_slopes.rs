//! Gradients of splatting against finite differences in double precision: each parameter of each splat is moved a
//! little, and the picture is computed by the equations, one pixel after the other, without tensors and without the
//! derivatives of the operation.

use super::splat::{splats, view};
use crate::{numbers, values};
use burn::tensor::{Device, Tensor};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use yoto_ops::splat::{LOW_PASS, MAX_ALPHA, MIN_ALPHA, View, splat};

/// Half of the difference between two values of a parameter.
const STEP: f64 = 1e-6;
/// Largest error, relative to the largest slope of the same input: the operation has single precision.
const BOUND: f64 = 1e-4;
/// Numbers per splat: transform, mean, rotation, scales, opacity, colour. View-dependent colours are not among them:
/// Burn's own operations compute them.
const PARTS: [(&str, usize); 6] = [
    ("transforms", 12),
    ("means", 3),
    ("rotations", 4),
    ("scales", 3),
    ("opacities", 1),
    ("colours", 3),
];
/// All of them.
const ROW: usize = 26;

type V3 = [f64; 3];

fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A projected splat.
struct Projected {
    depth: f64,
    at: [f64; 2],
    /// xx, xy, yy.
    covariance: V3,
    opacity: f64,
    colour: V3,
}

/// The projection of the splat with the numbers `row`.
fn project(row: &[f64], light: &[f64], view: &View) -> Projected {
    let (t, rest) = row.split_at(12);
    let linear = |r: usize| -> V3 { [t[4 * r], t[4 * r + 1], t[4 * r + 2]] };
    let mean = [rest[0], rest[1], rest[2]];
    let to_camera = |v: V3, shift: f64| -> V3 {
        std::array::from_fn(|r| {
            let [a, b, c, d] = view.e[r].map(f64::from);
            dot([a, b, c], v) + shift * d
        })
    };
    let body = std::array::from_fn(|r| dot(linear(r), mean) + t[4 * r + 3]);
    let [x, y, depth] = to_camera(body, 1.0);
    let rotation = &rest[3..7];
    let length = rotation.iter().map(|v| v * v).sum::<f64>().sqrt();
    let [w, i, j, k] = [0, 1, 2, 3].map(|at| rotation[at] / length);
    let axes = [
        [
            1.0 - 2.0 * (j * j + k * k),
            2.0 * (i * j + w * k),
            2.0 * (i * k - w * j),
        ],
        [
            2.0 * (i * j - w * k),
            1.0 - 2.0 * (i * i + k * k),
            2.0 * (j * k + w * i),
        ],
        [
            2.0 * (i * k + w * j),
            2.0 * (j * k - w * i),
            1.0 - 2.0 * (i * i + j * j),
        ],
    ];
    let in_body = |axis: V3| -> V3 { std::array::from_fn(|r| dot(linear(r), axis)) };
    let [[fx, skew, cx], [_, fy, cy]] = view.k.map(|row| row.map(f64::from));
    // The three axes in the picture, pixels.
    let arms = [0, 1, 2].map(|axis: usize| {
        let [a, b, c] = to_camera(in_body(axes[axis]), 0.0);
        let deviation = rest[7 + axis].exp();
        let across = (fx * a + skew * b) / depth - (fx * x + skew * y) / (depth * depth) * c;
        let down = fy * b / depth - fy * y / (depth * depth) * c;
        [across * deviation, down * deviation]
    });
    let sum = |p: usize, q: usize| arms.iter().map(|arm| arm[p] * arm[q]).sum::<f64>();
    let low_pass = f64::from(LOW_PASS);
    let normal = in_body(axes[2]);
    let long = dot(normal, normal).sqrt();
    let [nx, ny, nz]: V3 =
        std::array::from_fn(|r| dot(view.world[r].map(f64::from), normal) / long);
    let terms = [
        nx,
        ny,
        nz,
        nx * ny,
        ny * nz,
        nz * nx,
        nx * nx - ny * ny,
        3.0 * nz * nz - 1.0,
    ];
    let lit = |c: usize| 1.0 + (0..8).map(|at| light[8 * c + at] * terms[at]).sum::<f64>();
    Projected {
        depth,
        at: [(fx * x + skew * y) / depth + cx, fy * y / depth + cy],
        covariance: [sum(0, 0) + low_pass, sum(0, 1), sum(1, 1) + low_pass],
        opacity: 1.0 / (1.0 + (-rest[10]).exp()),
        colour: std::array::from_fn(|c| rest[11 + c] * lit(c)),
    }
}

/// The sum over the picture of `towards`, `[H W, 4]`.
fn sum(rows: &[f64], light: &[f64], view: &View, towards: &[f32]) -> f64 {
    let projected = rows.chunks(ROW).map(|row| project(row, light, view));
    let mut projected: Vec<Projected> = projected.collect();
    projected.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    let mut sum = 0.0;
    for (pixel, towards) in towards.as_chunks::<4>().0.iter().enumerate() {
        let centre = [pixel % view.width, pixel / view.width].map(|v| v as f64 + 0.5);
        let (mut transmittance, mut seen) = (1.0, [0.0; 4]);
        for splat in &projected {
            let [dx, dy] = [0, 1].map(|axis| centre[axis] - splat.at[axis]);
            let [xx, xy, yy] = splat.covariance;
            let power = (dx * dx * yy - 2.0 * dx * dy * xy + dy * dy * xx) / (xx * yy - xy * xy);
            let alpha = (splat.opacity * (-0.5 * power).exp()).min(f64::from(MAX_ALPHA));
            if alpha < f64::from(MIN_ALPHA) {
                continue;
            }
            for (c, colour) in splat.colour.into_iter().chain([1.0]).enumerate() {
                seen[c] += transmittance * alpha * colour;
            }
            transmittance *= 1.0 - alpha;
        }
        sum += (0..4).map(|c| f64::from(towards[c]) * seen[c]).sum::<f64>();
    }
    sum
}

#[test]
fn gradients_are_slopes_in_double_precision() {
    let device = Device::flex().autodiff();
    let (view, mut some) = (view(), splats(9, [-2.0, 3.0], &device));
    some.harmonics = None;
    let picture = splat(some.clone(), &view);
    let mut rng = ChaCha8Rng::seed_from_u64(78);
    let weights = numbers(&mut rng, picture.dims(), -1.0, 1.0, &device);
    let towards = values(weights.clone());
    let grads = (picture * weights).sum().backward();
    let of = |tensor: &Tensor<2>| {
        let gradient = values(tensor.grad(&grads).expect("tracked"));
        (values(tensor.clone()), gradient)
    };
    let opacities = values(some.opacities.grad(&grads).expect("tracked"));
    let parts = [
        of(&some.transforms),
        of(&some.means),
        of(&some.rotations),
        of(&some.scales),
        (values(some.opacities.clone()), opacities),
        of(&some.colours),
    ];
    let mut rows = Vec::new();
    for splat in 0..9 {
        for ((_, columns), (given, _)) in PARTS.iter().zip(&parts) {
            let own = &given[splat * columns..][..*columns];
            rows.extend(own.iter().map(|v| f64::from(*v)));
        }
    }
    let light: Vec<f64> = values(some.light.clone())
        .into_iter()
        .map(f64::from)
        .collect();
    let slope = |at: &mut dyn FnMut(f64) -> f64| (at(STEP) - at(-STEP)) / (2.0 * STEP);
    let check = |name: &str, slopes: &[f64], gradient: &[f32]| {
        let largest = slopes.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        assert!(largest > 0.0, "{name}: slopes of 0 prove nothing");
        for (slope, gradient) in slopes.iter().zip(gradient) {
            let error = (slope - f64::from(*gradient)).abs() / largest;
            assert!(error < BOUND, "{name}: {gradient}, not {slope}");
        }
    };

    let mut first = 0;
    for ((name, columns), (_, gradient)) in PARTS.iter().zip(&parts) {
        let indices = (0..9).flat_map(|splat| (0..*columns).map(move |c| splat * ROW + first + c));
        let slopes = indices.map(|index| {
            slope(&mut |by| {
                let mut moved = rows.clone();
                moved[index] += by;
                sum(&moved, &light, &view, &towards)
            })
        });
        check(name, &slopes.collect::<Vec<_>>(), gradient);
        first += columns;
    }
    let slopes = (0..light.len()).map(|index| {
        slope(&mut |by| {
            let mut moved = light.clone();
            moved[index] += by;
            sum(&rows, &moved, &view, &towards)
        })
    });
    check("light", &slopes.collect::<Vec<_>>(), &of(&some.light).1);
}
