//! LPIPS against the `lpips` package for Python (cases by `tests/reference/lpips_case.py`), at
//! points where its gradient could fail, and with invalid files.

mod generated;

use crate::support;
use crate::support::{case_file, values};
use burn::tensor::{Device, Tensor, TensorData};
use safetensors::SafeTensors;
use std::path::Path;
use yoto_avatar::config::ModelConfig;
use yoto_avatar::evaluate::LpipsMetric;
use yoto_avatar::loss::lpips::{Lpips, LpipsError, LpipsWeights};
use yoto_avatar::loss::{Objective, PatchObjective, Patches};
use yoto_avatar::train::{TrainError, TrainOptions, Trainer};

const SIDE: usize = 64;

/// Single or double precision, as it was written.
fn case(name: &str) -> Vec<f64> {
    let bytes = std::fs::read(case_file("lpips.safetensors")).expect("the case is there");
    let file = SafeTensors::deserialize(&bytes).expect("safetensors");
    let tensor = file.tensor(name).expect("in the case");
    match tensor.dtype() {
        safetensors::Dtype::F64 => numbers(tensor.data(), f64::from_le_bytes),
        _ => numbers(tensor.data(), |b| f64::from(f32::from_le_bytes(b))),
    }
}

fn numbers<const N: usize>(bytes: &[u8], read: impl Fn([u8; N]) -> f64) -> Vec<f64> {
    let (chunks, rest) = bytes.as_chunks::<N>();
    assert!(rest.is_empty());
    chunks.iter().map(|chunk| read(*chunk)).collect()
}

fn image(name: &str, device: &Device) -> Tensor<4> {
    let values: Vec<f32> = case(name).iter().map(|v| *v as f32).collect();
    Tensor::from_data(TensorData::new(values, [1, 3, SIDE, SIDE]), device)
}

/// From [0, 1] to [−1, 1].
fn signed(image: Tensor<4>) -> Tensor<4> {
    image * 2.0 - 1.0
}

fn off(found: f32, expected: f64) -> f64 {
    (f64::from(found) / expected - 1.0).abs()
}

fn weights(vgg16: &Path, heads: &Path) -> LpipsWeights {
    LpipsWeights {
        vgg16: vgg16.to_owned(),
        heads: heads.to_owned(),
    }
}

fn load(vgg16: &Path, heads: &Path, device: &Device) -> Result<Lpips, LpipsError> {
    Lpips::load(&weights(vgg16, heads), device)
}

/// The generated networks, by way of safetensors files.
fn generated_networks(device: &Device) -> Lpips {
    let dir = tempfile::tempdir().expect("a folder");
    let (vgg16, heads) = (
        dir.path().join("vgg16.safetensors"),
        dir.path().join("heads.safetensors"),
    );
    generated::write(&generated::vgg16(), &vgg16);
    generated::write(&generated::heads(), &heads);
    load(&vgg16, &heads, device).expect("loads")
}

/// The networks, read from files that PyTorch wrote.
fn saved_networks(device: &Device) -> Lpips {
    let (vgg16, heads) = (case_file("lpips_vgg16.pth"), case_file("lpips_heads.pth"));
    load(&vgg16, &heads, device).expect("loads")
}

#[test]
fn distance_and_gradient_are_the_packages() {
    let device = Device::flex().autodiff();
    let lpips = generated_networks(&device);
    let (a, b) = (
        image("image.a", &device).require_grad(),
        image("image.b", &device),
    );
    let distance = lpips.distance(signed(a.clone()), signed(b.clone()));
    let grads = distance.clone().sum().backward();
    let error = off(values(distance)[0], case("distance")[0]);
    println!("distance: {error:.1e}");
    assert!(error < 1e-5, "distance off by {error:e}");

    let gradient = values(a.grad(&grads).expect("tracked"));
    let expected = case("gradient.a");
    let largest = expected.iter().fold(0f64, |m, v| m.max(v.abs()));
    let worst = gradient
        .iter()
        .zip(&expected)
        .map(|(found, expected)| (f64::from(*found) - expected).abs())
        .fold(0.0, f64::max);
    println!("gradient: {:.1e}", worst / largest);
    assert!(
        worst / largest < 1e-4,
        "gradient off by {:e}",
        worst / largest
    );

    let part = |image: Tensor<4>| signed(image.slice([0..1, 0..3, 0..33, 0..47]));
    let distance = lpips.distance(part(a), part(b));
    let error = off(values(distance)[0], case("distance.part")[0]);
    println!("distance of a part: {error:.1e}");
    assert!(error < 1e-5, "distance of a part off by {error:e}");
}

