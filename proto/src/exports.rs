//! Default values of exports, the files of each form, and the people that an export needs.

use crate::render_needs::Need;
use crate::v1::export_motion::Motion;
use crate::v1::{Distillation, ExportForm, ExportSpec};

/// Most triangles of a mesh.
pub const TRIANGLES: u32 = 20_000;
/// Pixels along a side of a mesh's texture.
pub const TEXTURE: u32 = 1024;
/// Seconds to make splats from a field.
pub const SECONDS: f64 = 60.0;
/// Shorter side of the pictures that splats learn from, pixels.
pub const SIZE: u32 = 256;
/// Name of the files without their extensions.
pub const FILE: &str = "person";

/// Extensions of all files of exports.
pub const EXTENSIONS: [&str; 7] = ["html", "ply", "spz", "glb", "obj", "mtl", "png"];

impl ExportForm {
    /// Whether it has one pose, and no motion.
    pub fn is_still(self) -> bool {
        !matches!(self, Self::Page | Self::MeshGlb | Self::Unspecified)
    }

    /// Whether it is a mesh, which has triangles and a texture.
    pub fn is_mesh(self) -> bool {
        matches!(self, Self::MeshGlb | Self::MeshObj | Self::MeshPly)
    }

    /// Extensions of its files, the main one first.
    pub fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Page => &["html"],
            Self::SplatsPly | Self::MeshPly => &["ply"],
            Self::SplatsSpz => &["spz"],
            Self::SplatsGlb | Self::MeshGlb => &["glb"],
            Self::MeshObj => &["obj", "mtl", "png"],
            Self::Unspecified => &[],
        }
    }
}

/// The media type of files with this `extension`. PLY and SPZ have no registered type.
pub fn content_type(extension: &str) -> &'static str {
    match extension {
        "html" => "text/html; charset=utf-8",
        "glb" => "model/gltf-binary",
        "obj" => "model/obj",
        "mtl" => "model/mtl",
        "png" => "image/png",
        _ => "application/octet-stream",
    }
}

/// Whether this is a valid file name: one without a special meaning to any file system or shell.
pub fn is_file_name(name: &str) -> bool {
    let plain = |c: char| !c.is_control() && !"/\\:*?\"<>|".contains(c);
    !name.is_empty() && name.len() <= 200 && !name.starts_with('.') && name.chars().all(plain)
}

/// Whether an export uses the motion, or a pose, of the subject's own capture.
pub fn moves_as_captured(export: &ExportSpec) -> bool {
    let form = export.form();
    let moves = (!form.is_still() && !export.rest) || export.frame.is_some();
    moves && export.motions.is_empty()
}

/// The people that an export needs; a subject may appear more than once.
pub fn needs(export: &ExportSpec) -> Vec<Need<'_>> {
    let own = moves_as_captured(export);
    let mut found = vec![Need {
        field: "subject".into(),
        subject: &export.subject,
        model: &export.model,
        slot: true,
        frame: export
            .frame
            .filter(|_| own)
            .map(|frame| ("frame".into(), frame)),
    }];
    for (i, motion) in export.motions.iter().enumerate() {
        let Some(Motion::Capture(capture)) = &motion.motion else {
            continue;
        };
        let field = |name: &str| format!("motions[{i}].capture.{name}");
        let first = capture.first_frame.map(|it| (field("first_frame"), it));
        let still = export.frame.map(|it| ("frame".to_owned(), it));
        found.push(Need {
            field: field("driver"),
            subject: match &*capture.driver {
                "" => &export.subject,
                driver => driver,
            },
            model: &export.model,
            slot: false,
            frame: first.or(still),
        });
    }
    found
}

/// Seconds and side of the pictures of a distillation.
pub fn distillation(wanted: Option<&Distillation>) -> (f64, u32) {
    let wanted = wanted.copied().unwrap_or_default();
    let seconds = match wanted.seconds {
        0.0 => SECONDS,
        seconds => seconds,
    };
    let size = match wanted.size {
        0 => SIZE,
        size => size,
    };
    (seconds, size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1::{CaptureMotion, ExportMotion, MotionClip};

    fn spec(form: ExportForm, motions: Vec<ExportMotion>) -> ExportSpec {
        ExportSpec {
            subject: "subjects/a".into(),
            form: form.into(),
            motions,
            ..ExportSpec::default()
        }
    }

    #[test]
    fn all_extensions_are_known() {
        let forms = (0..16).filter_map(|form| ExportForm::try_from(form).ok());
        let mut found: Vec<&str> = forms.flat_map(ExportForm::extensions).copied().collect();
        found.sort_unstable();
        found.dedup();
        let mut all = EXTENSIONS;
        all.sort_unstable();
        assert_eq!(found, all);
    }

    #[test]
    fn an_export_needs_its_person_and_those_who_drive_it() {
        let capture = |driver: &str, first_frame| ExportMotion {
            motion: Some(Motion::Capture(CaptureMotion {
                driver: driver.into(),
                first_frame,
                ..CaptureMotion::default()
            })),
            ..ExportMotion::default()
        };
        let clip = ExportMotion {
            motion: Some(Motion::Clip(MotionClip::default())),
            ..ExportMotion::default()
        };
        let motions = vec![capture("subjects/b", Some(3)), clip, capture("", None)];
        let page = spec(ExportForm::Page, motions);
        let listed = |spec: &ExportSpec| -> Vec<(String, String, bool, Option<u32>)> {
            let needs = needs(spec).into_iter();
            let row = |it: Need<'_>| (it.field, it.subject.to_owned(), it.slot, it.frame);
            let rows = needs.map(row);
            rows.map(|(field, subject, slot, frame)| (field, subject, slot, frame.map(|it| it.1)))
                .collect()
        };
        let a = || "subjects/a".to_owned();
        let driver = |i: usize| format!("motions[{i}].capture.driver");
        let expected = [
            ("subject".to_owned(), a(), true, None),
            (driver(0), "subjects/b".into(), false, Some(3)),
            (driver(2), a(), false, None),
        ];
        assert_eq!(listed(&page), expected);
        // The frame of a still form belongs to its motion.
        let mut still = spec(ExportForm::SplatsSpz, Vec::new());
        still.frame = Some(7);
        assert_eq!(listed(&still)[0].3, Some(7));
        still.motions.push(capture("subjects/b", None));
        let frames: Vec<_> = listed(&still).into_iter().map(|it| it.3).collect();
        assert_eq!(frames, [None, Some(7)]);
    }

    #[test]
    fn forms_with_motion_move_as_captured_unless_they_are_told_otherwise() {
        let mut page = spec(ExportForm::Page, Vec::new());
        assert!(moves_as_captured(&page));
        page.rest = true;
        assert!(!moves_as_captured(&page));
        let mut still = spec(ExportForm::MeshObj, Vec::new());
        assert!(!moves_as_captured(&still));
        still.frame = Some(0);
        assert!(moves_as_captured(&still));
    }

    #[test]
    fn names_that_lead_elsewhere_are_none() {
        for good in ["ada", "Ada Lovelace", "größe", "a.b"] {
            assert!(is_file_name(good), "{good}");
        }
        for bad in ["", ".ada", "a/b", "a\\b", "c:x", "a\nb", &"a".repeat(201)] {
            assert!(!is_file_name(bad), "{bad}");
        }
    }

    #[test]
    fn a_distillation_has_default_values() {
        let wanted = Distillation {
            seconds: 0.0,
            size: 128,
            ..Distillation::default()
        };
        assert_eq!(distillation(Some(&wanted)), (60.0, 128));
        assert_eq!(distillation(None), (60.0, 256));
    }
}
