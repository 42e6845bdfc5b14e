//! The files of an export on this disk: each whole or not at all.

use crate::files::{folder_of, keep};
use crate::show::export_contents;
use anyhow::Context;
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;
use yoto_proto::exports::is_file_name;
use yoto_proto::v1::{ExportForm, ExportResult};
use yoto_terminal::output;

/// Most bytes of a page that is quickly sent and opened.
const PAGE: usize = 4_000_000;

/// The files to write.
pub(crate) struct Written {
    form: ExportForm,
    out: PathBuf,
    files: Vec<PathBuf>,
}

impl Written {
    /// The files of a `form` whose main one is `out`; others stand beside it.
    pub(crate) fn new(out: &Path, form: ExportForm) -> Self {
        let extensions = form.extensions().iter();
        let beside = extensions.skip(1).map(|it| out.with_extension(it));
        Self {
            form,
            out: out.to_owned(),
            files: [out.to_owned()].into_iter().chain(beside).collect(),
        }
    }

    /// Their paths, the main one first.
    pub(crate) fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Their name without extensions, by which they know each other.
    ///
    /// # Errors
    /// If it is not UTF-8, or no plain name although there are several files.
    pub(crate) fn stem(&self) -> anyhow::Result<&str> {
        let stem = self.out.file_stem().and_then(|stem| stem.to_str());
        let alone = self.files.len() == 1;
        match stem.filter(|stem| is_file_name(stem)) {
            Some(stem) => Ok(stem),
            None if alone => Ok(""),
            None => anyhow::bail!("{}: not a plain name", self.out.display()),
        }
    }

    /// Writes `contents`, one for each file, and prints what is in them.
    pub(crate) fn write(&self, contents: &[Vec<u8>], result: &ExportResult) -> anyhow::Result<()> {
        // The main one last: where it is, all are.
        for (path, bytes) in self.files.iter().zip(contents).rev() {
            write(path, bytes)?;
        }
        let bytes = contents.first().map_or(0, Vec::len);
        say!(
            "{}: {}, {bytes} bytes",
            self.out.display(),
            export_contents(result)
        );
        if let Some(advice) = advice(self.form, bytes) {
            tell!("{}: {advice}", self.out.display());
        }
        match result.triangles {
            0 => output::put("splats", result.splats),
            triangles => output::put("triangles", triangles),
        }
        output::put("files", output::paths(&self.files));
        output::put("bytes", bytes);
        Ok(())
    }
}

/// How to make a file of this `form` smaller, if its number of `bytes` is large.
fn advice(form: ExportForm, bytes: usize) -> Option<String> {
    (form == ExportForm::Page && bytes > PAGE).then(|| {
        let (size, most) = (bytes as f64 / 1e6, PAGE / 1_000_000);
        format!(
            "{size:.1} MB, more than the {most} MB of a page that opens quickly; fewer motions, fewer of their frames \
             (--range A..B:STEP of --motion and --motion-file) and splats without harmonics (yoto train --harmonics \
             0) make it smaller"
        )
    })
}

/// Writes a file whole or not at all.
fn write(out: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let writing = || format!("writing {}", out.display());
    let folder = folder_of(out);
    std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    let mut part = NamedTempFile::new_in(folder).with_context(writing)?;
    part.write_all(bytes).with_context(writing)?;
    keep(part, out).with_context(writing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_form_of_several_files_has_them_beside_each_other() {
        let dir = tempfile::tempdir().expect("a folder");
        let out = dir.path().join("new/ada.obj");
        let written = Written::new(&out, ExportForm::MeshObj);
        let names: Vec<_> = written.files().iter().map(|it| it.file_name()).collect();
        assert_eq!(
            names,
            ["ada.obj", "ada.mtl", "ada.png"].map(|it| Some(it.as_ref()))
        );
        assert_eq!(written.stem().expect("a name"), "ada");
        let result = ExportResult {
            triangles: 2,
            ..ExportResult::default()
        };
        let contents = [b"o".to_vec(), b"m".to_vec(), b"p".to_vec()];
        written.write(&contents, &result).expect("writes");
        for (path, bytes) in written.files().iter().zip(&contents) {
            assert_eq!(&std::fs::read(path).expect("is there"), bytes);
        }
        let hidden = Path::new(".ada.obj");
        assert!(Written::new(hidden, ExportForm::MeshObj).stem().is_err());
        let alone = Written::new(Path::new(".ada.glb"), ExportForm::MeshGlb);
        assert_eq!(alone.stem().expect("needs none"), "");
    }

    #[test]
    fn a_large_page_comes_with_advice() {
        assert_eq!(advice(ExportForm::Page, 4_000_000), None);
        assert_eq!(advice(ExportForm::MeshGlb, 40_000_000), None);
        let advice = advice(ExportForm::Page, 5_260_000).expect("a large page");
        assert!(advice.starts_with("5.3 MB, more than the 4 MB"), "{advice}");
    }
}