#[test]
fn files_by_pytorch_give_the_packages_distance() {
    let device = Device::flex();
    let metric = LpipsMetric::new(saved_networks(&device), &device);
    let pixels = |name| values(image(name, &device).permute([0, 2, 3, 1]));
    let (a, b) = (pixels("image.a"), pixels("image.b"));
    let distance = metric.distance(&a, &b, SIDE, SIDE).expect("measured");
    let error = (distance / case("distance.files")[0] - 1.0).abs();
    println!("distance: {error:.1e}");
    assert!(error < 1e-5, "off by {error:e}");

    assert!(matches!(
        metric.distance(&a[..15 * 20 * 3], &b[..15 * 20 * 3], 20, 15),
        Err(LpipsError::TooSmall {
            width: 20,
            height: 15
        })
    ));
    assert!(matches!(
        metric.distance(&a, &b[3..], SIDE, SIDE),
        Err(LpipsError::ImageLength { .. })
    ));
}

#[test]
fn gradients_are_finite_where_nothing_differs_and_where_nothing_is_seen() {
    let device = Device::flex().autodiff();
    let mut blind = generated::vgg16();
    for tensor in blind.iter_mut().filter(|t| t.name.ends_with("bias")) {
        // Every activation is zero, whatever the image.
        tensor.values.fill(-1e3);
    }
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("blind.safetensors");
    generated::write(&blind, &path);
    let blind = load(&path, &case_file("lpips_heads.pth"), &device).expect("loads");
    let seeing = saved_networks(&device);
    let a = image("image.a", &device).slice([0..1, 0..3, 0..16, 0..16]);
    let black = Tensor::zeros([1, 3, 16, 16], &device);

    for (what, lpips, a, b) in [
        ("the same image", &seeing, a.clone(), a.clone()),
        ("black images", &seeing, black.clone(), black.clone()),
        ("black against an image", &seeing, black, a.clone()),
        ("no activation", &blind, a.clone(), a.clone() * 0.5),
    ] {
        let a = a.require_grad();
        let distance = lpips.distance(signed(a.clone()), signed(b));
        let grads = distance.clone().sum().backward();
        let distance = values(distance)[0];
        let expected_zero = what != "black against an image";
        assert!(
            distance.is_finite() && (distance == 0.0) == expected_zero,
            "{what}: {distance}"
        );
        let gradient = values(a.grad(&grads).expect("tracked"));
        assert!(gradient.iter().all(|g| g.is_finite()), "{what}");
        assert_eq!(gradient.iter().all(|g| *g == 0.0), expected_zero, "{what}");
    }
}

#[test]
fn files_that_are_not_what_they_should_be_are_named_with_the_tensor() {
    let device = Device::flex();
    let dir = tempfile::tempdir().expect("a folder");
    let (vgg16, heads) = (case_file("lpips_vgg16.pth"), case_file("lpips_heads.pth"));
    let changed = dir.path().join("changed.safetensors");
    let with = |change: &dyn Fn(&mut Vec<generated::Named>)| {
        let mut tensors = generated::heads();
        change(&mut tensors);
        generated::write(&tensors, &changed);
        let error = load(&vgg16, &changed, &device).err();
        error.expect("refused").to_string()
    };
    let refused = with(&|tensors| tensors[2].shape = vec![1, 128, 2, 1]);
    assert!(
        refused.contains("changed.safetensors")
            && refused.contains(
                "'lin2.model.1.weight' has shape [1, 128, 2, 1], expected [1, 256, 1, 1]"
            ),
        "{refused}"
    );
    let refused = with(&|tensors| drop(tensors.pop()));
    assert!(
        refused.contains("no tensor 'lin4.model.1.weight'") && refused.contains("[1, 512, 1, 1]"),
        "{refused}"
    );
    let refused = with(&|tensors| tensors[0].values[5] = f32::NAN);
    assert!(refused.contains("'lin0.model.1.weight'"), "{refused}");

    let refuses = |vgg16: &Path, heads: &Path| {
        let error = load(vgg16, heads, &device).err();
        error.expect("refused").to_string()
    };
    // Exchanged files.
    let refused = refuses(&heads, &vgg16);
    assert!(
        refused.contains("lpips_heads.pth") && refused.contains("'features.0.weight'"),
        "{refused}"
    );
    let refused = refuses(Path::new("/nowhere/vgg16.pth"), &heads);
    assert!(refused.contains("/nowhere/vgg16.pth"), "{refused}");
    for name in ["noise.pth", "noise.safetensors"] {
        let noise = dir.path().join(name);
        std::fs::write(&noise, b"<html>404</html>").expect("written");
        let refused = refuses(&noise, &heads);
        assert!(refused.contains(name), "{refused}");
    }
}

