//! Faulty captures at a real service: each ends REJECTED with a code, a file and, if applicable, a
//! frame and a field; worker and service keep running.

mod archives;
mod client;
mod limits;
mod media;
mod poses;

use anyhow::{Context, ensure};
use std::path::Path;
use yoto_client::{UploadFile, YotoClient};
use yoto_proto::v1::job::State;
use yoto_synthetic::SyntheticPerson;
use yoto_tests::film::write_mp4;
use yoto_tests::people::write_capture;
use yoto_tests::process::Service;
use yoto_tests::upload::{Ingested, file, files, ingest};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const FRAMES: usize = 4;
const SIDE: u32 = 32;

/// Expected outcome of an upload.
struct Case {
    name: &'static str,
    files: Vec<UploadFile>,
    /// Of the first violation.
    code: &'static str,
    /// Start of its line: file, frame, field.
    starts: &'static str,
}

impl Case {
    fn new(
        name: &'static str,
        files: Vec<UploadFile>,
        code: &'static str,
        starts: &'static str,
    ) -> Self {
        Self {
            name,
            files,
            code,
            starts,
        }
    }
}

/// Uploads all of `cases` to one service, which must reject each with its reason and accept
/// `good` afterwards.
async fn all_are_rejected(
    dir: &Path,
    cases: Vec<Case>,
    good: Vec<UploadFile>,
) -> anyhow::Result<()> {
    let service = Service::start(YOTO, &dir.join("data"), true)?;
    let client = YotoClient::connect(&service.address).await?;
    for case in cases {
        let ended = ingest(&client, case.name, case.files).await?;
        rejected(&ended, case.code, case.starts).context(case.name)?;
        let error = ended.job.error.context("an error")?;
        ensure!(error.code == "REJECTED", "{}: {error:?}", case.name);
    }
    goes_through(&client, good).await
}

async fn goes_through(client: &YotoClient, good: Vec<UploadFile>) -> anyhow::Result<()> {
    let ended = ingest(client, "good", good).await?;
    ensure!(ended.job.state() == State::Succeeded, "{:?}", ended.said);
    Ok(())
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

/// A capture of pictures.
fn pictures(dir: &Path) -> anyhow::Result<Vec<UploadFile>> {
    write_capture(&SyntheticPerson::cast(1, 7)[0], FRAMES, SIDE, dir)?;
    files(dir)
}

/// A capture of a film, masks and poses.
fn film(dir: &Path) -> anyhow::Result<Vec<UploadFile>> {
    let person = &SyntheticPerson::cast(1, 7)[0];
    write_capture(person, FRAMES, SIDE, dir)?;
    let (track, frames) = person.capture(FRAMES, SIDE);
    write_mp4(&frames, track.fps.round() as u32, &dir.join("video.mp4"))?;
    Ok(without(&files(dir)?, "frames/"))
}

/// The capture with another file at `path`.
fn with(files: &[UploadFile], path: &str, bytes: impl Into<Vec<u8>>) -> Vec<UploadFile> {
    let mut files = without(files, path);
    files.push(file(path, bytes));
    files
}

/// The capture without files with paths that begin with `start`.
fn without(files: &[UploadFile], start: &str) -> Vec<UploadFile> {
    let mut files = files.to_vec();
    files.retain(|file| !file.path.starts_with(start));
    files
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
