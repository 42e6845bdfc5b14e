//! The `cube` forms on a Vulkan device against the CPU: each operation, a whole training step,
//! a frame. A program of its own, since few builds have the feature `gpu`.
//!
//! Any Vulkan device will do, including software ones, since no time is measured: Debian's
//! `mesa-vulkan-drivers`, by `VK_DRIVER_FILES=/usr/share/vulkan/icd.d/lvp_icd.x86_64.json`, or the
//! SwiftShader in its `chromium`, by `VK_DRIVER_FILES=/usr/lib/chromium/vk_swiftshader_icd.json`.
//! Without a device the tests print that and pass, unless `YOTO_TEST_VULKAN=required`.
//!
//! Use `--features yoto-avatar/gpu`, that is without `autotune`, which compiles a dozen kernels for
//! every shape of a matrix product: ten minutes with a software driver.

mod compare;
mod device;
mod operations;
mod splats;
mod step;
mod surface;
