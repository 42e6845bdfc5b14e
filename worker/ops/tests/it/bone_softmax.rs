use crate::{numbers, relative_error, values};
use burn::tensor::{Device, Tensor};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use yoto_ops::bone_softmax::{bone_softmax, reference};

#[test]
fn the_softmax_over_bones_equals_burns() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(23);
    // One block of nodes, a part of one, and several with a rest.
    for (rows, nodes) in [(25, 1024), (3, 7), (1, 5), (9, 2_500)] {
        let logits = numbers(&mut rng, [rows, nodes], -9.0, 9.0, &device).require_grad();
        // Logarithms of weights down to 1e-12.
        let prior = numbers(&mut rng, [rows, nodes], -27.6, 0.0, &device);
        let towards = numbers(&mut rng, [rows, nodes], -1.0, 1.0, &device);

        type Form = fn(Tensor<2>, Tensor<2>) -> Tensor<2>;
        let run = |form: Form| {
            let weights = form(logits.clone(), prior.clone());
            let grads = (weights.clone() * towards.clone()).sum().backward();
            [
                values(weights),
                values(logits.grad(&grads).expect("tracked")),
            ]
        };
        let [weights, to_logits] = run(bone_softmax);
        let [expected, expected_gradient] = run(reference::bone_softmax);
        let error = relative_error(&weights, &expected);
        assert!(error < 1e-6, "{rows} x {nodes}: {error:e}");
        if rows > 1 {
            let error = relative_error(&to_logits, &expected_gradient);
            assert!(error < 2e-6, "gradients, {rows} x {nodes}: {error:e}");
        }
    }
}
