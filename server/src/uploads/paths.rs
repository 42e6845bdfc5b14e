//! Valid file paths in a capture.
//!
//! A path becomes part of an object key and, on a local store, of a file name. The rules
//! keep it inside its capture on every store and every file system.

use std::collections::HashSet;
use yoto_proto::limits::PATH_BYTES;

/// The paths of one capture so far.
#[derive(Debug, Default)]
pub(super) struct CapturePaths {
    files: HashSet<String>,
    folders: HashSet<String>,
}

impl CapturePaths {
    /// Adds `path`; the error says why it can't be part of the capture.
    pub(super) fn add(&mut self, path: &str) -> Result<(), String> {
        check(path)?;
        // Some file systems ignore case.
        let folded = path.to_ascii_lowercase();
        let folders = || {
            folded
                .match_indices('/')
                .filter_map(|(end, _)| folded.get(..end))
        };
        if self.files.contains(&folded) {
            return Err("the capture has this file already".into());
        }
        if self.folders.contains(&folded) || folders().any(|folder| self.files.contains(folder)) {
            return Err("the capture has a file and a folder of the same name".into());
        }
        self.folders.extend(folders().map(str::to_owned));
        self.files.insert(folded);
        Ok(())
    }
}

fn check(path: &str) -> Result<(), String> {
    if path.is_empty() || path.len() > PATH_BYTES {
        return Err(format!(
            "a path has 1 to {PATH_BYTES} bytes, not {}",
            path.len()
        ));
    }
    let allowed = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'.' | b'_' | b'-' | b'/');
    if !path.bytes().all(allowed) {
        return Err("a path consists of A-Z a-z 0-9 . _ - and /".into());
    }
    if path
        .split('/')
        .any(|segment| matches!(segment, "" | "." | ".."))
    {
        return Err("a path is relative, without empty segments, '.' or '..'".into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_every_path_that_could_leave_the_capture_or_collide() {
        let mut paths = CapturePaths::default();
        for good in [
            "poses.json",
            "frames/000000.png",
            "frames/000001.png",
            "a/b/c",
        ] {
            assert_eq!(paths.add(good), Ok(()), "{good}");
        }
        let long = "x".repeat(PATH_BYTES + 1);
        for bad in [
            "",
            "/etc/passwd",
            "..",
            "a/../b",
            "./a",
            "a//b",
            "a/",
            "a\\b",
            "c:x",
            "ü",
            "a\0b",
            "a b",
            "poses.json",
            "POSES.json",
            "frames",
            "poses.json/x",
            "a/b",
            &long,
        ] {
            assert!(paths.add(bad).is_err(), "{bad:?}");
        }
    }
}
