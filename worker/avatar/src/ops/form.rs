//! Which instructions a CPU form runs with: decided when the program runs, so that one build
//! serves every x86 machine and still uses what a newer one offers.
//!
//! Networks have products of their own for each form ([`super::mlp::cpu`]). Plain loops over
//! fixed-size arrays ([`Work`]) are written once and compiled twice, the second time with AVX2
//! allowed. With AVX-512 allowed, too, the compiler makes gathers and scatters of single look-ups,
//! which took the hash grid twice as long as AVX2 on the Zen processor it was measured on.

use std::sync::OnceLock;

/// Instructions that this machine has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Form(Kind);

// Made in this file alone, so that a form that the machine lacks can't be had: running one is
// undefined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
    #[cfg(target_arch = "x86_64")]
    Avx512Bf16,
}

/// Work that is compiled for each form. `run` must be `#[inline(always)]`, as must all that it
/// calls in its loops: only what is inlined is compiled for the form.
pub trait Work {
    /// What it results in.
    type Output;
    /// Does it. With `FMA`, a fused multiply and add is one instruction; without, it would be a
    /// call into a library.
    fn run<const FMA: bool>(self) -> Self::Output;
}

impl Form {
    /// All forms that this machine can run, the best last.
    pub fn available() -> Vec<Self> {
        let mut forms = vec![Self(Kind::Portable)];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            forms.push(Self(Kind::Avx2));
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bw") {
                forms.push(Self(Kind::Avx512));
                if is_x86_feature_detected!("avx512bf16") {
                    forms.push(Self(Kind::Avx512Bf16));
                }
            }
        }
        forms
    }

    /// Of them, those whose [`Work`] differs, the best last.
    pub fn of_loops() -> Vec<Self> {
        let mut forms = Self::available();
        forms.truncate(2);
        forms
    }

    /// The best of this machine, found once.
    pub fn best() -> Self {
        static BEST: OnceLock<Form> = OnceLock::new();
        *BEST.get_or_init(|| Self::available().pop().unwrap_or(Self(Kind::Portable)))
    }

    /// Which it is, for whoever has instances of their own.
    pub(super) fn kind(self) -> Kind {
        self.0
    }

    /// For figures.
    pub fn name(self) -> &'static str {
        match self.0 {
            Kind::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512 => "avx512",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512Bf16 => "avx512 bf16",
        }
    }

    /// Does `work` with this form's instructions.
    #[inline]
    pub fn run<W: Work>(self, work: W) -> W::Output {
        match self.0 {
            Kind::Portable => work.run::<false>(),
            // SAFETY: a form of these kinds is made only where the CPU was seen to have AVX2 and
            // FMA.
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2 | Kind::Avx512 | Kind::Avx512Bf16 => unsafe { with_avx2(work) },
        }
    }
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
