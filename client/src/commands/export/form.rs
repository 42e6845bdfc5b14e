//! The forms in which a person leaves, by the file's name and the user's wish.

use anyhow::{bail, ensure};
use clap::ValueEnum;
use std::path::Path;
use yoto_proto::v1::ExportForm;

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

/// The form of the file `out`, in the `format` of choice.
pub(super) fn form(out: &Path, format: Option<Format>) -> anyhow::Result<ExportForm> {
    let name = out.display();
    let extension = out.extension().and_then(|extension| extension.to_str());
    let form = match (extension, format) {
        (Some("html"), _) => ExportForm::Page,
        (Some("ply"), Some(Format::Mesh)) => ExportForm::MeshPly,
        (Some("ply"), _) => ExportForm::SplatsPly,
        (Some("spz"), _) => ExportForm::SplatsSpz,
        (Some("glb"), Some(Format::Splats)) => ExportForm::SplatsGlb,
        (Some("glb"), _) => ExportForm::MeshGlb,
        (Some("obj"), _) => ExportForm::MeshObj,
        _ => bail!("--out {name}: none of .html, .ply, .spz, .glb, .obj"),
    };
    let is = match form {
        ExportForm::Page => Format::Page,
        form if form.is_mesh() => Format::Mesh,
        _ => Format::Splats,
    };
    ensure!(
        format.is_none_or(|format| format == is),
        "--out {name}: that file has another format than --format says"
    );
    Ok(form)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_says_the_form_and_the_format_chooses_among_those_of_a_name() {
        let form = |name: &str, format| form(Path::new(name), format).ok();
        assert_eq!(form("a.html", None), Some(ExportForm::Page));
        assert_eq!(form("a.glb", None), Some(ExportForm::MeshGlb));
        assert_eq!(form("a.obj", None), Some(ExportForm::MeshObj));
        assert_eq!(form("a.ply", None), Some(ExportForm::SplatsPly));
        assert_eq!(
            form("a.glb", Some(Format::Splats)),
            Some(ExportForm::SplatsGlb)
        );
        assert_eq!(
            form("a.spz", Some(Format::Splats)),
            Some(ExportForm::SplatsSpz)
        );
        assert_eq!(form("a.glb", Some(Format::Page)), None);
        assert_eq!(form("a.ply", Some(Format::Mesh)), Some(ExportForm::MeshPly));
        assert_eq!(form("a.obj", Some(Format::Splats)), None);
        assert_eq!(form("a.fbx", None), None);
    }
}
