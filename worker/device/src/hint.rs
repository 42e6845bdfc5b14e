//! A hint for the user on why the CPU is in use.

use std::fs;
use std::path::Path;

/// One line if the CPU is in use where a GPU may be expected: how to build with GPU support, if this
/// build has none and a GPU is visible; or that no GPU can be opened, if it has.
pub fn hint_on_cpu() -> Option<String> {
    if cfg!(feature = "gpu") {
        return (!super::pick().info.gpu).then(|| NO_GPU.to_owned());
    }
    hint(Path::new("/"))
}

/// The hint of a build with GPU support.
const NO_GPU: &str = "no GPU with a Vulkan driver was found, so this build computes on the CPU \
                      (Vulkan in software does not count)";

fn hint(root: &Path) -> Option<String> {
    let vendor = gpu_vendor(root)?;
    Some(format!(
        "this machine has a GPU ({vendor}), but this build computes on the CPU; \
         for the GPU: cargo run --features gpu --bin yoto -- …"
    ))
}

/// Vendor of the GPU under `root`, a file system's root.
fn gpu_vendor(root: &Path) -> Option<&'static str> {
    if ["proc/driver/nvidia/version", "dev/nvidia0"]
        .iter()
        .any(|file| root.join(file).exists())
    {
        return Some("NVIDIA");
    }
    let drm = fs::read_dir(root.join("sys/class/drm")).ok()?;
    let names: Vec<String> = drm
        .flatten()
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    // A card without a render node drives a screen but can't compute.
    if !names.iter().any(|name| name.starts_with("renderD")) {
        return None;
    }
    names
        .iter()
        .filter(|name| name.starts_with("card"))
        .find_map(|card| {
            let vendor =
                fs::read_to_string(root.join("sys/class/drm").join(card).join("device/vendor"));
            match vendor.ok()?.trim() {
                "0x10de" => Some("NVIDIA"),
                "0x1002" => Some("AMD"),
                "0x8086" => Some("Intel"),
                _ => None,
            }
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn machine(files: &[(&str, &str)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().expect("a folder");
        for (file, content) in files {
            let path = root.path().join(file);
            fs::create_dir_all(path.parent().expect("inside the root")).expect("folders");
            fs::write(path, content).expect("a file");
        }
        root
    }

    #[test]
    fn each_vendor_is_seen_and_told_how_to_build() {
        let card = "sys/class/drm/card0/device/vendor";
        let node = ("sys/class/drm/renderD128/dev", "226:128");
        for (files, vendor) in [
            (vec![("dev/nvidia0", "")], "NVIDIA"),
            (vec![("proc/driver/nvidia/version", "")], "NVIDIA"),
            (vec![(card, "0x1002\n"), node], "AMD"),
            (vec![(card, "0x8086\n"), node], "Intel"),
        ] {
            let line = hint(machine(&files).path()).expect("a GPU");
            assert!(
                line.contains(vendor) && line.contains("--features gpu"),
                "{line}"
            );
        }
    }

    #[test]
    fn no_gpu_no_hint() {
        let card = "sys/class/drm/card0/device/vendor";
        let node = ("sys/class/drm/renderD128/dev", "226:128");
        for files in [vec![], vec![(card, "0x1002")], vec![(card, "0x1af4"), node]] {
            assert_eq!(hint(machine(&files).path()), None, "{files:?}");
        }
    }
}
