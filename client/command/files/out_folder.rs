//! Folders that a command writes to without the loss of files that another one wrote.

use anyhow::Context;
use clap::Args;
use std::collections::HashSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use yoto_terminal::output;

/// Most files that are shown one by one.
const FEW: usize = 8;

/// A folder for files.
#[derive(Debug, Args)]
pub(crate) struct OutFolder {
    /// Folder for the files.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Overwrite existing files; pictures of another render are removed.
    #[arg(long)]
    pub force: bool,
}

impl OutFolder {
    /// Checks that the folder holds no file whose name `is_ours` accepts, unless --force allows overwriting it.
    ///
    /// # Errors
    /// If it holds one, with the first such name; if the folder can't be read.
    pub(crate) fn ensure_free(&self, is_ours: impl Fn(&str) -> bool) -> anyhow::Result<()> {
        if self.force {
            return Ok(());
        }
        match names(&self.out, is_ours)?.into_iter().min() {
            None => Ok(()),
            Some(name) => anyhow::bail!(
                "{} is there already: choose another folder (--out), or overwrite it (--force)",
                self.out.join(name).display()
            ),
        }
    }

    /// With --force, removes each file whose name `is_ours` accepts and that this run has not `written`: it comes from
    /// an earlier run, and would pass for a file of this one. Reads the folder once.
    ///
    /// # Errors
    /// If the folder can't be read or a file can't be removed.
    pub(crate) fn remove_others(
        &self,
        is_ours: impl Fn(&str) -> bool,
        written: &[PathBuf],
    ) -> anyhow::Result<()> {
        if !self.force {
            return Ok(());
        }
        let written: HashSet<&OsStr> = written.iter().filter_map(|path| path.file_name()).collect();
        for name in names(&self.out, is_ours)? {
            if written.contains(OsStr::new(&name)) {
                continue;
            }
            let path = self.out.join(name);
            std::fs::remove_file(&path).with_context(|| format!("removing {}", path.display()))?;
        }
        Ok(())
    }

    /// Prints which files were written: each of a few, or the number of many.
    pub(crate) fn show(&self, written: &[PathBuf]) {
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

/// Names in the folder `dir` that `is_ours` accepts, in no order; none if there is no such folder.
fn names(dir: &Path, is_ours: impl Fn(&str) -> bool) -> anyhow::Result<Vec<String>> {
    let reading = || format!("reading {}", dir.display());
    let entries = match std::fs::read_dir(dir) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error).with_context(reading),
    };
    let mut names = Vec::new();
    for entry in entries {
        let name = entry.with_context(reading)?.file_name();
        let name = name.to_string_lossy().into_owned();
        if is_ours(&name) {
            names.push(name);
        }
    }
    Ok(names)
}

/// Whether a render writes files of this name.
pub(crate) fn is_rendered(name: &str) -> bool {
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

    #[test]
    fn pictures_of_an_earlier_run_are_removed_and_no_others() {
        let dir = tempfile::tempdir().expect("a folder");
        let out = dir.path().join("out");
        let folder = |force| OutFolder {
            out: out.clone(),
            force,
        };
        folder(true)
            .remove_others(is_rendered, &[])
            .expect("no folder, nothing to remove");
        std::fs::create_dir(&out).expect("a folder");
        let picture = |number: u32| out.join(format!("{number:06}.png"));
        for number in 0..40 {
            std::fs::write(picture(number), b"").expect("writes");
        }
        std::fs::write(out.join("notes.txt"), b"").expect("writes");
        let written: Vec<PathBuf> = (0..10).map(picture).collect();
        let left = || std::fs::read_dir(&out).expect("a folder").count();
        folder(false)
            .remove_others(is_rendered, &written)
            .expect("nothing is allowed");
        assert_eq!(left(), 41);
        folder(true)
            .remove_others(is_rendered, &written)
            .expect("removes");
        assert_eq!(left(), 11, "ten pictures of this run and the notes");
        assert!(written.iter().all(|path| path.exists()));
    }
}
