use crate::{numbers, relative_error, values};
use burn::tensor::{Device, Tensor};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use yoto_ops::deconv;

#[test]
fn doubling_equals_burns_transposed_convolution() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(17);
    // The smallest volume is a single voxel, to which only the middle of a kernel applies.
    for (input, output, side) in [(5, 3, 1), (4, 6, 2), (2, 3, 5)] {
        let volume =
            numbers(&mut rng, [input, side, side, side], -1.0, 1.0, &device).require_grad();
        let kernels =
            numbers(&mut rng, [input, output, 4, 4, 4], -1.0, 1.0, &device).require_grad();
        let doubled = 2 * side;
        let towards = numbers(
            &mut rng,
            [output, doubled, doubled, doubled],
            -1.0,
            1.0,
            &device,
        );

        type Form = fn(Tensor<4>, Tensor<5>) -> Tensor<4>;
        let run = |form: Form| {
            let result = form(volume.clone(), kernels.clone());
            assert_eq!(result.dims(), [output, doubled, doubled, doubled]);
            let grads = (result.clone() * towards.clone()).sum().backward();
            [
                values(result),
                values(volume.grad(&grads).expect("tracked")),
                values(kernels.grad(&grads).expect("tracked")),
            ]
        };
        let (ours, reference) = (
            run(deconv::conv_transpose),
            run(deconv::reference::conv_transpose),
        );
        for (part, (a, b)) in ["output", "volume", "kernels"]
            .iter()
            .zip(ours.iter().zip(&reference))
        {
            let error = relative_error(a, b);
            assert!(error < 2e-6, "{part} from {side} voxels a side: {error:e}");
        }
    }
}
