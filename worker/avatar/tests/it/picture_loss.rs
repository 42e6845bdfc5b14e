//! The loss of a picture against evaluation's measures.

use burn::tensor::{Device, Tensor};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_avatar::evaluate::ssim;
use yoto_ops::picture_loss::{Target, Weights, picture_loss};

/// Evaluation's SSIM leaves out pixels whose window leaves the picture; with a border of equal colours,
/// SSIM is 1 there and both have the same shortfall.
#[test]
fn its_ssim_is_that_of_evaluation() {
    let (width, height, border) = (43, 31, 11);
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let target = Target {
        width,
        height,
        rgb: (0..width * height * 3)
            .map(|_| rng.random::<u8>())
            .collect(),
        mask: vec![0; width * height].into(),
        region: [0, 0, width, height],
        weights: Weights {
            absolute: 0.8,
            ssim: 0.2,
            mask: 0.1,
        },
    };
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
    let picture: Vec<f32> = seen
        .chunks_exact(3)
        .flat_map(|rgb| [rgb[0], rgb[1], rgb[2], 0.0])
        .collect();
    let device = Device::flex();
    let picture = Tensor::<1>::from_floats(picture.as_slice(), &device);
    let terms = picture_loss(picture.reshape([width * height, 4]), &target);
    let terms: Vec<f32> = terms.try_into_vec_as().expect("f32");
    let measured = ssim(&seen, &truth, width, height).expect("large enough");
    let windows = ((width - 10) * (height - 10)) as f64;
    let expected = (1.0 - measured) * windows / (width * height) as f64;
    assert!(
        (f64::from(terms[2]) / expected - 1.0).abs() < 1e-4,
        "{} {expected}",
        terms[2]
    );
}
