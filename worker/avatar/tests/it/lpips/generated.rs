//! Weights that the reference script and these tests both generate from the names of tensors, since
//! 14.7 million values are too many to store.

use safetensors::Dtype;
use safetensors::tensor::TensorView;
use std::path::Path;

/// A tensor to write.
pub(crate) struct Named {
    /// Name in torchvision or `lpips`.
    pub name: String,
    /// Shape, outputs first.
    pub shape: Vec<usize>,
    /// Values in row-major order.
    pub values: Vec<f32>,
}

/// Multiples of 2⁻²³ in [−1, 1): splitmix64 over the FNV-1a hash of the name.
fn numbers(name: &str, count: usize) -> impl Iterator<Item = f64> {
    let seed = name.bytes().fold(0xCBF2_9CE4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01B3)
    });
    (1..=count as u64).map(move |i| {
        let mut z = seed.wrapping_add(i.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        (z >> 40) as f64 / f64::from(1 << 23) - 1.0
    })
}

fn named(name: String, shape: Vec<usize>, adjust: impl Fn(f64) -> f64) -> Named {
    let values = numbers(&name, shape.iter().product())
        .map(|v| adjust(v) as f32)
        .collect();
    Named {
        name,
        shape,
        values,
    }
}

/// VGG16 with He scaling and small biases.
pub(crate) fn vgg16() -> Vec<Named> {
    let blocks = [(2, 64), (2, 128), (3, 256), (3, 512), (3, 512)];
    let (mut tensors, mut place, mut inputs) = (Vec::new(), 0, 3);
    for (convolutions, outputs) in blocks {
        for _ in 0..convolutions {
            let bound = (6.0 / (inputs * 9) as f64).sqrt();
            let kernel = vec![outputs, inputs, 3, 3];
            tensors.push(named(format!("features.{place}.weight"), kernel, |v| {
                v * bound
            }));
            let bias = format!("features.{place}.bias");
            tensors.push(named(bias, vec![outputs], |v| v * 0.05));
            (place, inputs) = (place + 2, outputs);
        }
        place += 1;
    }
    tensors
}

/// Linear heads in [0, 1).
pub(crate) fn heads() -> Vec<Named> {
    let channels = [64, 128, 256, 512, 512].into_iter().enumerate();
    channels
        .map(|(layer, channels)| {
            let name = format!("lin{layer}.model.1.weight");
            named(name, vec![1, channels, 1, 1], |v| (v + 1.0) / 2.0)
        })
        .collect()
}

/// Writes them as safetensors.
pub(crate) fn write(tensors: &[Named], path: &Path) {
    let bytes: Vec<Vec<u8>> = tensors
        .iter()
        .map(|t| t.values.iter().flat_map(|v| v.to_le_bytes()).collect())
        .collect();
    let views = tensors.iter().zip(&bytes).map(|(tensor, bytes)| {
        let view = TensorView::new(Dtype::F32, tensor.shape.clone(), bytes);
        (tensor.name.as_str(), view.expect("shape and bytes agree"))
    });
    safetensors::serialize_to_file(views, None, path).expect("the disk takes it");
}
