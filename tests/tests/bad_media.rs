//! Media with something wrong in them: each upload ends REJECTED with a code, a file and,
//! where one is at fault, a frame; worker and service go on.

use anyhow::{Context, ensure};
use std::path::Path;
use std::process::Command;
use std::time::Instant;
use yoto_avatar::synthetic::SyntheticPerson;
use yoto_client::api::{UploadFile, YotoClient};
use yoto_proto::v1::job::State;
use yoto_tests::film::write_mp4;
use yoto_tests::people::write_capture;
use yoto_tests::process::{PATIENCE, Process, Service};
use yoto_tests::upload::{Ingested, file, files, ingest};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const FRAMES: usize = 4;
const SIDE: u32 = 32;

/// A capture of a film, masks and poses.
fn film(dir: &Path) -> anyhow::Result<Vec<UploadFile>> {
    let person = &SyntheticPerson::cast(1, 7)[0];
    write_capture(person, FRAMES, SIDE, dir)?;
    let (track, frames) = person.capture(FRAMES, SIDE);
    write_mp4(&frames, track.fps.round() as u32, &dir.join("video.mp4"))?;
    let mut files = files(dir)?;
    files.retain(|file| !file.path.starts_with("frames/"));
    Ok(files)
}

/// The capture with the file at `path` in place of its own.
fn with(files: &[UploadFile], path: &str, bytes: Vec<u8>) -> Vec<UploadFile> {
    let mut files = files.to_vec();
    files.retain(|file| file.path != path);
    files.push(file(path, bytes));
    files
}

fn rejected(ended: &Ingested, code: &str, starts: &str) -> anyhow::Result<()> {
    ensure!(
        ended.codes().first() == Some(&code) && ended.said[0].starts_with(starts),
        "{code} at '{starts}' was expected, not {:?} {:?}",
        ended.codes(),
        ended.said
    );
    Ok(())
}

/// A PNG that declares `side` x `side` pixels and holds one.
fn png_bomb(side: u32) -> anyhow::Result<Vec<u8>> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(1, 1).write_to(&mut bytes, image::ImageFormat::Png)?;
    let mut bytes = bytes.into_inner();
    bytes[16..20].copy_from_slice(&side.to_be_bytes());
    bytes[20..24].copy_from_slice(&side.to_be_bytes());
    let mut crc = !0u32;
    for &byte in &bytes[12..29] {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = crc >> 1 ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 };
        }
    }
    bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
    Ok(bytes)
}

/// A tar of one entry with the raw `name` and `kind`.
fn tar_of(name: &[u8], kind: tar::EntryType) -> anyhow::Result<Vec<u8>> {
    let mut header = tar::Header::new_ustar();
    header.as_mut_bytes()[..name.len()].copy_from_slice(name);
    header.set_entry_type(kind);
    header.set_size(1);
    header.set_cksum();
    let mut builder = tar::Builder::new(Vec::new());
    builder.append(&header, &b"x"[..])?;
    Ok(builder.into_inner()?)
}

/// Half a gibibyte of zeros as a zip.
fn zip_bomb() -> anyhow::Result<Vec<u8>> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let deflated = zip::write::SimpleFileOptions::default()
        .compression_method(zip::CompressionMethod::Deflated);
    writer.start_file("frames/000000.png", deflated)?;
    std::io::copy(
        &mut std::io::Read::take(std::io::repeat(0), 512 << 20),
        &mut writer,
    )?;
    Ok(writer.finish()?.into_inner())
}

