//! The device of this machine, found at run time, with a readable name.
//!
//! Only real GPUs are used: software Vulkan is slower than the CPU code that it would replace.
//! A build without GPU support prints how to enable it.

mod cpu;
#[cfg(feature = "gpu")]
mod gpu;
mod hint;

pub use hint::hint_on_cpu;
pub use yoto_ops::form::FormError;

use burn::tensor::Device;
use std::sync::OnceLock;
use yoto_avatar::tradeoff::Machine;
use yoto_ops::form::Form;
use yoto_proto::v1::WorkerDevice;

/// A device, and its description.
#[derive(Debug, Clone)]
pub struct PickedDevice {
    /// The device, without autodiff; training adds it.
    pub device: Device,
    /// Description for the coordinator and for reports.
    pub info: WorkerDevice,
}

/// Checks that this process can run the form of the CPU code that the environment variable `YOTO_CPU` asks for. Each
/// program calls this at its start; afterwards, [`pick`] and the CPU code can't fail for this reason.
///
/// # Errors
/// If the variable names no form, or one that this machine does not have.
pub fn check_cpu_form() -> Result<(), FormError> {
    Form::from_env().map(drop)
}

/// The best device of this machine: a discrete, integrated or virtual GPU when the build
/// supports one and its driver opens it, else the CPU.
///
/// The answer is cached, since a GPU's runtime can be opened only once per process.
///
/// # Panics
/// If [`check_cpu_form`] fails.
pub fn pick() -> PickedDevice {
    static PICKED: OnceLock<PickedDevice> = OnceLock::new();
    PICKED
        .get_or_init(|| {
            #[cfg(feature = "gpu")]
            if let Some(gpu) = gpu::pick() {
                return gpu;
            }
            cpu::pick()
        })
        .clone()
}

/// The CPU, whatever else this machine has.
///
/// # Panics
/// If [`check_cpu_form`] fails.
pub fn cpu() -> PickedDevice {
    cpu::pick()
}

impl PickedDevice {
    /// The source of measured seconds.
    pub fn machine(&self) -> Machine {
        Machine {
            cpu: cpu::model(),
            cores: cpu::threads(),
            device: self.info.adapter.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cpu_is_named_and_never_called_a_gpu() {
        let picked = cpu::pick();
        assert_eq!(picked.info.backend, "cpu");
        assert!(!picked.info.gpu);
        let adapter = &picked.info.adapter;
        assert!(adapter.contains("thread"), "{adapter}");
        assert!(
            adapter.ends_with(&format!("({})", Form::best().name())),
            "{adapter}"
        );
        let machine = picked.machine();
        assert!(machine.device.starts_with(&machine.cpu) && machine.cores > 0);
    }

    #[cfg(feature = "gpu")]
    #[test]
    fn a_gpu_build_that_finds_none_says_so() {
        assert_eq!(hint_on_cpu().is_some(), !pick().info.gpu);
    }

    #[test]
    fn picking_twice_gives_the_same_device() {
        let (first, second) = (pick(), pick());
        assert_eq!(first.device, second.device);
        assert_eq!(first.info, second.info);
        assert!(!first.device.is_autodiff());
    }
}
