//! The speed of uploads to a coordinator of the same process, for docs/operate/storage.md:
//! `cargo run -p yoto-client --example upload_speed [FOLDER]`. Data and files are below FOLDER, or in the folder for temporary
//! files, and are removed.
//!
//! Beside each upload, the same files are copied with a sync of each, on the same disk.

use std::error::Error;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tokio::net::TcpListener;
use yoto_client::{FileSource, UploadFile, YotoClient};
use yoto_server::{Coordinator, ServerConfig};

/// Bytes of all files of an upload.
const BYTES: usize = 500_000_000;
/// Measurements of each upload.
const RUNS: usize = 5;

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let below = std::env::args_os().nth(1).map(PathBuf::from);
    let below = below.unwrap_or_else(std::env::temp_dir);
    let folder = tempfile::tempdir_in(below)?;
    for (what, count) in [("one film", 1), ("1,000 pictures", 1000)] {
        let files = make(&folder.path().join(format!("{count}")), count)?;
        let (mut copies, mut uploads) = (Vec::new(), Vec::new());
        for run in 0..RUNS {
            let place = folder.path().join(format!("run-{run}"));
            fs::create_dir(&place)?;
            copies.push(copy(&files, &place.join("copy"))?);
            uploads.push(upload(&files, &place.join("data")).await?);
            fs::remove_dir_all(&place)?;
        }
        let [copies, uploads] = [copies, uploads].map(summary);
        writeln!(std::io::stdout(), "{what}: upload {uploads}; copy {copies}")?;
    }
    Ok(())
}

/// Makes `count` files of [`BYTES`] bytes in all.
fn make(folder: &Path, count: usize) -> std::io::Result<Vec<UploadFile>> {
    fs::create_dir(folder)?;
    let mut files = Vec::new();
    // Xorshift: no file is like another.
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    for number in 0..count {
        let mut content = Vec::with_capacity(BYTES / count);
        while content.len() < BYTES / count {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            content.extend_from_slice(&state.to_le_bytes());
        }
        let on_disk = folder.join(format!("{number:06}.png"));
        fs::write(&on_disk, content)?;
        files.push(UploadFile {
            path: format!("frames/{number:06}.png"),
            source: FileSource::Disk(on_disk),
        });
    }
    files.push(UploadFile {
        path: "poses.json".into(),
        source: FileSource::Memory(b"{}".to_vec()),
    });
    Ok(files)
}

/// MB per second of a copy with a sync of each file.
fn copy(files: &[UploadFile], to: &Path) -> std::io::Result<f64> {
    fs::create_dir(to)?;
    let began = Instant::now();
    for (number, file) in files.iter().enumerate() {
        if let FileSource::Disk(from) = &file.source {
            let mut copied = File::create(to.join(format!("{number}")))?;
            copied.write_all(&fs::read(from)?)?;
            copied.sync_all()?;
        }
    }
    Ok(BYTES as f64 / 1e6 / began.elapsed().as_secs_f64())
}

/// MB per second of an upload, from the first checksum to the queued ingest job.
async fn upload(files: &[UploadFile], data: &Path) -> Result<f64, Box<dyn Error>> {
    let coordinator = Coordinator::open(ServerConfig::new(data)).await?;
    let listener = TcpListener::bind("127.0.0.1:0").await?;
    let server = format!("http://{}", listener.local_addr()?);
    let incoming = yoto_server::tcp(listener);
    let serving = tokio::spawn(coordinator.serve(incoming, std::future::pending()));
    let client = YotoClient::connect(&server).await?;
    let subject = client.create_subject("Ada", "").await?.name;
    let files = files.iter().map(|file| UploadFile {
        path: file.path.clone(),
        source: file.source.clone(),
    });
    let files: Vec<_> = files.collect();
    let began = Instant::now();
    client.upload_capture(&subject, files, |_| ()).await?;
    let seconds = began.elapsed().as_secs_f64();
    drop(client);
    coordinator.close().await;
    serving.await??;
    Ok(BYTES as f64 / 1e6 / seconds)
}

/// Median, least and most.
fn summary(mut speeds: Vec<f64>) -> String {
    speeds.sort_by(f64::total_cmp);
    let at = |index: usize| speeds.get(index).copied().unwrap_or(f64::NAN);
    format!(
        "{:.0} MB/s ({:.0} to {:.0})",
        at(speeds.len() / 2),
        at(0),
        at(speeds.len().saturating_sub(1))
    )
}
