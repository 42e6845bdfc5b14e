//! Folders that a command makes anew at each run, without the loss of other files.

use anyhow::{Context, ensure};
use std::path::{Path, PathBuf};

/// An empty folder `name` in `out`, marked as made by `maker` (a command). A folder of an earlier
/// run of the same command is replaced.
///
/// # Errors
/// When a folder of this name was not made by `maker`; when it can't be replaced or made.
pub(crate) fn fresh(out: &Path, name: &str, maker: &str) -> anyhow::Result<PathBuf> {
    let folder = out.join(name);
    if folder.exists() {
        ensure!(
            is_of(&folder, maker),
            "{} exists and was not made by an earlier `yoto {maker}`; move it away or choose another \
             --out",
            folder.display()
        );
        std::fs::remove_dir_all(&folder)
            .with_context(|| format!("removing {}", folder.display()))?;
    }
    std::fs::create_dir_all(&folder).with_context(|| format!("creating {}", folder.display()))?;
    let marker = marker(&folder, maker);
    std::fs::write(
        &marker,
        format!("The next `yoto {maker}` replaces this folder.\n"),
    )
    .with_context(|| format!("writing {}", marker.display()))?;
    Ok(folder)
}

/// Whether `maker` made `folder`.
pub(crate) fn is_of(folder: &Path, maker: &str) -> bool {
    marker(folder, maker).is_file()
}

fn marker(folder: &Path, maker: &str) -> PathBuf {
    folder.join(format!("made-by-yoto-{maker}"))
}

/// Moves everything in the folder `from` into the folder `to`, on the same file system.
///
/// # Errors
/// When something can't be moved.
pub(crate) fn move_into(from: &Path, to: &Path) -> anyhow::Result<()> {
    let reading = || format!("reading {}", from.display());
    for entry in std::fs::read_dir(from).with_context(reading)? {
        let entry = entry.with_context(reading)?;
        let target = to.join(entry.file_name());
        std::fs::rename(entry.path(), &target).with_context(|| {
            format!("moving {} to {}", entry.path().display(), target.display())
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_folder_of_the_same_command_is_replaced() {
        let out = tempfile::tempdir().expect("temporary folder");
        let folder = fresh(out.path(), "service", "demo").expect("makes one");
        let old = folder.join("old");
        std::fs::write(&old, b"x").expect("writes");
        fresh(out.path(), "service", "demo").expect("replaces its own");
        assert!(!old.exists());

        std::fs::write(&old, b"x").expect("writes");
        let error = fresh(out.path(), "service", "avatar").expect_err("another command's");
        assert!(
            error
                .to_string()
                .contains("not made by an earlier `yoto avatar`"),
            "{error}"
        );
        assert!(old.exists());
    }
}
