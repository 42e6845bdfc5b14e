use crate::{numbers, relative_error, values};
use burn::tensor::{Device, Tensor, TensorData};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use yoto_ops::warp::WarpGrid;
use yoto_ops::warp::skin::{reference, skin};

/// Two bones, the second of which is rotated by 0.7 rad about z and shifted.
const TRANSFORMS: [f32; 24] = [
    1.0,
    0.0,
    0.0,
    0.1,
    0.0,
    1.0,
    0.0,
    -0.2,
    0.0,
    0.0,
    1.0,
    0.3, //
    0.764_842_2,
    -0.644_217_7,
    0.0,
    0.05,
    0.644_217_7,
    0.764_842_2,
    0.0,
    0.1,
    0.0,
    0.0,
    1.0,
    0.0,
];

fn grid() -> WarpGrid {
    WarpGrid {
        min: [-0.5, -0.6, -0.4],
        max: [0.5, 0.6, 0.4],
        nodes: [5, 7, 4],
        floor: 0.0,
    }
}

type Form = fn(Tensor<2>, Tensor<2>, Tensor<2>, &WarpGrid) -> Tensor<2>;

#[test]
fn forward_skinning_equals_the_reference_inside_and_outside_of_the_box() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    // A background after the bones, which no point may read.
    let weights = numbers(&mut rng, [3, 140], 0.05, 0.4, &device).require_grad();
    let transforms = Tensor::<1>::from_floats(TRANSFORMS, &device);
    let transforms = transforms.reshape([2, 12]).require_grad();
    // More than a block of points; the box ends at ±0.5, ±0.6, ±0.4.
    let points = numbers(&mut rng, [700, 3], -0.9, 0.9, &device).require_grad();
    let towards = numbers(&mut rng, [700, 12], -1.0, 1.0, &device);
    let run = |form: Form| {
        let blended = form(weights.clone(), transforms.clone(), points.clone(), &grid());
        let grads = (blended.clone() * towards.clone()).sum().backward();
        let gradient = |tensor: &Tensor<2>| values(tensor.grad(&grads).expect("tracked"));
        let gradients = [&weights, &transforms, &points].map(gradient);
        (values(blended), gradients)
    };
    let (blended, gradients) = run(skin);
    let (expected, expected_gradients) = run(reference::skin);
    assert!(relative_error(&blended, &expected) < 1e-5);
    let names = ["weights", "transforms", "points"];
    for ((ours, theirs), name) in gradients.iter().zip(&expected_gradients).zip(names) {
        let error = relative_error(ours, theirs);
        assert!(error < 1e-4, "{name}: {error:e}");
    }
}

#[test]
fn a_point_without_weights_moves_with_the_first_bone() {
    let device = Device::flex();
    let weights = Tensor::<2>::zeros([3, 140], &device);
    let transforms = Tensor::<1>::from_floats(TRANSFORMS, &device).reshape([2, 12]);
    let points = Tensor::from_data(TensorData::new(vec![0.1f32, 0.2, 0.3], [1, 3]), &device);
    let blended = values(skin(weights, transforms, points, &grid()));
    let expected = [1.0, 0.0, 0.0, -0.1, 0.0, 1.0, 0.0, 0.2, 0.0, 0.0, 1.0, -0.3];
    assert_eq!(blended, expected);
}
