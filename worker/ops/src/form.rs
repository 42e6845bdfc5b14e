//! The instructions that CPU code runs with. They are chosen when the program runs, so that one
//! build works on every x86 machine and still uses the instructions of newer ones.
//!
//! Networks have separate products for each form ([`super::mlp::cpu`]). Plain loops over
//! fixed-size arrays ([`Work`]) are written once and compiled twice, the second time with AVX2
//! and FMA. With AVX-512 the compiler turns single look-ups into gathers and scatters, with which
//! the hash grid took twice as long as with AVX2 on a Zen 4 processor.
//!
//! The environment variable [`VARIABLE`] limits the forms of a process to those up to the named one, so that a machine
//! with newer instructions can run, test and measure the forms of older machines. Programs check it at their start
//! with [`Form::from_env`]: a name that does not exist, or a form that the machine does not have, is an error.
//!
//! Under Miri no instructions are detected, and only the portable form is available.

use std::env;
use std::sync::OnceLock;
use thiserror::Error;

/// The environment variable that limits the forms: one of [`NAMES`]. Unset or empty, there is no limit.
pub const VARIABLE: &str = "YOTO_CPU";
/// The names of all forms, from the one that every machine has to the newest instructions.
pub const NAMES: [&str; 5] = ["portable", "avx2", "avx512", "avx512-bf16", "amx"];

/// Why a limit of the forms can't be met.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum FormError {
    /// No form has the name.
    #[error("{VARIABLE}={value} names no form of the CPU code: use {}", NAMES.join(", "))]
    Unknown {
        /// Value of the variable.
        value: String,
    },
    /// The machine does not have the instructions of the form.
    #[error("{VARIABLE}={value}, but this machine has only the forms {available}")]
    Unavailable {
        /// Value of the variable.
        value: String,
        /// Names of the forms that the machine can run.
        available: String,
    },
}

/// A set of instructions that this machine has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Form(InstructionSet);

// Only this file makes forms, and only those that the machine can run: to run another is undefined
// behaviour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum InstructionSet {
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
/// function that its loops call, since only inlined code is compiled for the form.
pub trait Work {
    /// Result of the work.
    type Output;
    /// Does the work. With `FMA`, a fused multiply-add is one instruction; without, it would be a
    /// library call.
    fn run<const FMA: bool>(self) -> Self::Output;
}

impl Form {
    /// The best form of this process: the form that [`VARIABLE`] names, or without it the best that the machine can
    /// run. Both are read once.
    ///
    /// # Errors
    /// If the variable names no form, or one that this machine does not have.
    pub fn from_env() -> Result<Self, FormError> {
        let forms = Self::limited()?;
        Ok(forms
            .last()
            .copied()
            .unwrap_or(Self(InstructionSet::Portable)))
    }

    /// All forms of this process, at least the portable one, the best last: those that the machine can run, up to the
    /// one that [`VARIABLE`] names.
    ///
    /// # Panics
    /// If [`Form::from_env`] fails.
    pub fn available() -> Vec<Self> {
        match Self::limited() {
            Ok(forms) => forms.clone(),
            Err(error) => panic!("{error}"),
        }
    }

    /// [`Self::available`], or the fault of the environment variable.
    fn limited() -> Result<&'static Vec<Self>, FormError> {
        static FORMS: OnceLock<Result<Vec<Form>, FormError>> = OnceLock::new();
        let forms = FORMS.get_or_init(|| {
            let value = env::var_os(VARIABLE).unwrap_or_default();
            up_to(&value.to_string_lossy(), Self::detected())
        });
        forms.as_ref().map_err(Clone::clone)
    }

    /// All forms that this machine can run, the best last.
    fn detected() -> Vec<Self> {
        let mut forms = vec![Self(InstructionSet::Portable)];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            forms.push(Self(InstructionSet::Avx2));
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bw") {
                forms.push(Self(InstructionSet::Avx512));
                if is_x86_feature_detected!("avx512bf16") {
                    forms.push(Self(InstructionSet::Avx512Bf16));
                    if amx_with_bf16() {
                        forms.push(Self(InstructionSet::Amx));
                    }
                }
            }
        }
        forms
    }

    /// The available forms that compile [`Work`] differently, the best last.
    ///
    /// # Panics
    /// As [`Form::available`].
    pub fn of_loops() -> Vec<Self> {
        let mut forms = Self::available();
        forms.truncate(2);
        forms
    }

    /// [`Form::from_env`], for code that runs after the start of a program has checked it.
    ///
    /// # Panics
    /// If [`Form::from_env`] fails and nothing has checked it.
    pub fn best() -> Self {
        static BEST: OnceLock<Form> = OnceLock::new();
        *BEST.get_or_init(|| Self::from_env().unwrap_or_else(|error| panic!("{error}")))
    }

    /// The instructions, for code with a separate instance for each form.
    pub(super) fn kind(self) -> InstructionSet {
        self.0
    }

    /// Name of the form, one of [`NAMES`].
    pub fn name(self) -> &'static str {
        match self.0 {
            InstructionSet::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512 => "avx512",
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512Bf16 => "avx512-bf16",
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Amx => "amx",
        }
    }

    /// Does `work` with this form's instructions.
    #[inline]
    pub fn run<W: Work>(self, work: W) -> W::Output {
        match self.0 {
            InstructionSet::Portable => work.run::<false>(),
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2
            | InstructionSet::Avx512
            | InstructionSet::Avx512Bf16
            | InstructionSet::Amx => {
                // SAFETY: these forms are made only if AVX2 and FMA were detected.
                unsafe { with_avx2(work) }
            }
        }
    }
}

/// The forms of `detected` up to the one with the name `value`; all of them if it is empty.
fn up_to(value: &str, mut detected: Vec<Form>) -> Result<Vec<Form>, FormError> {
    if value.is_empty() {
        return Ok(detected);
    }
    let value = value.to_owned();
    if !NAMES.contains(&value.as_str()) {
        return Err(FormError::Unknown { value });
    }
    match detected.iter().position(|form| form.name() == value) {
        Some(last) => {
            detected.truncate(last + 1);
            Ok(detected)
        }
        None => {
            let names: Vec<&str> = detected.iter().map(|form| form.name()).collect();
            Err(FormError::Unavailable {
                value,
                available: names.join(", "),
            })
        }
    }
}

/// Whether the processor multiplies matrices of bf16 (AMX) and this process may use its tile
/// registers. A process must ask Linux once for this permission, since the registers take 8 KiB more per thread
/// when they are saved.
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
        assert_eq!(Form::from_env(), Ok(Form::best()));
    }

    #[test]
    fn a_limit_keeps_the_forms_up_to_the_named_one() {
        let detected = Form::detected();
        for (i, form) in detected.iter().enumerate() {
            assert_eq!(form.name(), NAMES[i]);
            let forms = up_to(form.name(), detected.clone()).expect("a form of this machine");
            assert_eq!(forms, detected[..=i]);
        }
        assert_eq!(up_to("", detected.clone()), Ok(detected));
    }

    #[test]
    fn a_limit_that_cannot_be_met_is_an_error() {
        let portable = || vec![Form(InstructionSet::Portable)];
        let error = up_to("avx512", portable()).expect_err("it has no AVX-512");
        assert_eq!(
            error.to_string(),
            "YOTO_CPU=avx512, but this machine has only the forms portable"
        );
        let error = up_to("AVX2", portable()).expect_err("names are in lower case");
        assert_eq!(
            error.to_string(),
            "YOTO_CPU=AVX2 names no form of the CPU code: use portable, avx2, avx512, avx512-bf16, amx"
        );
    }
}