#[tokio::test(flavor = "multi_thread")]
async fn broken_films_pictures_and_archives_are_named_and_a_good_one_still_goes_through()
-> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let good = film(&dir.path().join("good"))?;
    let mp4 = std::fs::read(dir.path().join("good/video.mp4"))?;
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let client = YotoClient::connect(&service.address).await?;
    let video = |bytes: Vec<u8>| with(&good, "video.mp4", bytes);

    let mut million = mp4.clone();
    let sizes = million
        .windows(4)
        .position(|it| it == b"stsz")
        .context("stsz")?
        + 8;
    million[sizes..sizes + 4].copy_from_slice(&1u32.to_be_bytes());
    million[sizes + 4..sizes + 8].copy_from_slice(&1_000_000u32.to_be_bytes());
    let mut garbled = mp4.clone();
    let frames = garbled
        .windows(4)
        .position(|it| it == b"mdat")
        .context("mdat")?
        + 4;
    garbled[frames + 8..frames + 200].fill(0xa5);
    let cases: Vec<(&str, Vec<UploadFile>, &str, &str)> = vec![
        (
            "cut",
            video(mp4[..mp4.len() / 2].to_vec()),
            "UNDECODABLE",
            "video.mp4: MP4: ",
        ),
        ("empty", video(Vec::new()), "EMPTY", "video.mp4: "),
        (
            "a picture",
            video(png_bomb(9)?),
            "UNDECODABLE",
            "video.mp4: is a PNG picture",
        ),
        (
            "a million frames",
            video(million),
            "TOO_LARGE",
            "video.mp4: the video has more than",
        ),
        ("garbled", video(garbled), "UNDECODABLE", "video.mp4 frame "),
        (
            "60,000 pixels",
            with(&good, "masks/000002.png", png_bomb(60_000)?),
            "TOO_LARGE",
            "masks/000002.png frame 2: declares 60000x60000",
        ),
        (
            "no mask",
            good.iter()
                .filter(|it| it.path != "masks/000001.png")
                .cloned()
                .collect(),
            "MISSING",
            "masks/000001.png frame 1: ",
        ),
        (
            "a plan with a typo",
            with(&good, "media.json", br#"{"evry": 2}"#.to_vec()),
            "UNREADABLE",
            "media.json: line 1 ",
        ),
        (
            "a way out",
            with(
                &good,
                "frames.tar",
                tar_of(b"../../poses.json", tar::EntryType::Regular)?,
            ),
            "UNSAFE_PATH",
            "frames.tar: ../../poses.json: ",
        ),
        (
            "a link",
            with(
                &good,
                "frames.tar",
                tar_of(b"frames", tar::EntryType::Symlink)?,
            ),
            "UNSAFE_PATH",
            "frames.tar: frames: ",
        ),
        (
            "a name that is no text",
            with(
                &good,
                "frames.tar",
                tar_of(b"fr\xe4me1.png", tar::EntryType::Regular)?,
            ),
            "BAD_NAME",
            "frames.tar: fr",
        ),
        (
            "a zip bomb",
            with(&good, "frames.zip", zip_bomb()?),
            "TOO_LARGE",
            "frames.zip: ",
        ),
        (
            "an archive that is none",
            with(&good, "frames.zip", b"not a zip".to_vec()),
            "UNDECODABLE",
            "frames.zip: ",
        ),
    ];
    for (name, files, code, starts) in cases {
        let ended = ingest(&client, name, files).await?;
        rejected(&ended, code, starts).context(name)?;
        assert_eq!(
            ended.job.error.context("an error")?.code,
            "REJECTED",
            "{name}"
        );
    }
    // A pose for which the film has no frame.
    let json: Vec<u8> = std::fs::read(dir.path().join("good/poses.json"))?;
    let mut track: serde_json::Value = serde_json::from_slice(&json)?;
    track["frames"][3]["index"] = serde_json::json!(9);
    let late = with(&good, "poses.json", serde_json::to_vec(&track)?);
    let ended = ingest(&client, "late", late).await?;
    rejected(&ended, "MISSING", "video.mp4 frame 9: ")?;

    let ended = ingest(&client, "good", good).await?;
    assert_eq!(ended.job.state(), State::Succeeded, "{:?}", ended.said);
    Ok(())
}

/// A capture of `frames` frames of `side` pixels a side, the same blank picture over and over.
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

/// A good capture of `frames` frames whose images have `side` pixels a side, so that reading it
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
    let mut arguments = vec![
        "worker",
        "--server",
        &service.address,
        "--objects",
        &service.objects,
    ];
    arguments.extend(options);
    let worker = Process::start(YOTO, &arguments)?;
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
    let ended = ingest(&client, "good", good).await?;
    assert_eq!(ended.job.state(), State::Succeeded, "{:?}", ended.said);
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn more_time_than_allowed_ends_the_child() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let (_service, _worker, client) = limited(dir.path(), &["--ingest-seconds", "0"]).await?;
    let ended = ingest(&client, "slow", film(&dir.path().join("good"))?).await?;
    assert_eq!(ended.codes(), ["TIME_LIMIT"], "{:?}", ended.said);
    Ok(())
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

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn a_killed_child_rejects_nothing_its_upload_is_read_again() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let good = film(&dir.path().join("good"))?;
    let (_service, worker, client) = limited(dir.path(), &[]).await?;
    let id = worker.id();
    let killer = std::thread::spawn(move || -> anyhow::Result<()> {
        let child = child_of(id)?.to_string();
        let killed = Command::new("kill").args(["-9", &child]).status()?;
        ensure!(killed.success(), "kill {child}");
        Ok(())
    });
    let ended = ingest(&client, "killed", long(2048, 40)?).await?;
    killer
        .join()
        .map_err(|_| anyhow::anyhow!("the killer broke down"))??;
    assert_eq!(ended.job.state(), State::Succeeded, "{:?}", ended.said);
    let ended = ingest(&client, "good", good).await?;
    assert_eq!(ended.job.state(), State::Succeeded, "{:?}", ended.said);
    Ok(())
}
