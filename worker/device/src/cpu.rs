//! The CPU, with Burn's Flex backend.

use super::PickedDevice;
use burn::tensor::Device;
use std::fs;
use yoto_ops::form::Form;
use yoto_proto::v1::WorkerDevice;

/// The CPU, with the form of the CPU code that this process runs, which determines the speed of training: e.g.
/// "AMD EPYC 9654, 2 threads (avx512-bf16)".
pub(super) fn pick() -> PickedDevice {
    let (model, threads) = (model(), threads());
    let plural = if threads == 1 { "" } else { "s" };
    let form = Form::best().name();
    PickedDevice {
        device: Device::flex(),
        info: WorkerDevice {
            backend: "cpu".into(),
            adapter: format!("{model}, {threads} thread{plural} ({form})"),
            gpu: false,
            memory_bytes: memory_bytes().unwrap_or(0),
        },
    }
}

/// The CPU's model, or the architecture if the kernel does not report it.
pub(super) fn model() -> String {
    field("/proc/cpuinfo", "model name").unwrap_or_else(|| std::env::consts::ARCH.into())
}

/// Threads that this process may use.
pub(super) fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// The first value of `name` in a `name: value` file of the kernel.
fn field(file: &str, name: &str) -> Option<String> {
    let text = fs::read_to_string(file).ok()?;
    let line = text.lines().find(|line| line.starts_with(name))?;
    let value = line.split_once(':')?.1.trim();
    (!value.is_empty()).then(|| value.to_owned())
}

fn memory_bytes() -> Option<u64> {
    let kib: u64 = field("/proc/meminfo", "MemTotal")?
        .strip_suffix("kB")?
        .trim()
        .parse()
        .ok()?;
    Some(kib * 1024)
}
