//! The numerical hazards of the method at their extremes: values and gradients stay finite, and
//! where a closed form exists, the error against f64 is bounded.
//!
//! Prints the table of `docs/research/numerics.md`, as the tests of this name in `yoto-ops` print the rows of splats:
//! `cargo test -p yoto-ops -p yoto-avatar --test it extremes:: -- --nocapture --test-threads=1 | grep -o '| .* |'`.

mod model;
#[path = "../../../ops/tests/it/table.rs"]
mod table;

use burn::tensor::{Device, Tensor, TensorData};
use std::f32::consts::{PI, TAU};
use table::{error, report, values};
use yoto_avatar::config::ModelConfig;
use yoto_avatar::motion::body::CanonicalBody;
use yoto_avatar::motion::prior::{canonical_grid, prior};
use yoto_avatar::motion::rotation::rodrigues;
use yoto_avatar::render::composite::composite;
use yoto_avatar::render::samples::Samples;
use yoto_capture::body_box::BodyView;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::{Skeleton, transform};
use yoto_ops::warp::{WarpGrid, warp};

fn skeleton(tip: [f64; 3]) -> Skeleton {
    Skeleton {
        names: vec!["l_knee".into(), "l_ankle".into()],
        parents: vec![None, Some(0)],
        rest: vec![[0.0; 3], tip],
    }
}

#[test]
fn rotations() {
    let device = Device::flex().autodiff();
    for angle in [0.0, 1e-8, 1e-4, 1e-3, PI, TAU, 1e3] {
        let axis = [0.6f32, -0.8, 0.0];
        let vector = axis.map(|a| a * angle);
        let r = Tensor::<2>::from_floats([vector], &device).require_grad();
        let rotation = rodrigues(r.clone());
        let weights =
            Tensor::<1>::from_floats([1.0, -2.0, 0.5, 3.0, 0.7, -1.0, 2.0, 0.3, -0.4], &device);
        let gradient = r
            .grad(&(rotation.clone().reshape([9]) * weights).sum().backward())
            .expect("tracked");
        let exact: Vec<f64> = transform::rodrigues(vector.map(f64::from))
            .into_iter()
            .flatten()
            .collect();
        let ours = values(rotation);
        // The angle itself has 24 bits: at 1000 rad its last one turns by 6e-5 rad.
        let bound = 1e-6 + f64::from(angle) * 1.2e-7;
        let case = format!("{angle:e} rad");
        report(
            "rotation",
            &case,
            &ours,
            &values(gradient),
            Some(error(&ours, &exact)),
            bound,
        );
    }
}

#[test]
fn bones_in_the_prior() {
    // One blob, by its formula.
    let weight = |p: [f64; 3], tip: [f64; 3]| {
        let length = tip.iter().map(|t| t * t).sum::<f64>().sqrt();
        let axis = if length > 0.0 {
            tip.map(|t| t / length)
        } else {
            [0.0, 1.0, 0.0]
        };
        let offset: [f64; 3] = std::array::from_fn(|a| p[a] - tip[a] / 2.0);
        let along: f64 = (0..3).map(|a| offset[a] * axis[a]).sum();
        let across = offset.iter().map(|o| o * o).sum::<f64>() - along * along;
        (-(across / 0.06f64.powi(2) + along * along / 0.12f64.powi(2))).exp()
    };
    let leaf = |p: [f64; 3], tip: [f64; 3]| {
        let square: f64 = (0..3).map(|a| (p[a] - tip[a]).powi(2)).sum();
        (-square / 0.04f64.powi(2)).exp()
    };
    for (case, tip) in [
        ("along +y", [0.0, 0.4, 0.0]),
        ("along −y", [0.0, -0.4, 0.0]),
        ("no length: joints at one point", [0.0; 3]),
        ("1e-7 m", [0.0, 1e-7, 0.0]),
        ("10 m", [6.0, -8.0, 0.0]),
    ] {
        let skeleton = skeleton(tip);
        let grid = canonical_grid(&skeleton, [9; 3], 0.0);
        let ours = prior(&skeleton, &grid);
        let mut exact = vec![0f64; ours.len()];
        for voxel in 0..729 {
            let index = [voxel % 9, voxel / 9 % 9, voxel / 81];
            let p = std::array::from_fn(|a| {
                let (low, high) = (f64::from(grid.min[a]), f64::from(grid.max[a]));
                low + (high - low) * index[a] as f64 / 8.0
            });
            let (bone, end) = (weight(p, tip), leaf(p, tip));
            let background = 1.0 - (bone + end).min(1.0);
            let total = (bone + end + background).max(1e-3);
            exact[voxel] = bone / total;
            exact[729 + voxel] = end / total;
            exact[2 * 729 + voxel] = background / total;
        }
        report(
            "prior, a bone",
            case,
            &ours,
            &[],
            Some(error(&ours, &exact)),
            1e-6,
        );
    }
}

