//! The instructions that CPU code runs with. They are chosen when the program runs, so that one
//! build works on every x86 machine and still uses the instructions of newer ones.
//!
//! Networks have separate products for each form ([`super::mlp::cpu`]). Plain loops over
//! fixed-size arrays ([`Work`]) are written once and compiled twice, the second time with AVX2
//! and FMA. With AVX-512 the compiler turns single look-ups into gathers and scatters, with which
//! the hash grid took twice as long as with AVX2 on a Zen 4 processor.
//!
//! Under Miri no instructions are detected, and only the portable form is available.

use std::sync::OnceLock;

/// A set of instructions that this machine has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Form(Kind);

// Only this file makes forms, and only those that the machine can run: to run another is undefined
// behaviour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
    #[cfg(target_arch = "x86_64")]
    Avx512Bf16,
    #[cfg(target_arch = "x86_64")]
    Amx,
}

/// Work that is compiled for each form. `run` must be `#[inline(always)]`, and so must every
/// function that its loops call: only inlined code is compiled for the form.
pub trait Work {
    /// Result of the work.
    type Output;
    /// Does the work. With `FMA`, a fused multiply-add is one instruction; without, it would be a
    /// library call.
    fn run<const FMA: bool>(self) -> Self::Output;
}

impl Form {
    /// All forms that this machine can run, at least the portable one, the best last.
    pub fn available() -> Vec<Self> {
        let mut forms = vec![Self(Kind::Portable)];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            forms.push(Self(Kind::Avx2));
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bw") {
                forms.push(Self(Kind::Avx512));
                if is_x86_feature_detected!("avx512bf16") {
                    forms.push(Self(Kind::Avx512Bf16));
                    if amx_with_bf16() {
                        forms.push(Self(Kind::Amx));
                    }
                }
            }
        }
        forms
    }

    /// The available forms that compile [`Work`] differently, the best last.
    pub fn of_loops() -> Vec<Self> {
        let mut forms = Self::available();
        forms.truncate(2);
        forms
    }

    /// The best form of this machine, detected once.
    pub fn best() -> Self {
        static BEST: OnceLock<Form> = OnceLock::new();
        *BEST.get_or_init(|| {
            let best = Self::available().pop();
            best.expect("every machine runs the portable form")
        })
    }

    /// The instructions, for code with a separate instance for each form.
    pub(super) fn kind(self) -> Kind {
        self.0
    }

    /// Name in test messages and benchmark tables.
    pub fn name(self) -> &'static str {
        match self.0 {
            Kind::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512 => "avx512",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512Bf16 => "avx512 bf16",
            #[cfg(target_arch = "x86_64")]
            Kind::Amx => "amx",
        }
    }

    /// Does `work` with this form's instructions.
    #[inline]
    pub fn run<W: Work>(self, work: W) -> W::Output {
        match self.0 {
            Kind::Portable => work.run::<false>(),
            // SAFETY: forms of these kinds are made only if AVX2 and FMA were detected.
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2 | Kind::Avx512 | Kind::Avx512Bf16 | Kind::Amx => unsafe { with_avx2(work) },
        }
    }
}

/// Whether the processor multiplies matrices of bf16 (AMX) and this process may use its tile
/// registers, for which Linux wants to be asked once: threads that use them need 8 KiB more to be
/// saved in.
#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
fn amx_with_bf16() -> bool {
    /// `ARCH_REQ_XCOMP_PERM` of `arch_prctl`, and the number of the registers' state
    /// (Documentation/arch/x86/xstate.rst of Linux).
    const REQUEST: libc::c_long = 0x1023;
    const TILE_DATA: libc::c_long = 18;
    let leaf = std::arch::x86_64::__cpuid_count(7, 0);
    let (bf16, tiles) = (leaf.edx & 1 << 22 != 0, leaf.edx & 1 << 24 != 0);
    // SAFETY: the call reads no memory; it fails where the kernel or the processor lacks the state.
    bf16 && tiles && unsafe { libc::syscall(libc::SYS_arch_prctl, REQUEST, TILE_DATA) } == 0
}

#[cfg(all(target_arch = "x86_64", not(target_os = "linux")))]
fn amx_with_bf16() -> bool {
    false
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn with_avx2<W: Work>(work: W) -> W::Output {
    work.run::<true>()
}

/// `a b + c`, in one instruction where the form has it.
#[inline(always)]
pub fn multiply_add<const FMA: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FMA { a.mul_add(b, c) } else { a * b + c }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Dot<'a>(&'a [f32], &'a [f32]);

    impl Work for Dot<'_> {
        type Output = f32;
        #[inline(always)]
        fn run<const FMA: bool>(self) -> f32 {
            let pairs = self.0.iter().zip(self.1);
            pairs.fold(0.0, |sum, (a, b)| multiply_add::<FMA>(*a, *b, sum))
        }
    }

    #[test]
    fn every_form_computes_the_same() {
        let values: Vec<f32> = (0..1000u16).map(f32::from).collect();
        let sums: Vec<f32> = Form::available()
            .into_iter()
            .map(|form| form.run(Dot(&values, &values)))
            .collect();
        let exact = 332_833_500.0f32;
        for sum in &sums {
            assert!((sum / exact - 1.0).abs() < 1e-5, "{sum}");
        }
        assert_eq!(Form::available().last(), Some(&Form::best()));
    }
}
