//! Limits of the child that reads an upload, and its end by signals.

use super::{SIDE, YOTO, film, goes_through, rejected};
use anyhow::ensure;
use std::path::Path;
use std::process::Command;
use std::time::Instant;
use yoto_client::{UploadFile, YotoClient};
use yoto_proto::v1::job::State;
use yoto_synthetic::SyntheticPerson;
use yoto_tests::process::{PATIENCE, Process, Service};
use yoto_tests::upload::{file, ingest};

/// A capture of `frames` frames of `side` pixels per side, the same blank picture over and over.
fn vast(side: u32, frames: u32) -> anyhow::Result<Vec<UploadFile>> {
    let (mut track, _) = SyntheticPerson::cast(1, 7)[0].capture(frames as usize, SIDE);
    track.image_size = [side, side];
    let (mut rgb, mut mask) = (
        std::io::Cursor::new(Vec::new()),
        std::io::Cursor::new(Vec::new()),
    );
    image::RgbImage::new(side, side).write_to(&mut rgb, image::ImageFormat::Png)?;
    image::GrayImage::from_pixel(side, side, image::Luma([255]))
        .write_to(&mut mask, image::ImageFormat::Png)?;
    let mut files = vec![file("poses.json", serde_json::to_vec(&track)?)];
    for frame in &track.frames {
        files.push(file(
            &format!("frames/{:06}.png", frame.index),
            rgb.get_ref().clone(),
        ));
        files.push(file(
            &format!("masks/{:06}.png", frame.index),
            mask.get_ref().clone(),
        ));
    }
    Ok(files)
}

/// A good capture of `frames` frames whose images have `side` pixels per side, so that reading it
/// takes a while.
fn long(side: u32, frames: u32) -> anyhow::Result<Vec<UploadFile>> {
    let (mut track, images) = SyntheticPerson::cast(1, 7)[0].capture(frames as usize, SIDE);
    let scale = f64::from(side) / f64::from(SIDE);
    track.image_size = [side, side];
    for frame in &mut track.frames {
        for value in frame.k[..2].iter_mut().flatten() {
            *value *= scale;
        }
    }
    let mut files = vec![file("poses.json", serde_json::to_vec(&track)?)];
    for (frame, image) in track.frames.iter().zip(images) {
        let at = |x: u32, y: u32| (y * SIDE / side * SIDE + x * SIDE / side) as usize;
        let rgb = image::RgbImage::from_fn(side, side, |x, y| {
            let at = 3 * at(x, y);
            image::Rgb([image.rgb[at], image.rgb[at + 1], image.rgb[at + 2]])
        });
        let mask =
            image::GrayImage::from_fn(side, side, |x, y| image::Luma([image.mask[at(x, y)]]));
        let name = |kind: &str| format!("{kind}/{:06}.png", frame.index);
        files.push(file(&name("frames"), png(&rgb.into())?));
        files.push(file(&name("masks"), png(&mask.into())?));
    }
    Ok(files)
}

fn png(picture: &image::DynamicImage) -> anyhow::Result<Vec<u8>> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Png)?;
    Ok(bytes.into_inner())
}

/// A service whose worker has these options.
async fn limited(dir: &Path, options: &[&str]) -> anyhow::Result<(Service, Process, YotoClient)> {
    let service = Service::start(YOTO, &dir.join("data"), false)?;
    let worker = start_worker(&service.address, &service.objects, options)?;
    let client = YotoClient::connect(&service.address).await?;
    Ok((service, worker, client))
}

#[tokio::test(flavor = "multi_thread")]
async fn more_memory_than_allowed_ends_the_child_and_not_the_worker() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let good = film(&dir.path().join("good"))?;
    let (_service, _worker, client) = limited(dir.path(), &["--ingest-memory-mib", "400"]).await?;
    let ended = ingest(&client, "vast", vast(8192, 1)?).await?;
    rejected(&ended, "MEMORY_LIMIT", "frames/000000.png frame 0: ")?;
    goes_through(&client, good).await
}

#[tokio::test(flavor = "multi_thread")]
async fn more_time_than_allowed_ends_the_child() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let (_service, _worker, client) = limited(dir.path(), &["--ingest-seconds", "0"]).await?;
    let ended = ingest(&client, "slow", film(&dir.path().join("good"))?).await?;
    assert_eq!(ended.codes(), ["TIME_LIMIT"], "{:?}", ended.said);
    Ok(())
}

fn start_worker(address: &str, objects: &str, options: &[&str]) -> anyhow::Result<Process> {
    let mut arguments = vec!["worker", "--server", address, "--objects", objects];
    arguments.extend(options);
    Process::start(YOTO, &arguments)
}

/// The process id of the child that reads an upload for the process `worker`, once it is at
/// work on a frame.
fn child_of(worker: u32) -> anyhow::Result<u32> {
    let deadline = Instant::now() + PATIENCE;
    while Instant::now() < deadline {
        for entry in std::fs::read_dir("/proc")?.flatten() {
            let Some(id) = entry
                .file_name()
                .to_str()
                .and_then(|it| it.parse::<u32>().ok())
            else {
                continue;
            };
            let stat = std::fs::read_to_string(entry.path().join("stat")).unwrap_or_default();
            let parent = stat
                .rsplit(')')
                .next()
                .and_then(|it| it.split_whitespace().nth(1));
            let working = entry.path().join("cwd/pixels.bin").exists();
            if parent == Some(worker.to_string().as_str()) && working {
                return Ok(id);
            }
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    anyhow::bail!("no child was seen")
}

/// Sends `signal` to each of `processes`.
fn send(signal: &str, processes: &[u32]) -> anyhow::Result<()> {
    let ids = processes.iter().map(u32::to_string);
    let sent = Command::new("kill").arg(signal).args(ids).status()?;
    ensure!(sent.success(), "kill {signal} {processes:?}");
    Ok(())
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn a_killed_child_rejects_nothing_its_upload_is_read_again() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let (_service, worker, client) = limited(dir.path(), &[]).await?;
    let id = worker.id();
    let killer = std::thread::spawn(move || send("-KILL", &[child_of(id)?]));
    let ended = ingest(&client, "killed", long(2048, 40)?).await?;
    killer
        .join()
        .map_err(|_| anyhow::anyhow!("the killer broke down"))??;
    assert_eq!(ended.job.state(), State::Succeeded, "{:?}", ended.said);
    goes_through(&client, film(&dir.path().join("good"))?).await
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn a_worker_that_is_stopped_with_its_child_leaves_the_upload_to_the_next()
-> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let (service, worker, client) = limited(dir.path(), &[]).await?;
    let (address, objects) = (service.address.clone(), service.objects.clone());
    // Like a service manager, which ends all processes of a service at once.
    let stopper = std::thread::spawn(move || -> anyhow::Result<[Process; 2]> {
        send("-TERM", &[child_of(worker.id())?, worker.id()])?;
        let next = start_worker(&address, &objects, &[])?;
        Ok([worker, next])
    });
    let ended = ingest(&client, "stopped", long(2048, 40)?).await?;
    let _workers = stopper
        .join()
        .map_err(|_| anyhow::anyhow!("the stopper broke down"))??;
    assert_eq!(ended.job.state(), State::Succeeded, "{:?}", ended.said);
    assert_eq!(ended.job.lost_workers, 0, "it said that it stops");
    Ok(())
}
