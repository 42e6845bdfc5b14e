//! GPUs over Vulkan, with Burn's wgpu backend.

use super::PickedDevice;
use burn::tensor::wgpu::WgpuBackend;
use burn::tensor::{Device, DeviceKind, DeviceType};
use yoto_proto::v1::WorkerDevice;

/// The first real GPU that opens: discrete before integrated before virtual.
pub(super) fn pick() -> Option<PickedDevice> {
    let found = Device::enumerate(DeviceType::Wgpu).into_vec();
    candidates(found.len())
        // Comparing needs no driver call. Software Vulkan has the kind `Cpu`, which is not a candidate.
        .filter(|kind| found.contains(&Device::wgpu(kind.clone())))
        .find_map(open)
}

/// All candidates among `adapters` adapters, best first.
fn candidates(adapters: usize) -> impl Iterator<Item = DeviceKind> {
    let kinds: [fn(usize) -> DeviceKind; 3] = [
        DeviceKind::DiscreteGpu,
        DeviceKind::IntegratedGpu,
        DeviceKind::VirtualGpu,
    ];
    kinds
        .into_iter()
        .flat_map(move |kind| (0..adapters).map(kind))
}

/// Opens the adapter; a failure of its driver is logged, and the adapter skipped.
fn open(kind: DeviceKind) -> Option<PickedDevice> {
    let options = Device::wgpu_options()
        .graphics_api(WgpuBackend::Vulkan)
        .device_kind(kind.clone());
    let device = match options.init() {
        Ok(device) => device,
        Err(error) => {
            tracing::warn!(?kind, %error, "a GPU was found but can't be opened");
            return None;
        }
    };
    let adapter = device
        .identity()
        .map_or_else(|| format!("{kind:?}"), |identity| identity.name);
    Some(PickedDevice {
        device,
        info: WorkerDevice {
            backend: "vulkan".into(),
            adapter,
            gpu: true,
            // wgpu does not report a GPU's memory.
            memory_bytes: 0,
        },
    })
}
