//! The most memory that this process has held.

/// Peak resident memory, bytes, since the process began or [`reset`]; `None` where the system
/// does not tell (it is Linux's `VmHWM`).
pub(super) fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kibibytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(1024 * kibibytes)
}

/// Makes what is held now the peak. Without the right to, the peak stays that of the process.
pub(super) fn reset() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn the_peak_rises_with_what_is_held() {
        let before = peak_bytes().expect("Linux tells");
        let held = std::hint::black_box(vec![1u8; 64 << 20]);
        let after = peak_bytes().expect("Linux tells");
        assert!(after >= before.min(held.len() as u64), "{before} {after}");
        assert!(after >= held.len() as u64);
    }
}
