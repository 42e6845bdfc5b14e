//! Folders that a command writes to, without a loss of what another one wrote.

use anyhow::Context;
use clap::Args;
use std::path::{Path, PathBuf};
use yoto_terminal::output;

/// Most files that are shown one by one.
const FEW: usize = 8;

/// A folder for files.
#[derive(Debug, Args)]
pub(super) struct OutFolder {
    /// Folder for the files.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Write over files that are there already; pictures of another render are removed.
    #[arg(long)]
    pub force: bool,
}

impl OutFolder {
    /// Checks that no file there `is_ours` to write, unless that was allowed.
    ///
    /// # Errors
    /// When one is, with its name; when the folder can't be read.
    pub fn ensure_free(&self, is_ours: impl Fn(&str) -> bool) -> anyhow::Result<()> {
        if self.force {
            return Ok(());
        }
        match taken(&self.out, is_ours)? {
            None => Ok(()),
            Some(name) => anyhow::bail!(
                "{} is there already: choose another folder (--out), or write over it (--force)",
                self.out.join(name).display()
            ),
        }
    }
}

impl OutFolder {
    /// Removes files of another run that `is_ours` to write and that are not among the `written`, if
    /// writing over them was allowed: they would pass for files of this run.
    ///
    /// # Errors
    /// When one can't be removed.
    pub fn remove_others(
        &self,
        is_ours: impl Fn(&str) -> bool,
        written: &[PathBuf],
    ) -> anyhow::Result<()> {
        let is_left =
            |name: &str| is_ours(name) && !written.iter().any(|path| path.ends_with(name));
        while let Some(name) = taken(&self.out, is_left)?.filter(|_| self.force) {
            let path = self.out.join(name);
            std::fs::remove_file(&path).with_context(|| format!("removing {}", path.display()))?;
        }
        Ok(())
    }
}

impl OutFolder {
    /// Shows which files were written: few of them one by one.
    pub fn show(&self, written: &[PathBuf]) {
        output::put("files", output::paths(written));
        match written {
            [first, .., last] if written.len() > FEW => {
                let name = |path: &Path| path.file_name().unwrap_or_default().display().to_string();
                say!(
                    "{} files in {}: {} … {}",
                    written.len(),
                    self.out.display(),
                    name(first),
                    name(last)
                );
            }
            _ => written.iter().for_each(|path| say!("{}", path.display())),
        }
    }
}

/// A file of the folder `dir`, if it exists, whose name `is_ours`: the first by name.
fn taken(dir: &Path, is_ours: impl Fn(&str) -> bool) -> anyhow::Result<Option<String>> {
    let reading = || format!("reading {}", dir.display());
    let entries = match std::fs::read_dir(dir) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error).with_context(reading),
    };
    let mut first: Option<String> = None;
    for entry in entries {
        let name = entry.with_context(reading)?.file_name();
        let name = name.to_string_lossy().into_owned();
        if is_ours(&name) && first.as_ref().is_none_or(|first| name < *first) {
            first = Some(name);
        }
    }
    Ok(first)
}

/// Whether a render writes files of this name.
pub(super) fn is_rendered(name: &str) -> bool {
    let number = name.strip_suffix(".png").unwrap_or_default();
    number == "animation" || (number.len() >= 6 && number.bytes().all(|c| c.is_ascii_digit()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_that_would_be_lost_are_in_the_way() {
        let dir = tempfile::tempdir().expect("a folder");
        let folder = |force| OutFolder {
            out: dir.path().join("out"),
            force,
        };
        folder(false).ensure_free(is_rendered).expect("not there");
        std::fs::create_dir(dir.path().join("out")).expect("a folder");
        for other in ["notes.txt", "1.png", "sheet.png"] {
            std::fs::write(dir.path().join("out").join(other), b"").expect("writes");
        }
        folder(false)
            .ensure_free(is_rendered)
            .expect("others' files");
        for ours in ["000003.png", "animation.png", "000001.png"] {
            std::fs::write(dir.path().join("out").join(ours), b"").expect("writes");
        }
        let error = folder(false).ensure_free(is_rendered).expect_err("ours");
        assert!(
            error.to_string().contains("000001.png is there already"),
            "{error}"
        );
        folder(true).ensure_free(is_rendered).expect("allowed");
        let written = [dir.path().join("out/000001.png")];
        folder(false)
            .remove_others(is_rendered, &written)
            .expect("nothing to do");
        folder(true)
            .remove_others(is_rendered, &written)
            .expect("removes");
        let left = std::fs::read_dir(dir.path().join("out")).expect("a folder");
        assert_eq!(left.count(), 4, "one picture and three files of others");
        std::fs::write(dir.path().join("file"), b"").expect("writes");
        let file = OutFolder {
            out: dir.path().join("file"),
            force: false,
        };
        assert!(file.ensure_free(is_rendered).is_err());
    }
}