#[test]
fn the_objective_is_lpips_and_a_fifth_of_the_squares() {
    let device = Device::flex();
    let patches = |name, side: usize| {
        let image = image(name, &device);
        let first = image.clone().slice([0..1, 0..3, 0..side, 0..side]);
        let second = image.slice([0..1, 0..3, 20..20 + side, 9..9 + side]);
        Tensor::cat(vec![first, second], 0)
    };
    let (a, b) = (patches("image.a", 32), patches("image.b", 32));
    let lpips = saved_networks(&device);
    let distances = values(lpips.distance(signed(a.clone()), signed(b.clone())));
    let squares = values((a.clone() - b.clone()).square().mean())[0];
    let expected = (distances[0] + distances[1]) / 2.0 + 0.2 * squares;

    let rows = |images: Tensor<4>| images.reshape([2, 3, 32 * 32]).swap_dims(1, 2);
    let objective = PatchObjective::new(Some(lpips), 0.1, 32, &device);
    assert_eq!(objective.name(), "lpips+mse");
    let patches = Patches {
        predicted: rows(a),
        truth: rows(b),
        side: 32,
    };
    let loss = values(objective.loss(patches).expect("terms"))[0];
    assert!((loss / expected - 1.0).abs() < 1e-5, "{loss} {expected}");

    let small = |ssim_weight, patch_size| {
        PatchObjective::new(
            Some(saved_networks(&device)),
            ssim_weight,
            patch_size,
            &device,
        )
        .name()
    };
    assert_eq!((small(0.1, 15), small(0.0, 15)), ("mse+ssim", "mse"));
    assert_eq!(
        PatchObjective::new(None, 0.1, 32, &device).name(),
        "mse+ssim"
    );
}

#[test]
fn a_training_uses_the_weights_that_it_is_given() {
    let (vgg16, heads) = (case_file("lpips_vgg16.pth"), case_file("lpips_heads.pth"));
    let objective = |lpips| trained(lpips).expect("trains");
    assert_eq!(objective(Some(weights(&vgg16, &heads))), "lpips+mse");
    assert_eq!(objective(None), "mse+ssim");
    // Each taken for the other.
    let refused = trained(Some(weights(&heads, &vgg16))).expect_err("refused");
    assert!(matches!(refused, TrainError::Lpips(_)), "{refused}");
}

/// Three steps; the objective they had.
fn trained(lpips: Option<LpipsWeights>) -> Result<&'static str, TrainError> {
    let mut config = ModelConfig::named("draft", "yoto").expect("a tier");
    config.optimise.patches = 2;
    config.optimise.patch_size = 16;
    let options = TrainOptions {
        lpips,
        ..support::options(3)
    };
    let people = support::people(&[0], 4, 48);
    let mut trainer = Trainer::new(config, options, people, &Device::flex())?;
    for _ in 0..3 {
        trainer.step()?;
    }
    let progress = trainer.progress();
    assert!(progress.loss.is_finite() && progress.loss > 0.0);
    assert_eq!(progress.skipped_steps, 0);
    Ok(progress.objective)
}
