//! The device that the tests run on, and their time limit.

use burn::tensor::wgpu::WgpuBackend;
use burn::tensor::{Device, DeviceKind, DeviceType};
use std::sync::{Mutex, OnceLock, mpsc};
use std::time::{Duration, Instant};

/// The environment variable that turns a missing device into a failure.
const REQUIRED: &str = "YOTO_TEST_VULKAN";

/// The first Vulkan device, preferring GPUs to software ones.
fn find() -> Option<Device> {
    let found = Device::enumerate(DeviceType::Wgpu).into_vec();
    let gpus: [fn(usize) -> DeviceKind; 3] = [
        DeviceKind::DiscreteGpu,
        DeviceKind::IntegratedGpu,
        DeviceKind::VirtualGpu,
    ];
    let kinds = gpus
        .iter()
        .flat_map(|kind| (0..found.len()).map(kind))
        .chain([DeviceKind::Cpu]);
    let kind = kinds
        .into_iter()
        .find(|kind| found.contains(&Device::wgpu(kind.clone())))?;
    let device = Device::wgpu_options()
        .graphics_api(WgpuBackend::Vulkan)
        .device_kind(kind)
        .init()
        // The device may have been found through OpenGL only.
        .ok()?;
    let name = device.identity().map(|identity| identity.name);
    println!("Vulkan device: {}", name.unwrap_or_default());
    Some(device)
}

/// Runs `test` on the Vulkan device, and fails if it takes longer than `seconds`: a driver that
/// hangs must not hang the whole run. Tests run one at a time, so that each has the device to
/// itself; the time of a test starts with its turn.
pub(crate) fn on_vulkan(seconds: u64, test: impl FnOnce(Device) + Send + 'static) {
    static DEVICE: OnceLock<Option<Device>> = OnceLock::new();
    static TURN: Mutex<()> = Mutex::new(());
    // A failed test leaves the device usable.
    let _turn = TURN.lock().unwrap_or_else(|failed| failed.into_inner());
    let (done, outcome) = mpsc::channel();
    let start = Instant::now();
    let thread = std::thread::spawn(move || {
        let Some(device) = DEVICE.get_or_init(find) else {
            let required = std::env::var(REQUIRED).is_ok_and(|value| value == "required");
            assert!(
                !required,
                "{REQUIRED}=required, but there is no Vulkan device"
            );
            println!("skipped: no Vulkan device");
            return;
        };
        test(device.clone());
        // A panic drops the sender, which also ends the wait.
        done.send(()).ok();
    });
    match outcome.recv_timeout(Duration::from_secs(seconds)) {
        Err(mpsc::RecvTimeoutError::Timeout) => panic!("not done after {seconds} s"),
        _ => {
            if let Err(failure) = thread.join() {
                std::panic::resume_unwind(failure);
            }
        }
    }
    println!("took {:.1} s", start.elapsed().as_secs_f64());
}
