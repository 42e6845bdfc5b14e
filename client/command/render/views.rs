//! `--view-list`: poses and cameras of a user.

use serde::Deserialize;
use std::path::Path;
use yoto_proto::v1::{BodyPose, Camera, View, ViewList};

/// The file of `--view-list`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ViewFile {
    views: Vec<FileView>,
}

/// One view, with the fields of the pose track.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct FileView {
    pose: Vec<f32>,
    translation: [f32; 3],
    #[serde(rename = "K")]
    k: [[f64; 3]; 3],
    #[serde(rename = "E")]
    e: [[f64; 4]; 4],
    image_size: [u32; 2],
}

/// Reads a view list.
pub(crate) fn read_views(path: &Path) -> anyhow::Result<ViewList> {
    use anyhow::Context;
    let json = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
    let file: ViewFile =
        serde_json::from_slice(&json).with_context(|| format!("reading {}", path.display()))?;
    anyhow::ensure!(
        !file.views.is_empty(),
        "{}: views: the list is empty",
        path.display()
    );
    let view = |view: FileView| View {
        pose: Some(BodyPose {
            rotations: view.pose,
            translation: view.translation.to_vec(),
        }),
        camera: Some(Camera {
            width: view.image_size[0],
            height: view.image_size[1],
            intrinsics: view.k.concat(),
            extrinsics: view.e.concat(),
        }),
    };
    Ok(ViewList {
        views: file.views.into_iter().map(view).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_list_reads_in_the_terms_of_the_pose_track() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let path = dir.path().join("views.json");
        let view = r#"{"pose": [0, 1, 2], "translation": [0, 0, 3], "image_size": [64, 48],
            "K": [[9, 0, 32], [0, 9, 24], [0, 0, 1]],
            "E": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]]}"#;
        std::fs::write(&path, format!(r#"{{"views": [{view}]}}"#)).expect("writes");
        let views = read_views(&path).expect("reads").views;
        let camera = views[0].camera.as_ref().expect("has a camera");
        assert_eq!(
            (
                camera.width,
                camera.height,
                camera.intrinsics[5],
                camera.extrinsics[11]
            ),
            (64, 48, 24.0, 5.0)
        );

        std::fs::write(&path, r#"{"views": [{"pose": []}]}"#).expect("writes");
        let error = format!("{:#}", read_views(&path).expect_err("fields are missing"));
        assert!(
            error.contains("views.json") && error.contains("translation"),
            "{error}"
        );
    }
}
