//! Pose tracks: invalid numbers, invalid trees, missing frames.

use super::{Case, all_are_rejected, film, pictures, with, without};
use anyhow::Context;
use serde_json::{Value, json};
use yoto_client::{FileSource, UploadFile};
use yoto_proto::pose_track::PoseTrack;

/// The track among `files`.
pub(super) fn track_of(files: &[UploadFile]) -> anyhow::Result<Value> {
    let found = files.iter().find(|file| file.path == "poses.json");
    match found.context("a track")?.source.clone() {
        FileSource::Memory(bytes) => Ok(serde_json::from_slice(&bytes)?),
        FileSource::Disk(path) => Ok(serde_json::from_slice(&std::fs::read(path)?)?),
    }
}

/// A good capture, and ways to break its pose track.
struct Good {
    files: Vec<UploadFile>,
    track: Value,
    text: String,
}

impl Good {
    fn new(files: Vec<UploadFile>) -> anyhow::Result<Self> {
        let track = track_of(&files)?;
        let text = track.to_string();
        Ok(Self { files, track, text })
    }

    /// With `text` as the pose track.
    fn raw(&self, text: &str) -> Vec<UploadFile> {
        with(&self.files, "poses.json", text)
    }

    fn edited(&self, edit: impl FnOnce(&mut Value)) -> Vec<UploadFile> {
        let mut track = self.track.clone();
        edit(&mut track);
        self.raw(&track.to_string())
    }

    /// With the edited track in the binary form.
    fn binary(&self, edit: impl FnOnce(&mut PoseTrack)) -> anyhow::Result<Vec<UploadFile>> {
        let mut track: PoseTrack = serde_json::from_value(self.track.clone())?;
        edit(&mut track);
        let files = without(&self.files, "poses.json");
        Ok(with(&files, "poses.pb", track.to_binary()))
    }

