//! Orders to export.

use super::scene::RATES;
use super::{SpecFault, SpecFaults};
use crate::exports::is_file_name;
use crate::pose_track::MAX_FRAMES;
use crate::v1::export_motion::Motion;
use crate::v1::{Distillation, ExportForm, ExportMotion, ExportSpec};
use std::ops::RangeInclusive;

/// Clips of one export.
const MOST_MOTIONS: usize = 64;
/// Length of a clip's name, bytes.
const NAME_BYTES: usize = 200;
/// Most triangles of a mesh.
pub const TRIANGLES: RangeInclusive<u32> = 100..=1_000_000;
/// Pixels along a side of a texture.
pub const TEXTURES: RangeInclusive<u32> = 64..=8192;
/// Length of a distillation, seconds.
pub const SECONDS: RangeInclusive<f64> = 1.0..=86_400.0;
/// Smallest limit of a file's size, bytes.
pub const FEWEST_BYTES: u64 = 1000;
/// Sides of its pictures, pixels.
pub const SIZES: RangeInclusive<u32> = 64..=2048;

/// All faults of an order to export.
pub fn faults(export: &ExportSpec) -> Vec<SpecFault> {
    let mut found = SpecFaults::default();
    let form = match ExportForm::try_from(export.form) {
        Ok(ExportForm::Unspecified) => {
            found.add("form", "is needed: a page, splats or a mesh");
            None
        }
        Ok(form) => Some(form),
        Err(_) => {
            found.add("form", format!("{} is not known", export.form));
            None
        }
    };
    for (i, motion) in export.motions.iter().enumerate() {
        check_motion(&mut found, &format!("motions[{i}]"), motion);
    }
    if let Some(form) = form {
        check_motions(&mut found, export, form);
        check_mesh(&mut found, export, form);
        let bytes = export.max_bytes;
        found.unless(bytes == 0 || !form.is_mesh(), "max_bytes", || {
            "belongs to a page and to files of splats".into()
        });
        found.unless(bytes == 0 || bytes >= FEWEST_BYTES, "max_bytes", || {
            format!("{bytes}: must be at least {FEWEST_BYTES}")
        });
    }
    if let Some(Distillation { seconds, size, .. }) = export.distillation {
        if seconds != 0.0 {
            found.between("distillation.seconds", seconds, &SECONDS);
        }
        if size != 0 {
            found.between("distillation.size", size, &SIZES);
        }
    }
    let file = &export.file;
    found.unless(file.is_empty() || is_file_name(file), "file", || {
        let shown: String = file.chars().take(80).collect();
        format!("'{shown}' is not a plain file name")
    });
    found.0
}

/// The motions that a form contains.
fn check_motions(found: &mut SpecFaults, export: &ExportSpec, form: ExportForm) {
    let count = export.motions.len();
    if form.is_still() {
        found.unless(count <= 1, "motions", || {
            format!("{count} motions: a form without motion takes one, for its pose")
        });
        found.unless(count == 0 || export.frame.is_some(), "frame", || {
            "is needed: a form without motion has one pose of it".into()
        });
        found.unless(!export.rest, "rest", || {
            "belongs to forms with motion".into()
        });
        return;
    }
    found.unless(count <= MOST_MOTIONS, "motions", || {
        format!("{count} motions: at most {MOST_MOTIONS} are allowed")
    });
    found.unless(export.frame.is_none(), "frame", || {
        "belongs to forms without motion: a page and a mesh with bones play all frames".into()
    });
    found.unless(count == 0 || !export.rest, "rest", || {
        "contradicts the motions".into()
    });
}

fn check_mesh(found: &mut SpecFaults, export: &ExportSpec, form: ExportForm) {
    for (field, value, range) in [
        ("triangles", export.triangles, &TRIANGLES),
        ("texture", export.texture, &TEXTURES),
    ] {
        if value == 0 {
            continue;
        }
        found.unless(form.is_mesh(), field, || "belongs to a mesh".into());
        if form.is_mesh() {
            found.between(field, value, range);
        }
    }
}

