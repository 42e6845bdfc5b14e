use crate::{numbers, relative_error, values};
use burn::tensor::{Device, Tensor};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_ops::picture_loss::{Target, Weights, picture_loss, reference};

fn target(region: [usize; 4]) -> Target {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let mut bytes = |count: usize| (0..count).map(|_| rng.random::<u8>()).collect();
    Target {
        width: 43,
        height: 31,
        rgb: bytes(43 * 31 * 3),
        mask: bytes(43 * 31),
        region,
        weights: Weights {
            absolute: 0.8,
            ssim: 0.2,
            mask: 0.1,
        },
    }
}

#[test]
fn the_loss_of_a_picture_equals_the_reference() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(10);
    let picture = numbers(&mut rng, [43 * 31, 4], 0.0, 1.0, &device).require_grad();
    // All of it, a part, and less than a window.
    for region in [[0, 0, 43, 31], [5, 3, 40, 20], [7, 7, 10, 12]] {
        let target = target(region);
        let run = |form: fn(Tensor<2>, &Target) -> Tensor<1>| {
            let terms = form(picture.clone(), &target);
            let grads = (terms.clone().narrow(0, 0, 1) * 3.0).backward();
            [
                values(terms),
                values(picture.grad(&grads).expect("tracked")),
            ]
        };
        let ([terms, slope], [expected, expected_slope]) =
            (run(picture_loss), run(reference::picture_loss));
        assert!(relative_error(&terms, &expected) < 1e-5, "{region:?}");
        let error = relative_error(&slope, &expected_slope);
        assert!(error < 1e-4, "{region:?}: {error:e}");
    }
}
