//! A TensorFlow Lite model: a network that gives the same result twice, or an error.
#![no_main]

// The reader and the network are private to their crate, so their sources are modules here. faer takes many minutes to
// compile with the sanitizer, so a plain product of matrices stands for it.
extern crate self as faer;
#[allow(dead_code)]
#[path = "../../../worker/landmarks/src/network/mod.rs"]
mod network;
#[allow(dead_code)]
#[path = "../../../worker/landmarks/src/tflite/mod.rs"]
mod tflite;

use libfuzzer_sys::fuzz_target;
use network::Network;
use tflite::{Constant, Graph};

/// Most numbers of a tensor, and most operators, of a network that is run.
const SMALL: usize = 1 << 12;

fuzz_target!(|bytes: &[u8]| {
    let Ok(graph) = Graph::read(bytes) else {
        assert!(Network::read(bytes).is_err());
        return;
    };
    let count = graph.tensors.len();
    for operator in &graph.operators {
        assert!(operator.output < count && operator.inputs.iter().all(|&at| at < count));
    }
    let Ok(mut network) = Network::read(bytes) else {
        return;
    };
    if !is_small(&graph) || network.input_len() > SMALL {
        return;
    }
    for (at, value) in network.input().iter_mut().enumerate() {
        *value = at as f32 / 8.0 - 1.0;
    }
    let results = graph.outputs.len();
    let run = |network: &mut Network| -> Vec<Vec<u32>> {
        network.run();
        let bits = |at| {
            network
                .result(at)
                .iter()
                .map(|value| value.to_bits())
                .collect()
        };
        (0..results).map(bits).collect()
    };
    // A buffer that is used too early or too late changes the second result.
    assert_eq!(run(&mut network), run(&mut network));
});

/// Whether a run takes milliseconds, as far as the file's shapes and constants tell.
fn is_small(graph: &Graph) -> bool {
    let of_shape = |shape: &[usize]| {
        shape
            .iter()
            .fold(1usize, |all, &side| all.saturating_mul(side))
    };
    graph.operators.len() <= 16
        && graph.tensors.iter().all(|tensor| {
            let sizes = match &tensor.constant {
                Some(Constant::Ints(values)) => values.iter().all(|value| *value <= 64),
                _ => true,
            };
            sizes && of_shape(&tensor.shape) <= SMALL
        })
}

/// `destination += factor * left * right`, in faer's terms.
pub mod linalg {
    pub mod matmul {
        use crate::{Accum, MatMut, MatRef, Par};

        pub fn matmul(to: MatMut, _: Accum, left: MatRef, right: MatRef, factor: f32, _: Par) {
            for (row, to) in to.0.chunks_exact_mut(to.1).enumerate() {
                for (column, to) in to.iter_mut().enumerate() {
                    for at in 0..left.1 {
                        *to += factor * left.0[row * left.1 + at] * right.0[at * right.1 + column];
                    }
                }
            }
        }
    }
}

pub enum Accum {
    Add,
}

pub enum Par {
    Seq,
}

/// Numbers row after row, and their columns.
#[derive(Clone, Copy)]
pub struct MatRef<'a>(&'a [f32], usize);

impl<'a> MatRef<'a> {
    pub fn from_row_major_slice(numbers: &'a [f32], rows: usize, columns: usize) -> Self {
        assert_eq!(numbers.len(), rows * columns);
        Self(numbers, columns)
    }
}

pub struct MatMut<'a>(&'a mut [f32], usize);

impl<'a> MatMut<'a> {
    pub fn from_row_major_slice_mut(numbers: &'a mut [f32], rows: usize, columns: usize) -> Self {
        assert_eq!(numbers.len(), rows * columns);
        Self(numbers, columns)
    }
}
