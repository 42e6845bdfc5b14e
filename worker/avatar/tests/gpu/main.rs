//! The `cube` forms on a Vulkan device against the CPU: each operation, a whole training step,
//! a frame. With the feature `gpu` alone.
//!
//! Any Vulkan device will do, a software one too, as nothing here is measured: SwiftShader,
//! for example, by `VK_DRIVER_FILES=/usr/lib/chromium/vk_swiftshader_icd.json`. Without one the
//! tests say so and pass, unless `YOTO_TEST_VULKAN=required`.
#![cfg(feature = "gpu")]

mod compare;
mod device;
mod operations;
mod step;
