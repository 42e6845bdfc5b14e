use crate::{numbers, relative_error, values};
use burn::tensor::{Device, Tensor};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_avatar::evaluate::ssim;
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

/// Evaluation's SSIM leaves out pixels whose window leaves the picture; with a border of equal colours,
/// SSIM is 1 there and both have the same shortfall.
#[test]
fn its_ssim_is_that_of_evaluation() {
    let (width, height, border) = (43, 31, 11);
    let mut target = target([0, 0, width, height]);
    let truth: Vec<f32> = target.rgb.iter().map(|v| f32::from(*v) / 255.0).collect();
    let inside = |pixel: usize| {
        let (x, y) = (pixel % width, pixel / width);
        (border..width - border).contains(&x) && (border..height - border).contains(&y)
    };
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let seen: Vec<f32> = (0..width * height * 3)
        .map(|i| match inside(i / 3) {
            true => rng.random(),
            false => truth[i],
        })
        .collect();
    target.mask = vec![0; width * height].into();
    let picture: Vec<f32> = seen
        .chunks_exact(3)
        .flat_map(|rgb| [rgb[0], rgb[1], rgb[2], 0.0])
        .collect();
    let device = Device::flex();
    let picture = Tensor::<1>::from_floats(picture.as_slice(), &device);
    let terms = values(picture_loss(picture.reshape([width * height, 4]), &target));
    let measured = ssim(&seen, &truth, width, height).expect("large enough");
    let windows = ((width - 10) * (height - 10)) as f64;
    let expected = (1.0 - measured) * windows / (width * height) as f64;
    assert!(
        (f64::from(terms[2]) / expected - 1.0).abs() < 1e-4,
        "{} {expected}",
        terms[2]
    );
}