#[test]
fn densities_and_steps() {
    let device = Device::flex().autodiff();
    for density in [0f32, 1e-9, 1.0, 1e3, 1e10] {
        for step in [1e-9f32, 1e-2, 1e10] {
            for likelihood in [0f32, 0.5, 1.0] {
                let samples = Samples {
                    rays: 2,
                    per_ray: 3,
                    steps: vec![step; 3],
                    depths: vec![1.0, 2.0, 3.0],
                    places: vec![0, 1, 2],
                    ..Samples::default()
                };
                let leaf = |v: Vec<f32>| {
                    let n = v.len();
                    Tensor::<1>::from_data(TensorData::new(v, [n]), &device).require_grad()
                };
                let (rgb, sigma, m) = (
                    leaf(vec![0.2, 0.4, 0.6, 0.8, 0.1, 0.3, 0.5, 0.7, 0.9]),
                    leaf(vec![density; 3]),
                    leaf(vec![likelihood; 3]),
                );
                let seen = composite(
                    &samples,
                    0.0,
                    None,
                    rgb.clone().reshape([3, 3]),
                    sigma.clone(),
                    m.clone(),
                );
                let output = Tensor::cat(vec![seen.rgb.reshape([6]), seen.alpha, seen.depth], 0);
                let grads = output.clone().sum().backward();
                let gradients = [rgb.grad(&grads), sigma.grad(&grads), m.grad(&grads)]
                    .map(|g| values(g.expect("tracked")))
                    .concat();
                let alpha =
                    -(-f64::from(density) * f64::from(step)).exp_m1() * f64::from(likelihood);
                let (mut clear, mut exact) = (1f64, vec![0f64; 10]);
                for (i, colour) in values(rgb).chunks_exact(3).enumerate() {
                    for c in 0..3 {
                        exact[c] += clear * alpha * f64::from(colour[c]);
                    }
                    exact[6] += clear * alpha;
                    exact[8] += clear * alpha * (i + 1) as f64;
                    clear *= 1.0 - alpha + 1e-10;
                }
                let ours = values(output);
                let case = format!("σ {density:e} /m, step {step:e} m, m {likelihood}");
                report(
                    "compositing",
                    &case,
                    &ours,
                    &gradients,
                    Some(error(&ours, &exact)),
                    2e-6,
                );
            }
        }
    }
}

