use crate::{numbers, relative_error, values};
use burn::tensor::{Device, Tensor, TensorData};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use yoto_ops::splat::{Splats, View, reference, splat};

/// A camera two metres from the body, rotated a little, with a skew; its picture ends inside tiles.
pub(crate) fn view() -> View {
    View {
        width: 37,
        height: 29,
        k: [[60.0, 1.5, 18.0], [0.0, 58.0, 15.0]],
        e: [
            [0.995, 0.0, 0.0998, 0.05],
            [0.0, 1.0, 0.0, -0.02],
            [-0.0998, 0.0, 0.995, 2.0],
        ],
        world: [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    }
}

/// `count` splats within half a metre, each with a transform of its own.
pub(crate) fn splats(count: usize, opacities: [f32; 2], device: &Device) -> Splats {
    let mut rng = ChaCha8Rng::seed_from_u64(count as u64);
    let mut draw = |columns, low, high| numbers(&mut rng, [count, columns], low, high, device);
    let plain = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let plain = Tensor::<1>::from_floats(plain, device).unsqueeze::<2>();
    let track = |tensor: Tensor<2>| tensor.detach().require_grad();
    Splats {
        transforms: track(draw(12, -0.2, 0.2) + plain),
        means: track(draw(3, -0.5, 0.5)),
        rotations: track(draw(4, -1.0, 1.0) + 0.3),
        scales: track(draw(3, -4.0, -2.0)),
        opacities: draw(1, opacities[0], opacities[1])
            .reshape([count])
            .detach()
            .require_grad(),
        colours: track(draw(3, 0.1, 0.9)),
        harmonics: Some(track(draw(24, -0.3, 0.3))),
        light: numbers(&mut rng, [3, 8], -0.3, 0.3, device).require_grad(),
    }
}

type Form = fn(Splats, &View) -> Tensor<2>;

/// The picture, and the gradients of a sum over it to all inputs.
fn run(form: Form, splats: &Splats, view: &View, device: &Device) -> Vec<(&'static str, Vec<f32>)> {
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    let picture = form(splats.clone(), view);
    let towards = numbers(&mut rng, picture.dims(), -1.0, 1.0, device);
    let grads = (picture.clone() * towards).sum().backward();
    let gradient = |tensor: &Tensor<2>| values(tensor.grad(&grads).expect("tracked"));
    vec![
        ("picture", values(picture)),
        ("transforms", gradient(&splats.transforms)),
        ("means", gradient(&splats.means)),
        ("rotations", gradient(&splats.rotations)),
        ("scales", gradient(&splats.scales)),
        (
            "opacities",
            values(splats.opacities.grad(&grads).expect("tracked")),
        ),
        ("colours", gradient(&splats.colours)),
        (
            "harmonics",
            gradient(splats.harmonics.as_ref().expect("of degree 2")),
        ),
        ("light", gradient(&splats.light)),
    ]
}

fn assert_equals_the_reference(splats: &Splats, device: &Device, bound: f32) {
    let ours = run(splat, splats, &view(), device);
    let theirs = run(reference::splat, splats, &view(), device);
    for ((name, ours), (_, theirs)) in ours.iter().zip(&theirs) {
        let error = relative_error(ours, theirs);
        assert!(error < bound, "{name}: {error:e}");
    }
}

#[test]
fn tiles_equal_the_reference_for_transparent_and_opaque_splats() {
    let device = Device::flex().autodiff();
    for (count, opacities) in [(1, [-1.0, 1.0]), (40, [-6.0, 6.0])] {
        assert_equals_the_reference(&splats(count, opacities, &device), &device, 2e-4);
    }
}

#[test]
fn splats_behind_many_opaque_ones_may_be_left_out() {
    let device = Device::flex().autodiff();
    let mut many = splats(120, [2.0, 6.0], &device);
    let large = Tensor::<2>::full([120, 3], -1.5, &device);
    many.scales = large.require_grad();
    assert_equals_the_reference(&many, &device, 3e-3);
}

#[test]
fn splats_behind_the_camera_or_not_finite_are_neither_seen_nor_learned() {
    let device = Device::flex().autodiff();
    let mut some = splats(3, [3.0, 4.0], &device);
    let means = vec![0.0f32, 0.0, -5.0, f32::NAN, 0.0, 0.0, 0.0, 0.0, 0.0];
    some.means = Tensor::from_data(TensorData::new(means, [3, 3]), &device).require_grad();
    let found = run(splat, &some, &view(), &device);
    for (name, values) in &found {
        assert!(values.iter().all(|v| v.is_finite()), "{name}");
    }
    let (_, to_means) = &found[2];
    assert_eq!(to_means[..6], [0.0; 6]);
    assert!(to_means[6..].iter().any(|v| *v != 0.0), "the third is seen");
}

#[test]
fn a_picture_without_pixels_has_no_result() {
    let device = Device::flex().autodiff();
    let some = splats(3, [3.0, 4.0], &device);
    for (width, height) in [(0, 29), (37, 0)] {
        let none = View {
            width,
            height,
            ..view()
        };
        let found = run(splat, &some, &none, &device);
        assert!(found[0].1.is_empty());
        let mut gradients = found[1..].iter().flat_map(|(_, values)| values);
        assert!(gradients.all(|value| *value == 0.0));
    }
}

#[test]
fn gradients_do_not_depend_on_the_number_of_threads() {
    let device = Device::flex().autodiff();
    let some = splats(40, [-2.0, 4.0], &device);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads")
            .install(|| run(splat, &some, &view(), &device))
    };
    assert_eq!(with(1), with(4));
}
