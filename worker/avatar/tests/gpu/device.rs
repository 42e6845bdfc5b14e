//! The device that the tests run on, and what keeps them from running for ever.

use burn::tensor::wgpu::WgpuBackend;
use burn::tensor::{Device, DeviceKind, DeviceType};
use std::sync::{Mutex, OnceLock, mpsc};
use std::time::{Duration, Instant};

/// Names the environment variable that makes a missing device a failure.
const REQUIRED: &str = "YOTO_TEST_VULKAN";

/// The first Vulkan device: a GPU before a software one.
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
        // Found, perhaps, but through OpenGL alone.
        .ok()?;
    let name = device.identity().map(|identity| identity.name);
    println!("Vulkan device: {}", name.unwrap_or_default());
    Some(device)
}

/// Runs `test` on the Vulkan device, and fails it when it takes longer than `seconds`: a
/// driver that hangs must not hang the whole run. One test at a time, so that each has all of
/// the device; its time starts when its turn comes.
pub fn on_vulkan(seconds: u64, test: impl FnOnce(Device) + Send + 'static) {
    static DEVICE: OnceLock<Option<Device>> = OnceLock::new();
    static TURN: Mutex<()> = Mutex::new(());
    // A test that failed leaves the device in order.
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
        // Dropped before in a panic, which ends the wait as well.
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
