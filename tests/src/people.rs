//! Captures of synthetic people on disk, like those of users.

use anyhow::Context;
use serde_json::{Value, json};
use std::path::Path;
use yoto_capture::FrameImage;
use yoto_capture::camera::{Camera, Pose};
use yoto_import::write_images;
use yoto_proto::pose_track::PoseTrack;
use yoto_synthetic::SyntheticPerson;

/// Writes the capture of `person` as `poses.json`, `frames/` and `masks/` into `dir`.
///
/// # Errors
/// When a file can't be written.
pub fn write_capture(
    person: &SyntheticPerson,
    frames: usize,
    size: u32,
    dir: &Path,
) -> anyhow::Result<PoseTrack> {
    let (track, images) = person.capture(frames, size);
    write_images(&track, &images, dir)?;
    Ok(track)
}

/// Writes a capture with `eval/cam00` and `eval_pose/cam00` beside `train/`: views and poses to measure with.
///
/// # Errors
/// When a file can't be written.
pub fn write_capture_with_held_out(
    person: &SyntheticPerson,
    frames: usize,
    size: u32,
    dir: &Path,
) -> anyhow::Result<()> {
    let track = write_capture(person, frames, size, &dir.join("train"))?;
    std::fs::remove_file(dir.join("train/poses.json"))?;
    let camera = &SyntheticPerson::held_out_cameras(size)[0];
    let viewed: Vec<u32> = vec![0, frames as u32 / 2];
    for &index in &viewed {
        let pose = Pose::from_frame(&track.frames[index as usize])?;
        write_image(
            &dir.join("eval/cam00"),
            index,
            &person.render(&pose, camera),
        )?;
    }
    let mut poses = Vec::new();
    for (i, pose) in person.unseen_motion(4).iter().enumerate() {
        let index = (frames + i) as u32;
        write_image(
            &dir.join("eval_pose/cam00"),
            index,
            &person.render(pose, camera),
        )?;
        poses.push(json!({
            "index": index,
            "pose": pose.rotations.concat(),
            "translation": pose.translation,
        }));
    }
    let mut json = serde_json::to_value(&track)?;
    json["eval"] = json!({ "cam00": with_frames(camera, &viewed) });
    json["eval_pose"] = json!({ "frames": poses, "cams": { "cam00": with_frames(camera, &[]) } });
    write_json(&dir.join("poses.json"), &json)
}

fn with_frames(camera: &Camera, frames: &[u32]) -> Value {
    let mut value = json!({ "K": camera.k, "E": camera.e });
    if !frames.is_empty() {
        value["frames"] = json!(frames);
    }
    value
}

/// Writes `value` as the file at `path`.
///
/// # Errors
/// When the file can't be written.
pub fn write_json(path: &Path, value: &Value) -> anyhow::Result<()> {
    std::fs::write(path, serde_json::to_vec(value)?).with_context(|| path.display().to_string())
}

fn write_image(dir: &Path, index: u32, image: &FrameImage) -> anyhow::Result<()> {
    let (width, height) = (image.width as u32, image.height as u32);
    for (folder, bytes, colour) in [
        ("frames", &image.rgb, image::ColorType::Rgb8),
        ("masks", &image.mask, image::ColorType::L8),
    ] {
        let dir = dir.join(folder);
        std::fs::create_dir_all(&dir)?;
        let path = dir.join(format!("{index:06}.png"));
        image::save_buffer(&path, bytes, width, height, colour)
            .with_context(|| path.display().to_string())?;
    }
    Ok(())
}
