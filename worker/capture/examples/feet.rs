//! How far feet slide when one person moves like another.
//!
//! `cargo run -p yoto-capture --example feet -- DRIVER-DIR TARGET-DIR…`
//!
//! Prints, for the motion of the driver's capture on its own body and on that of each target, the mean
//! speed of feet that rest, as retargeted and with their feet planted.

use yoto_capture::camera::Camera;
use yoto_capture::skeleton::{Pose, Skeleton, feet::Footing, retarget};
use yoto_proto::pose_track::PoseTrack;

type Fault = Box<dyn std::error::Error + Send + Sync>;

fn main() -> Result<(), Fault> {
    let folders: Vec<String> = std::env::args().skip(1).collect();
    let (track, driver) = read(folders.first().ok_or("no folder of a driver")?)?;
    let poses = track.frames.iter().map(Pose::from_frame);
    let poses: Vec<Pose> = poses.collect::<Result<_, _>>()?;
    let first = f64::from(track.frames[0].index);
    let seconds = track
        .frames
        .iter()
        .map(|it| (f64::from(it.index) - first) / track.fps);
    let seconds: Vec<f64> = seconds.collect();
    let up = Camera::from_frame(&track.frames[0], track.image_size)?.world_up();
    let footing = Footing::of(&driver, &poses, &seconds, up);
    let resting = footing.rests.iter().flatten().filter(|it| **it).count();
    println!("{resting} of {} feet rest", 2 * poses.len());
    for folder in &folders {
        let (_, body) = read(folder)?;
        let moved = poses.iter().map(|pose| retarget(&driver, &body, pose));
        let mut moved: Vec<Pose> = moved.collect::<Result<_, _>>()?;
        let slides = |poses: &[Pose]| {
            let slides = footing.sliding(&body, poses, &seconds);
            slides.map_or_else(
                || "none rest".into(),
                |it| format!("{:.1} mm/s", 1000.0 * it),
            )
        };
        let before = slides(&moved);
        footing.plant(&body, &mut moved, &seconds);
        println!("{folder}: {before}, planted {}", slides(&moved));
    }
    Ok(())
}

fn read(folder: &str) -> Result<(PoseTrack, Skeleton), Fault> {
    let bytes = std::fs::read(std::path::Path::new(folder).join("poses.json"))?;
    let track = PoseTrack::from_json(&bytes).map_err(|it| format!("{folder}: {it:?}"))?;
    let body = Skeleton::from_track(&track.skeleton)?;
    Ok((track, body))
}