#[test]
fn warps() {
    let device = Device::flex().autodiff();
    let grid = WarpGrid {
        min: [-1.0; 3],
        max: [1.0; 3],
        nodes: [3; 3],
        floor: 0.0,
    };
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    // Name, weight of every node, transform, point, and expected result.
    type Case = (&'static str, f32, [f32; 12], [f32; 3], [f64; 4]);
    let cases: [Case; 6] = [
        (
            "weights sum to 2",
            1.0,
            identity,
            [0.3, 0.2, 0.1],
            [0.3, 0.2, 0.1, 1.0],
        ),
        ("all weights 0", 0.0, identity, [0.3, 0.2, 0.1], [0.0; 4]),
        (
            "weights of 1e-30",
            1e-30,
            identity,
            [0.3, 0.2, 0.1],
            [0.0, 0.0, 0.0, 0.0],
        ),
        (
            "coordinates of 1e4",
            0.5,
            identity,
            [1e4, -1e4, 1e4],
            [0.0; 4],
        ),
        (
            "a point on the box's corner",
            0.25,
            identity,
            [1.0, 1.0, 1.0],
            [1.0, 1.0, 1.0, 0.5],
        ),
        (
            "a transform of 0",
            0.5,
            [0.0; 12],
            [0.3, 0.2, 0.1],
            [0.0, 0.0, 0.0, 1.0],
        ),
    ];
    for (case, weight, transform, point, exact) in cases {
        let weights = Tensor::<2>::full([3, 27], weight, &device).require_grad();
        let transforms = Tensor::<1>::from_floats(transform, &device)
            .reshape([1, 12])
            .repeat_dim(0, 2)
            .require_grad();
        let points = Tensor::<2>::from_floats([point], &device);
        let output = warp(weights.clone(), transforms.clone(), points, &grid);
        let grads = output.clone().sum().backward();
        let gradients = [weights.grad(&grads), transforms.grad(&grads)]
            .map(|g| values(g.expect("tracked")))
            .concat();
        let ours = values(output);
        report(
            "warp",
            case,
            &ours,
            &gradients,
            Some(error(&ours, &exact)),
            1e-6,
        );
    }
}

#[test]
fn cameras_and_rays() {
    let config = ModelConfig::named("draft", "yoto").expect("a tier");
    let body = CanonicalBody::new(skeleton([0.0, 0.4, 0.0]), &config, &Device::flex());
    // The box reaches from −0.3 to 0.3, 0.7 and 0.3 m.
    let camera = |focal: f64, eye: [f64; 3], towards: [f64; 3]| {
        Camera::look_at(eye, towards, [0.0, 1.0, 0.0], focal, 64, 64)
    };
    let front = [0.0, 0.2, 3.0];
    let middle = [0.0, 0.2, 0.0];
    let cases = [
        (
            "through the middle",
            camera(80.0, front, middle),
            32.0,
            Some([2.7, 3.3]),
        ),
        ("misses", camera(80.0, front, middle), 0.0, None),
        (
            "starts inside the box",
            camera(80.0, middle, [0.0, 0.2, -1.0]),
            32.0,
            Some([0.0, 0.3]),
        ),
        (
            "looks away",
            camera(80.0, front, [0.0, 0.2, 6.0]),
            32.0,
            None,
        ),
        (
            "focal length 1",
            camera(1.0, front, middle),
            32.0,
            Some([2.7, 3.3]),
        ),
        (
            "focal length 1e6",
            camera(1e6, front, middle),
            32.0,
            Some([2.7, 3.3]),
        ),
        (
            "grazes a face",
            camera(80.0, [0.3 - 1e-9, 0.2, 3.0], [0.3 - 1e-9, 0.2, 0.0]),
            32.0,
            Some([2.7, 3.3]),
        ),
        (
            "10 km away",
            camera(1e6, [0.0, 0.2, 1e4], middle),
            32.0,
            Some([9999.7, 10000.3]),
        ),
    ];
    for (case, camera, u, exact) in cases {
        let ray = BodyView::new(&body.skeleton, &Pose::rest(2), &camera).ray(u, 32.0);
        assert_eq!(ray.is_some(), exact.is_some(), "{case}: {ray:?}");
        let numbers = ray.map_or(Vec::new(), |ray| vec![ray.near, ray.far]);
        let error = exact.map(|exact| error(&numbers, &exact));
        report("ray", case, &numbers, &[], error, 1e-6);
    }
}
