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
    /// A mesh: with texture, bones and motions (.glb), or of one pose (.obj, .ply).
    Mesh,
}

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Page,
    Splats(SplatFile),
    Mesh(MeshFile),
}

/// A file of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MeshFile {
    Glb,
    Obj,
    Ply,
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
            (Some("ply"), Some(Format::Mesh)) => Self::Mesh(MeshFile::Ply),
            (Some("ply"), _) => Self::Splats(SplatFile::Ply),
            (Some("spz"), _) => Self::Splats(SplatFile::Spz),
            (Some("glb"), Some(Format::Splats)) => Self::Splats(SplatFile::Glb),
            (Some("glb"), _) => Self::Mesh(MeshFile::Glb),
            (Some("obj"), _) => Self::Mesh(MeshFile::Obj),
            _ => bail!("--out {name}: none of .html, .ply, .spz, .glb, .obj"),
        };
        let is = match form {
            Self::Page => Format::Page,
            Self::Splats(_) => Format::Splats,
            Self::Mesh(_) => Format::Mesh,
        };
        ensure!(
            format.is_none_or(|format| format == is),
            "--out {name}: that file has another format than --format says"
        );
        Ok(form)
    }

    /// Whether the file has one pose.
    pub fn is_still(self) -> bool {
        match self {
            Self::Page | Self::Mesh(MeshFile::Glb) => false,
            Self::Splats(_) | Self::Mesh(MeshFile::Obj | MeshFile::Ply) => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_says_the_form_and_the_format_chooses_among_those_of_a_name() {
        let form = |name: &str, format| Form::of(Path::new(name), format).ok();
        assert_eq!(form("a.html", None), Some(Form::Page));
        assert_eq!(form("a.glb", None), Some(Form::Mesh(MeshFile::Glb)));
        assert_eq!(form("a.obj", None), Some(Form::Mesh(MeshFile::Obj)));
        assert_eq!(form("a.ply", None), Some(Form::Splats(SplatFile::Ply)));
        assert_eq!(
            form("a.glb", Some(Format::Splats)),
            Some(Form::Splats(SplatFile::Glb))
        );
        assert_eq!(
            form("a.spz", Some(Format::Splats)),
            Some(Form::Splats(SplatFile::Spz))
        );
        assert_eq!(form("a.glb", Some(Format::Page)), None);
        assert_eq!(
            form("a.ply", Some(Format::Mesh)),
            Some(Form::Mesh(MeshFile::Ply))
        );
        assert_eq!(form("a.obj", Some(Format::Splats)), None);
        assert_eq!(form("a.fbx", None), None);
    }
}
