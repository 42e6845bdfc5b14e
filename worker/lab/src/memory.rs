//! Peak memory of a piece of work, as counted by Linux.

use std::{fs, io};

/// Resets the process's peak (Linux: `5` to `clear_refs`).
///
/// # Errors
/// When the system has no such count, or does not allow a process to reset it.
pub(crate) fn reset_peak() -> io::Result<()> {
    fs::write("/proc/self/clear_refs", "5")
}

/// Peak resident memory since [`reset_peak`], bytes; `None` if the system does not report it.
pub(crate) fn peak() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn the_peak_sees_what_was_freed_again() {
        const BYTES: usize = 256 << 20;
        reset_peak().expect("a process may reset its own");
        let before = peak().expect("is told");
        let pages: Vec<u8> = (0..BYTES).map(|i| i as u8).collect();
        assert_eq!(std::hint::black_box(&pages)[300], 44);
        drop(pages);
        let after = peak().expect("is told");
        assert!(after >= before + BYTES as u64 / 2, "{before}, then {after}");
        reset_peak().expect("again");
        assert!(peak().expect("is told") < after, "the count starts anew");
    }
}
