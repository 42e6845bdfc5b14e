//! Gradients of splatting against finite differences in double precision: each parameter of each splat is moved a
//! little, and the picture is computed without the derivatives of the operation.

use super::splat::{splats, view};
use super::splat_f64::{ROW, sum};
use crate::{numbers, values};
use burn::tensor::{Device, Tensor};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use yoto_ops::splat::splat;

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
