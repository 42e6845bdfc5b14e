//! Chooses the export format from the output's extension and `--format`.

use anyhow::{Context, bail};
use clap::ValueEnum;
use std::path::Path;
use yoto_proto::v1::ExportForm;

/// What the user may ask for: a kind of file, or one form of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// A page for browsers (.html).
    #[value(alias = "html")]
    Page,
    /// Gaussian splats of one pose (.ply, .spz, .glb).
    Splats,
    /// A mesh: with texture, bones and motions (.glb), or of one pose (.obj, .ply).
    Mesh,
    /// Splats in .ply.
    Ply,
    /// Splats in .spz.
    Spz,
    /// A mesh in .glb.
    Glb,
    /// A mesh in .obj.
    Obj,
    /// A mesh in .ply.
    PlyMesh,
}

impl Format {
    /// Its forms, the usual one of an extension first.
    fn forms(self) -> &'static [ExportForm] {
        match self {
            Self::Page => &[ExportForm::Page],
            Self::Splats => &[
                ExportForm::SplatsPly,
                ExportForm::SplatsSpz,
                ExportForm::SplatsGlb,
            ],
            Self::Mesh => &[
                ExportForm::MeshGlb,
                ExportForm::MeshObj,
                ExportForm::MeshPly,
            ],
            Self::Ply => &[ExportForm::SplatsPly],
            Self::Spz => &[ExportForm::SplatsSpz],
            Self::Glb => &[ExportForm::MeshGlb],
            Self::Obj => &[ExportForm::MeshObj],
            Self::PlyMesh => &[ExportForm::MeshPly],
        }
    }
}

/// Default format of each extension.
const USUAL: [ExportForm; 5] = [
    ExportForm::Page,
    ExportForm::SplatsPly,
    ExportForm::SplatsSpz,
    ExportForm::MeshGlb,
    ExportForm::MeshObj,
];

/// The form of the file `out`, in the `format` of choice. Extensions may be in capitals.
pub(crate) fn form(out: &Path, format: Option<Format>) -> anyhow::Result<ExportForm> {
    let name = out.display();
    let extension = out.extension().and_then(|extension| extension.to_str());
    let extension = extension.unwrap_or_default().to_ascii_lowercase();
    let in_file = |form: &&ExportForm| main_extension(**form) == Some(extension.as_str());
    let usual = USUAL.iter().find(in_file);
    let usual = usual.with_context(|| {
        format!(
            "--out {name}: its extension must be one of {}",
            listed(&USUAL)
        )
    })?;
    let Some(format) = format else {
        return Ok(*usual);
    };
    let forms = format.forms();
    match forms.iter().find(in_file) {
        Some(form) => Ok(*form),
        None => bail!(
            "--out {name} ends with .{extension}, but --format {} needs {}",
            word(format),
            listed(forms)
        ),
    }
}

fn main_extension(form: ExportForm) -> Option<&'static str> {
    form.extensions().first().copied()
}

/// How the user writes a format.
fn word(format: Format) -> String {
    let value = format.to_possible_value();
    value.map_or_else(String::new, |value| value.get_name().to_owned())
}

/// The extensions of `forms`: ".ply, .spz or .glb".
fn listed(forms: &[ExportForm]) -> String {
    let all = forms.iter().copied().filter_map(main_extension);
    let all: Vec<String> = all.map(|it| format!(".{it}")).collect();
    match all.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, others)) => format!("{} or {last}", others.join(", ")),
        None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_says_the_form_and_the_format_chooses_among_those_of_a_name() {
        use ExportForm as Form;
        let form = |name: &str, format| form(Path::new(name), format).ok();
        assert_eq!(form("a.html", None), Some(Form::Page));
        assert_eq!(form("a.glb", None), Some(Form::MeshGlb));
        assert_eq!(form("a.obj", None), Some(Form::MeshObj));
        assert_eq!(form("a.ply", None), Some(Form::SplatsPly));
        assert_eq!(form("a.SPZ", None), Some(Form::SplatsSpz));
        assert_eq!(form("a.Glb", Some(Format::Splats)), Some(Form::SplatsGlb));
        assert_eq!(form("a.spz", Some(Format::Splats)), Some(Form::SplatsSpz));
        assert_eq!(form("a.glb", Some(Format::Page)), None);
        assert_eq!(form("a.ply", Some(Format::Mesh)), Some(Form::MeshPly));
        assert_eq!(form("a.obj", Some(Format::Splats)), None);
        assert_eq!(form("a.fbx", None), None);
        assert_eq!(form("glb", Some(Format::Glb)), None);
    }

    #[test]
    fn words_for_one_form_mean_it_and_no_other() {
        let all = [
            ("page", "a.html", ExportForm::Page),
            ("html", "a.html", ExportForm::Page),
            ("ply", "a.ply", ExportForm::SplatsPly),
            ("spz", "a.spz", ExportForm::SplatsSpz),
            ("glb", "a.glb", ExportForm::MeshGlb),
            ("obj", "a.obj", ExportForm::MeshObj),
            ("ply-mesh", "a.ply", ExportForm::MeshPly),
        ];
        for (written, name, expected) in all {
            let format = Format::from_str(written, false).expect("a format");
            let found = form(Path::new(name), Some(format)).expect("a form");
            assert_eq!(found, expected, "{written}");
            for (_, other, _) in all.iter().filter(|(_, other, _)| *other != name) {
                assert!(form(Path::new(other), Some(format)).is_err(), "{written}");
            }
        }
    }

    #[test]
    fn a_contradiction_names_both() {
        let error = form(Path::new("x/a.OBJ"), Some(Format::Splats)).expect_err("no splats");
        assert_eq!(
            error.to_string(),
            "--out x/a.OBJ ends with .obj, but --format splats needs .ply, .spz or .glb"
        );
        let error = form(Path::new("a.glb"), Some(Format::PlyMesh)).expect_err("no glb");
        assert_eq!(
            error.to_string(),
            "--out a.glb ends with .glb, but --format ply-mesh needs .ply"
        );
        let error = form(Path::new("a"), None).expect_err("no extension");
        assert_eq!(
            error.to_string(),
            "--out a: its extension must be one of .html, .ply, .spz, .glb or .obj"
        );
    }
}
