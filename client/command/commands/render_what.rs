//! What to render: frame ranges and view lists of users.

use serde::Deserialize;
use std::path::Path;
use yoto_proto::v1::{BodyPose, Camera, FilmRange, View, ViewList};

/// `A..B:STEP`: every STEP-th frame from number A on, below number B. Each of the three may be left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FrameRange {
    pub first: u32,
    pub end: u32,
    pub step: u32,
}

impl FrameRange {
    /// All frames.
    pub(super) const ALL: Self = Self {
        first: 0,
        end: u32::MAX,
        step: 1,
    };

    /// The pictures of a film in the range.
    pub(super) fn of_film(self) -> FilmRange {
        FilmRange {
            first: self.first,
            count: self.count(),
            step: self.step,
        }
    }

    /// Number of frames in the range, if each number has one; 0 if it has no end.
    pub(super) fn count(self) -> u32 {
        match self.end {
            u32::MAX => 0,
            end => (end - self.first).div_ceil(self.step),
        }
    }
}

impl std::str::FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let shape = || format!("'{text}' is not of the form A..B or A..B:STEP, e.g. 0..60:2");
        let (range, step) = text.split_once(':').unwrap_or((text, "1"));
        let (first, end) = range.split_once("..").ok_or_else(shape)?;
        let number = |part: &str, absent: u32| match part {
            "" => Ok(absent),
            part => part.parse::<u32>().map_err(|_| shape()),
        };
        let range = Self {
            first: number(first, Self::ALL.first)?,
            end: number(end, Self::ALL.end)?,
            step: step.parse().map_err(|_| shape())?,
        };
        if range.step == 0 || range.end <= range.first {
            return Err(format!(
                "'{text}' holds no frame: B must be above A and STEP above 0"
            ));
        }
        Ok(range)
    }
}

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
pub(super) fn read_views(path: &Path) -> anyhow::Result<ViewList> {
    use anyhow::Context;
    let json = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
    let file: ViewFile =
        serde_json::from_slice(&json).with_context(|| format!("reading {}", path.display()))?;
    anyhow::ensure!(
        !file.views.is_empty(),
        "{}: views: there is none",
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
    fn ranges_count_their_frames() {
        let range: FrameRange = "10..20:3".parse().expect("a range");
        assert_eq!(
            (range, range.count()),
            (
                FrameRange {
                    first: 10,
                    end: 20,
                    step: 3
                },
                4
            )
        );
        assert_eq!("0..5".parse::<FrameRange>().map(FrameRange::count), Ok(5));
        assert_eq!("..".parse(), Ok(FrameRange::ALL));
        assert_eq!("7..".parse::<FrameRange>().map(FrameRange::count), Ok(0));
        assert_eq!("..7:2".parse::<FrameRange>().map(FrameRange::count), Ok(4));
        for bad in ["", "5", "5..5", "9..2", "0..9:0", "a..b", "0..9:", "-1..3"] {
            assert!(bad.parse::<FrameRange>().is_err(), "{bad}");
        }
    }

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
