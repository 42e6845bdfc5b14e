//! The limit on free space, below which nothing large is begun: a full disk stops the database as well.

use std::path::Path;
use yoto_request::RequestError;

/// Room on a disk, bytes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Room {
    /// Bytes that are free for this process.
    pub free: u64,
    /// All bytes.
    pub total: u64,
}

impl Room {
    /// Of the disk with `folder`; `None` if the system does not report it.
    pub(crate) fn of(folder: &Path) -> Option<Self> {
        Some(Self {
            free: fs4::available_space(folder).ok()?,
            total: fs4::total_space(folder).ok()?,
        })
    }
}

/// Refuses if `disk` would have less than `min_free` bytes free with `coming` more. A disk whose figures
/// can't be told is taken to have room.
pub(crate) fn check(disk: Option<Room>, coming: u64, min_free: u64) -> Result<(), RequestError> {
    let needed = min_free.saturating_add(coming);
    match disk {
        Some(Room { free, .. }) if free < needed => Err(RequestError::DiskFull { free, needed }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_counts_as_well() {
        let disk = |free| Some(Room { free, total: 100 });
        assert!(check(disk(30), 10, 20).is_ok());
        assert!(check(disk(29), 9, 20).is_ok());
        assert!(check(disk(29), u64::MAX, 20).is_err());
        assert!(check(None, 10, 20).is_ok());
        let refused = check(disk(29), 10, 20).expect_err("one byte is missing");
        let text = refused.to_string();
        assert!(text.contains("29 bytes free, and 30 are needed"), "{text}");
    }
}