fn check_motion(found: &mut SpecFaults, at: &str, motion: &ExportMotion) {
    let field = |name: &str| format!("{at}.{name}");
    let bytes = motion.name.len();
    let plain = bytes <= NAME_BYTES && !motion.name.chars().any(char::is_control);
    found.unless(plain, &field("name"), || {
        format!("{bytes} bytes: at most {NAME_BYTES} are allowed, and no control characters")
    });
    match &motion.motion {
        None => found.add(&field("motion"), "is missing"),
        Some(Motion::Capture(capture)) => {
            let count = capture.frame_count as usize;
            // With an end, this is only an upper limit.
            let few = count <= MAX_FRAMES || capture.end_frame.is_some();
            found.unless(few, &field("capture.frame_count"), || {
                format!("{count} frames: at most {MAX_FRAMES} are allowed")
            });
            found.end_frame(&field("capture"), capture.first_frame, capture.end_frame);
        }
        Some(Motion::Clip(clip)) => {
            let count = clip.poses.len();
            let fits = (1..=MAX_FRAMES).contains(&count);
            found.unless(fits, &field("clip.poses"), || {
                format!("{count} poses: 1 to {MAX_FRAMES} are allowed")
            });
            found.between(&field("clip.fps"), clip.fps, &RATES);
            found.motion(&field("clip"), clip);
        }
    }
    let up = &motion.up;
    let square: f64 = up.iter().map(|it| it * it).sum();
    let unit = up.len() == 3 && (square - 1.0).abs() < 1e-3;
    let clip = matches!(motion.motion, Some(Motion::Clip(_)));
    found.unless(up.is_empty() || (unit && clip), &field("up"), || {
        format!("{up:?}: nothing, or for a clip a vector of length 1")
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1::{BodyPose, CaptureMotion, MotionClip, Skeleton};

    fn clip() -> ExportMotion {
        ExportMotion {
            motion: Some(Motion::Clip(MotionClip {
                skeleton: Some(Skeleton {
                    names: vec!["root".into()],
                    parents: vec![-1],
                    rest_joints: Vec::new(),
                }),
                poses: vec![BodyPose {
                    rotations: vec![0.0; 3],
                    translation: vec![0.0; 3],
                }],
                fps: 30.0,
                ..MotionClip::default()
            })),
            up: vec![0.0, 0.6, 0.8],
            ..ExportMotion::default()
        }
    }

    fn captured() -> ExportMotion {
        ExportMotion {
            motion: Some(Motion::Capture(CaptureMotion::default())),
            ..ExportMotion::default()
        }
    }

    fn spec(form: ExportForm) -> ExportSpec {
        ExportSpec {
            form: form.into(),
            ..ExportSpec::default()
        }
    }

    fn fields(spec: &ExportSpec) -> Vec<String> {
        faults(spec).into_iter().map(|fault| fault.field).collect()
    }

    #[test]
    fn good_orders_have_no_faults() {
        let mut page = spec(ExportForm::Page);
        page.motions = vec![clip(), captured()];
        page.file = "ada".into();
        page.distillation = Some(Distillation {
            seconds: 90.0,
            size: 0,
            ..Distillation::default()
        });
        let mut mesh = spec(ExportForm::MeshGlb);
        (mesh.triangles, mesh.texture, mesh.rest) = (500, 64, true);
        let mut still = spec(ExportForm::SplatsPly);
        still.frame = Some(9);
        let mut driven = still.clone();
        driven.motions = vec![clip()];
        for good in [page, mesh, still, driven, spec(ExportForm::MeshObj)] {
            assert_eq!(faults(&good), [], "{good:?}");
        }
    }

    #[test]
    fn every_fault_is_named_with_its_path() {
        type Change = fn(&mut ExportSpec);
        let cases: [(ExportForm, Change, &[&str]); 18] = [
            (ExportForm::Unspecified, |_| (), &["form"]),
            (ExportForm::Page, |it| it.form = 99, &["form"]),
            (ExportForm::Page, |it| it.frame = Some(0), &["frame"]),
            (ExportForm::Page, |it| it.triangles = 500, &["triangles"]),
            (ExportForm::SplatsSpz, |it| it.texture = 512, &["texture"]),
            (ExportForm::MeshGlb, |it| it.texture = 9000, &["texture"]),
            (ExportForm::MeshObj, |it| it.triangles = 99, &["triangles"]),
            (ExportForm::MeshPly, |it| it.rest = true, &["rest"]),
            (
                ExportForm::MeshGlb,
                |it| it.max_bytes = 5000,
                &["max_bytes"],
            ),
            (ExportForm::Page, |it| it.max_bytes = 999, &["max_bytes"]),
            (
                ExportForm::SplatsGlb,
                |it| it.motions = vec![clip()],
                &["frame"],
            ),
            (
                ExportForm::SplatsGlb,
                |it| (it.motions, it.frame) = (vec![clip(), captured()], Some(0)),
                &["motions"],
            ),
            (
                ExportForm::Page,
                |it| (it.motions, it.rest) = (vec![captured(); 65], true),
                &["motions", "rest"],
            ),
            (
                ExportForm::Page,
                |it| {
                    it.motions = vec![ExportMotion::default(), captured(), clip()];
                    it.motions[1].up = vec![0.0, 1.0, 0.0];
                    it.motions[2].up = vec![0.0, 2.0, 0.0];
                    it.motions[2].name = "a\nb".into();
                },
                &[
                    "motions[0].motion",
                    "motions[1].up",
                    "motions[2].name",
                    "motions[2].up",
                ],
            ),
            (
                ExportForm::Page,
                |it| {
                    it.motions = vec![clip()];
                    let Some(Motion::Clip(clip)) = &mut it.motions[0].motion else {
                        return;
                    };
                    clip.fps = 0.0;
                    clip.poses[0].rotations.push(0.0);
                },
                &[
                    "motions[0].clip.fps",
                    "motions[0].clip.poses[0].rotations",
                    "motions[0].clip.poses[0].rotations",
                ],
            ),
            (
                ExportForm::Page,
                |it| {
                    it.distillation = Some(Distillation {
                        seconds: f64::NAN,
                        size: 8,
                        ..Distillation::default()
                    });
                },
                &["distillation.seconds", "distillation.size"],
            ),
            (ExportForm::Page, |it| it.file = "../ada".into(), &["file"]),
            (
                ExportForm::Page,
                |it| {
                    it.motions = vec![captured()];
                    if let Some(Motion::Capture(it)) = &mut it.motions[0].motion {
                        it.frame_count = 100_001;
                    }
                },
                &["motions[0].capture.frame_count"],
            ),
        ];
        for (form, change, expected) in cases {
            let mut spec = spec(form);
            change(&mut spec);
            assert_eq!(fields(&spec), expected, "{spec:?}");
        }
    }
}
