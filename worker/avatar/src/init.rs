//! Initial weights. Each tensor draws from a stream of its own, named by the seed and the
//! tensor's path, so that a change to one part of a model leaves the others' start alone and
//! models built side by side don't share a global generator.

use burn::module::{Param, ParamId};
use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};

/// The parameter id of the tensor at `path`. Burn's optimiser files name parameters by id, so a
/// process that resumes a training must give each tensor the same id.
pub(crate) fn id(path: &str) -> ParamId {
    let hash = Sha256::digest(path.as_bytes());
    ParamId::from(
        hash.iter()
            .take(8)
            .fold(0u64, |id, byte| id << 8 | u64::from(*byte)),
    )
}

/// Makes parameters on one device from one seed.
pub(crate) struct Initial<'a> {
    device: &'a Device,
    seed: u64,
}

impl<'a> Initial<'a> {
    pub(crate) fn new(device: &'a Device, seed: u64) -> Self {
        Self { device, seed }
    }

    /// The generator of the tensor at `path`.
    fn stream(&self, path: &str) -> ChaCha8Rng {
        let mut hash = Sha256::new();
        hash.update(self.seed.to_le_bytes());
        hash.update(path.as_bytes());
        ChaCha8Rng::from_seed(hash.finalize().into())
    }

    fn filled<const D: usize>(
        &self,
        path: &str,
        shape: [usize; D],
        mut draw: impl FnMut() -> f32,
    ) -> Param<Tensor<D>> {
        let values: Vec<f32> = (0..shape.iter().product()).map(|_| draw()).collect();
        let tensor = Tensor::from_data(TensorData::new(values, shape), self.device);
        // A model that only renders has nothing to track.
        let tensor = if self.device.is_autodiff() {
            tensor.require_grad()
        } else {
            tensor
        };
        Param::initialized(id(path), tensor)
    }

    /// Uniform in ±`bound`, with equal numbers in all `phases` of a kernel whose stride is half
    /// its size: `index(i, p)` is the index in the tensor of draw `i` in phase `p`. With
    /// unequal phases, a transposed convolution starts as a checkerboard.
    pub(crate) fn phased<const D: usize>(
        &self,
        path: &str,
        shape: [usize; D],
        bound: f64,
        phases: usize,
        index: impl Fn(usize, usize) -> usize,
    ) -> Param<Tensor<D>> {
        let mut stream = self.stream(path);
        let mut values = vec![0f32; shape.iter().product()];
        for draw in 0..values.len() / phases {
            let value = ((stream.random::<f64>() * 2.0 - 1.0) * bound) as f32;
            for phase in 0..phases {
                values[index(draw, phase)] = value;
            }
        }
        let mut values = values.into_iter();
        self.filled(path, shape, || {
            values.next().expect("one value per element")
        })
    }

    /// `values`, row by row.
    ///
    /// # Panics
    /// If there are fewer values than elements.
    pub(crate) fn given<const D: usize>(
        &self,
        path: &str,
        shape: [usize; D],
        values: &[f32],
    ) -> Param<Tensor<D>> {
        let mut values = values.iter();
        self.filled(path, shape, || {
            *values.next().expect("one value per element")
        })
    }

    pub(crate) fn zeros<const D: usize>(&self, path: &str, shape: [usize; D]) -> Param<Tensor<D>> {
        self.filled(path, shape, || 0.0)
    }

    /// Uniform in ±`bound`.
    pub(crate) fn uniform<const D: usize>(
        &self,
        path: &str,
        shape: [usize; D],
        bound: f64,
    ) -> Param<Tensor<D>> {
        let mut stream = self.stream(path);
        self.filled(path, shape, || {
            ((stream.random::<f64>() * 2.0 - 1.0) * bound) as f32
        })
    }

    /// Normal with mean 0 and standard deviation `std`.
    pub(crate) fn normal<const D: usize>(
        &self,
        path: &str,
        shape: [usize; D],
        std: f64,
    ) -> Param<Tensor<D>> {
        let mut stream = self.stream(path);
        self.filled(path, shape, || normal(&mut stream, std))
    }
}

/// A normal draw with mean 0 and standard deviation `std`, by Box and Muller.
fn normal(stream: &mut ChaCha8Rng, std: f64) -> f32 {
    let radius = (-2.0 * (1.0 - stream.random::<f64>()).ln()).sqrt();
    let angle = std::f64::consts::TAU * stream.random::<f64>();
    (std * radius * angle.cos()) as f32
}
