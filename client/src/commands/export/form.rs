//! The forms in which a person leaves, by the file's name and the user's wish.

use anyhow::{bail, ensure};
use clap::ValueEnum;
use std::path::Path;

/// What the user may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// A page for browsers (.html).
    Page,
    /// Gaussian splats of one pose (.ply, .spz, .glb).
    Splats,
    /// A mesh with texture, bones and motions (.glb).
    Mesh,
}

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Page,
    Splats(SplatFile),
    Mesh,
}

/// A file of splats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SplatFile {
    Ply,
    Spz,
    Glb,
}

impl Form {
    /// The form of the file `out`, in the `format` of choice.
    pub fn of(out: &Path, format: Option<Format>) -> anyhow::Result<Self> {
        let name = out.display();
        let extension = out.extension().and_then(|extension| extension.to_str());
        let form = match (extension, format) {
            (Some("html"), _) => Self::Page,
            (Some("ply"), _) => Self::Splats(SplatFile::Ply),
            (Some("spz"), _) => Self::Splats(SplatFile::Spz),
            (Some("glb"), Some(Format::Splats)) => Self::Splats(SplatFile::Glb),
            (Some("glb"), _) => Self::Mesh,
            _ => bail!("--out {name}: none of .html, .ply, .spz, .glb"),
        };
        let is = match form {
            Self::Page => Format::Page,
            Self::Splats(_) => Format::Splats,
            Self::Mesh => Format::Mesh,
        };
        ensure!(
            format.is_none_or(|format| format == is),
            "--out {name}: that file has another format than --format says"
        );
        Ok(form)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_says_the_form_and_the_format_chooses_among_those_of_a_name() {
        let form = |name: &str, format| Form::of(Path::new(name), format).ok();
        assert_eq!(form("a.html", None), Some(Form::Page));
        assert_eq!(form("a.glb", None), Some(Form::Mesh));
        assert_eq!(
            form("a.glb", Some(Format::Splats)),
            Some(Form::Splats(SplatFile::Glb))
        );
        assert_eq!(
            form("a.spz", Some(Format::Splats)),
            Some(Form::Splats(SplatFile::Spz))
        );
        assert_eq!(form("a.glb", Some(Format::Page)), None);
        assert_eq!(form("a.ply", Some(Format::Mesh)), None);
        assert_eq!(form("a.obj", None), None);
    }
}