    /// The track's text with another frame rate.
    fn fps(&self, value: &str) -> String {
        let text = &self.text;
        text.replacen("\"fps\":15.0", &format!("\"fps\":{value}"), 1)
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn broken_pose_tracks_are_named_by_frame_and_field() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let good = Good::new(pictures(&dir.path().join("good"))?)?;
    anyhow::ensure!(
        good.fps("NaN") != good.text,
        "the track has another rate: {:.200}",
        good.text
    );
    let cases = [
        unreadable_texts(&good),
        binary_tracks(&good)?,
        trees(&good),
        frames(&good)?,
    ];
    all_are_rejected(
        dir.path(),
        cases.into_iter().flatten().collect(),
        good.files,
    )
    .await
}

fn unreadable_texts(good: &Good) -> Vec<Case> {
    vec![
        Case::new(
            "cut",
            good.raw(&good.text[..good.text.len() / 2]),
            "UNREADABLE",
            "poses.json: frames[",
        ),
        Case::new(
            "empty",
            good.raw(""),
            "UNREADABLE",
            "poses.json: EOF while parsing a value at line 1 column ",
        ),
        Case::new(
            "no JSON",
            good.raw("\u{89}PNG"),
            "UNREADABLE",
            "poses.json: expected value at line 1 column ",
        ),
        Case::new(
            "deep",
            good.raw(&"[".repeat(1 << 20)),
            "UNREADABLE",
            "poses.json: ",
        ),
        Case::new(
            "NaN",
            good.raw(&good.fps("NaN")),
            "UNREADABLE",
            "poses.json: fps: NaN is not a number that JSON has (line 1 column ",
        ),
        Case::new(
            "1e999",
            good.raw(&good.fps("1e999")),
            "UNREADABLE",
            "poses.json: fps: number out of range at line 1 column ",
        ),
    ]
}

fn binary_tracks(good: &Good) -> anyhow::Result<Vec<Case>> {
    Ok(vec![
        Case::new(
            "NaN in binary",
            good.binary(|it| it.frames[1].pose[4] = f64::NAN)?,
            "NOT_FINITE",
            "poses.pb frame 1: pose[4]: NaN",
        ),
        Case::new(
            "infinite in binary",
            good.binary(|it| it.frames[3].translation[2] = f64::INFINITY)?,
            "NOT_FINITE",
            "poses.pb frame 3: translation[2]: inf",
        ),
        Case::new(
            "no protocol buffers",
            with(
                &without(&good.files, "poses.json"),
                "poses.pb",
                *b"\xff\xff\xff",
            ),
            "UNREADABLE",
            "poses.pb: ",
        ),
    ])
}

fn trees(good: &Good) -> Vec<Case> {
    vec![
        Case::new(
            "a circle",
            good.edited(|it| {
                it["skeleton"]["parents"][1] = json!(2);
                it["skeleton"]["parents"][2] = json!(1);
            }),
            "CYCLE",
            "poses.json: skeleton.parents[1]: the parents of joints 1 → 2 → 1",
        ),
        Case::new(
            "two roots",
            good.edited(|it| it["skeleton"]["parents"][3] = json!(-1)),
            "BAD_TREE",
            "poses.json: skeleton.parents[3]: -1",
        ),
    ]
}

/// Numbers, indices and sizes of frames.
fn frames(good: &Good) -> anyhow::Result<Vec<Case>> {
    let fifth = |track: &mut Value| {
        let mut frame = track["frames"][3].clone();
        frame["index"] = json!(4);
        if let Some(frames) = track["frames"].as_array_mut() {
            frames.push(frame);
        }
    };
    let too_many: Vec<Value> = (0..100_001)
        .map(|index| json!({"index": index, "pose": [], "translation": [0, 0, 0]}))
        .collect();
    Ok(vec![
        Case::new(
            "1e30",
            good.edited(|it| it["frames"][2]["pose"][41] = json!(1e30)),
            "OUT_OF_RANGE",
            "poses.json frame 2: pose[41]: 1000000000000000000000000000000 is beyond",
        ),
        Case::new(
            "an index twice",
            good.edited(|it| it["frames"][2]["index"] = json!(1)),
            "DUPLICATE",
            "poses.json frame 1: index: ",
        ),
        Case::new(
            "60 000 pixels",
            good.edited(|it| it["image_size"] = json!([60_000, 60_000])),
            "OUT_OF_RANGE",
            "poses.json: image_size: 60000x60000",
        ),
        Case::new(
            "more poses than pictures",
            good.edited(fifth),
            "MISSING",
            "frames/000004.png frame 4: ",
        ),
        Case::new(
            "100 001 frames",
            good.edited(|it| {
                it["camera"] = json!({"K": it["frames"][0]["K"], "E": it["frames"][0]["E"]});
                it["frames"] = json!(too_many);
            }),
            "OUT_OF_RANGE",
            "poses.json: frames: 100001 frames: 1 to 100000",
        ),
        Case::new(
            "no track",
            without(&packed(&good.files)?, "poses"),
            "MISSING",
            "poses.json: ",
        ),
    ])
}

/// The pictures of `good` in an archive, without a pose track.
fn packed(good: &[UploadFile]) -> anyhow::Result<Vec<UploadFile>> {
    let mut builder = tar::Builder::new(Vec::new());
    for file in good.iter().filter(|file| file.path != "poses.json") {
        let FileSource::Memory(bytes) = &file.source else {
            continue;
        };
        let mut header = tar::Header::new_ustar();
        header.set_size(bytes.len() as u64);
        builder.append_data(&mut header, &file.path, &bytes[..])?;
    }
    Ok(vec![yoto_tests::upload::file(
        "capture.tar",
        builder.into_inner()?,
    )])
}

#[tokio::test(flavor = "multi_thread")]
async fn poses_without_a_frame_of_the_film_are_named() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let good = film(&dir.path().join("good"))?;
    let mut late = track_of(&good)?;
    late["frames"][3]["index"] = json!(9);
    let cases = vec![Case::new(
        "late",
        with(&good, "poses.json", late.to_string()),
        "MISSING",
        "video.mp4 frame 9: the pose track has this frame, but the video has only 4, 0 to 3",
    )];
    all_are_rejected(dir.path(), cases, good).await
}
