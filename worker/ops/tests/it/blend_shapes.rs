use crate::{numbers, relative_error, values};
use burn::tensor::{Device, Tensor};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use yoto_ops::blend_shapes::{blend_shapes, reference};

#[test]
fn the_offsets_of_blend_shapes_equal_burns() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(29);
    // One block of points, a part of one, and several with a rest.
    for (points, joints, shapes) in [(1024, 24, 8), (5, 3, 1), (1, 1, 5), (2_500, 24, 11)] {
        // Most joints are far from a point.
        let near = numbers(&mut rng, [points, joints], -2.0, 1.0, &device).clamp_min(0.0);
        let near = near.slice_fill([0..1, 0..1], 1.0);
        let by_joint = numbers(&mut rng, [joints, 3 * shapes], -0.1, 0.1, &device).require_grad();
        let weights = numbers(&mut rng, [points, shapes], -1.0, 1.0, &device).require_grad();
        let towards = numbers(&mut rng, [points, 3], -1.0, 1.0, &device);

        type Form = fn(Tensor<2>, Tensor<2>, Tensor<2>) -> Tensor<2>;
        let run = |form: Form| {
            let moved = form(near.clone(), by_joint.clone(), weights.clone());
            let grads = (moved.clone() * towards.clone()).sum().backward();
            let gradient = |of: &Tensor<2>| values(of.grad(&grads).expect("tracked"));
            [values(moved), gradient(&by_joint), gradient(&weights)]
        };
        let ours = run(blend_shapes);
        let expected = run(reference::blend_shapes);
        for (what, (ours, expected)) in ["offsets", "to joints", "to weights"]
            .iter()
            .zip(ours.iter().zip(&expected))
        {
            let error = relative_error(ours, expected);
            assert!(
                error < 2e-6,
                "{what}, {points} x {joints} x {shapes}: {error:e}"
            );
        }
    }
}
