//! The products of each form, compiled with its instructions.

use super::arithmetic::{Arithmetic, Plain};
use super::encode::{self, Angles};
use super::product::{self, Fill, Gradient, Product};
use super::vector::Portable;
use crate::Precision;
use crate::form::{Form, InstructionSet};

/// The products of `form` in `precision`. Instructions for bf16 do not change the products of f32.
pub(super) fn kernels(form: Form, precision: Precision) -> &'static Kernels {
    match (form.kind(), precision) {
        #[cfg(target_arch = "x86_64")]
        (InstructionSet::Amx, Precision::Bf16) => &x86::AMX,
        #[cfg(target_arch = "x86_64")]
        (InstructionSet::Avx512Bf16, Precision::Bf16) => &x86::bf16::KERNELS,
        #[cfg(target_arch = "x86_64")]
        (
            InstructionSet::Avx512 | InstructionSet::Avx512Bf16 | InstructionSet::Amx,
            Precision::F32,
        ) => &x86::avx512::KERNELS,
        #[cfg(target_arch = "x86_64")]
        (InstructionSet::Avx512, Precision::Bf16) => &x86::avx512_rounded::KERNELS,
        #[cfg(target_arch = "x86_64")]
        (InstructionSet::Avx2, Precision::F32) => &x86::avx2::KERNELS,
        #[cfg(target_arch = "x86_64")]
        (InstructionSet::Avx2, Precision::Bf16) => &x86::avx2_rounded::KERNELS,
        (InstructionSet::Portable, Precision::F32) => &portable::KERNELS,
        (InstructionSet::Portable, Precision::Bf16) => &portable_rounded::KERNELS,
    }
}

/// The products of one form in one precision. The functions require the form's instructions, and
/// pointers that are valid for the documented shapes.
pub(super) struct Kernels {
    /// Columns per panel.
    pub panel: usize,
    /// The rows of a tile are a multiple of this number.
    pub rows: usize,
    /// In the gradient to a weight, the columns of a factor are rounded up to a multiple of this number.
    pub block: usize,
    /// In packed weights, the columns of a factor are padded with zeros to a multiple of this number of words.
    pub depth: usize,
    /// Target size of a tile's buffers, bytes, and the most rows per tile.
    pub tile: (usize, usize),
    /// Numbers per word of a factor; see [`super::arithmetic`].
    pub pair: usize,
    /// Whether packed weights are rounded to bf16.
    pub rounded: bool,
    /// See [`product::product`].
    pub product: unsafe fn(&Product),
    /// See [`product::gradient`].
    pub gradient: unsafe fn(&Gradient),
    /// See [`product::fill`].
    pub fill: unsafe fn(&Fill),
    /// See [`encode::encode`].
    pub encode: unsafe fn(&Angles, &[f32], &mut [f32], usize),
    /// See [`encode::encode_backward`].
    pub encode_backward: unsafe fn(&Angles, &[f32], &[f32]) -> [f32; 3],
}

impl Kernels {
    /// Words per row and column of a packed weight for `width` numbers.
    pub(super) fn words(&self, width: usize) -> usize {
        width.div_ceil(self.pair).next_multiple_of(self.depth)
    }
}

/// [`Kernels::tile`] of vector instructions: most of a core's second-level cache.
const VECTOR_TILE: (usize, usize) = (800 << 10, 240);

/// Instances of the functions of [`product`] and [`encode`], compiled with some instructions.
macro_rules! kernels {
    ($name:ident, $arithmetic:ty, $rounded:literal, $rows:literal, $block:literal $(, $features:literal)?) => {
        #[doc = concat!("Instances for `", stringify!($arithmetic), "`.")]
        pub(super) mod $name {
            use super::*;

            $(#[target_feature(enable = $features)])?
            unsafe fn product(task: &Product) {
                // SAFETY: as the caller promises.
                unsafe { product::product::<$arithmetic, $rows>(task) }
            }

            $(#[target_feature(enable = $features)])?
            unsafe fn gradient(task: &Gradient) {
                // SAFETY: as the caller promises.
                unsafe { product::gradient::<$arithmetic, $block>(task) }
            }

            $(#[target_feature(enable = $features)])?
            unsafe fn fill(task: &Fill) {
                // SAFETY: as the caller promises.
                unsafe { product::fill::<$arithmetic>(task) }
            }

            $(#[target_feature(enable = $features)])?
            unsafe fn encode(angles: &Angles, points: &[f32], to: &mut [f32], stride: usize) {
                encode::encode(angles, points, to, stride)
            }

            $(#[target_feature(enable = $features)])?
            unsafe fn encode_backward(angles: &Angles, encoded: &[f32], grad: &[f32]) -> [f32; 3] {
                encode::encode_backward(angles, encoded, grad)
            }

            pub(in super::super) const KERNELS: Kernels = Kernels {
                panel: <$arithmetic as Arithmetic>::PANEL,
                rows: $rows,
                block: $block,
                depth: 1,
                tile: VECTOR_TILE,
                pair: <$arithmetic as Arithmetic>::PAIR,
                rounded: $rounded,
                product,
                gradient,
                fill,
                encode,
                encode_backward,
            };
        }
    };
}

kernels!(portable, Plain<Portable, false>, false, 4, 4);
kernels!(portable_rounded, Plain<Portable, true>, true, 4, 4);

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::super::amx;
    use super::super::x86::{Avx2, Avx512};
    use super::super::x86_bf16::Bf16;
    use super::*;

    kernels!(avx2, Plain<Avx2, false>, false, 6, 4, "avx2,fma");
    kernels!(avx2_rounded, Plain<Avx2, true>, true, 6, 4, "avx2,fma");
    kernels!(avx512, Plain<Avx512, false>, false, 12, 8, "avx512f,avx512bw");
    kernels!(avx512_rounded, Plain<Avx512, true>, true, 12, 8, "avx512f,avx512bw");
    kernels!(bf16, Bf16, true, 12, 8, "avx512f,avx512bw,avx512bf16");

    /// The products of AMX; everything else is that of the bf16 form.
    pub(super) const AMX: Kernels = Kernels {
        rows: amx::BLOCK,
        block: amx::BLOCK,
        depth: amx::TILE,
        tile: AMX_TILE,
        product: amx::product,
        gradient: amx::gradient,
        ..bf16::KERNELS
    };

    /// [`Kernels::tile`] of AMX.
    const AMX_TILE: (usize, usize) = (6400 << 10, amx::MOST_ROWS);
}
