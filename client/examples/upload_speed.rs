//! How fast an upload is, against a plain copy of the same bytes on the same disk.
//!
//! ```text
//! cargo run -p yoto-client --no-default-features --example upload_speed -- --mib 256
//! ```
//!
//! Both end when all bytes are durable. An upload also reads its files once to hash them, sends them over
//! a local TCP connection, and has the service read them back to compare.
#![allow(
    clippy::disallowed_macros,
    reason = "a table on standard output is all it makes"
)]

use anyhow::Context;
use clap::Parser;
use rand::{Rng, SeedableRng};
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;
use tokio::net::TcpListener;
use tokio_stream::wrappers::TcpListenerStream;
use yoto_client::api::{FileSource, UploadFile, YotoClient};
use yoto_server::{Coordinator, ServerConfig};

/// Bytes that the copy reads and writes at once.
const COPIED_AT_ONCE: usize = 1 << 20;

#[derive(Parser)]
struct Options {
    /// Size of a capture, MiB.
    #[arg(long, default_value_t = 256)]
    mib: u64,
    /// Number of runs; the order of copy and upload changes with each.
    #[arg(long, default_value_t = 5)]
    runs: u32,
    /// Where to write; by default, a temporary folder in the current one.
    #[arg(long)]
    folder: Option<PathBuf>,
}

#[tokio::main]
async fn main() -> anyhow::Result<()> {
    let options = Options::parse();
    let parent = options.folder.clone().unwrap_or_else(|| ".".into());
    let folder = tempfile::tempdir_in(parent).context("making a folder")?;
    let coordinator = Coordinator::open(ServerConfig::new(folder.path().join("data"))).await?;
    let listener = TcpListener::bind("127.0.0.1:0").await?;
    let server = format!("http://{}", listener.local_addr()?);
    let incoming = TcpListenerStream::new(listener);
    let serving = tokio::spawn(coordinator.serve(incoming, std::future::pending()));
    let client = YotoClient::connect(&server).await?;
    println!(
        "{:>26}  {:>10}  {:>10}  {:>6}",
        "capture", "copy MB/s", "upload MB/s", "ratio"
    );
    for (what, count) in [("one film", 1), ("1,000 pictures", 1000)] {
        let source = folder.path().join(what);
        let files = generate(&source, options.mib << 20, count)?;
        let mut ratios = Vec::new();
        for run in 0..options.runs {
            let copied = folder.path().join("copied");
            let (copy, upload) = if run % 2 == 0 {
                let copy = copy(&files, &copied)?;
                (copy, upload(&client, &files, run).await?)
            } else {
                let upload = upload(&client, &files, run).await?;
                (copy(&files, &copied)?, upload)
            };
            std::fs::remove_dir_all(&copied)?;
            let rate = |seconds: f64| (options.mib << 20) as f64 / 1e6 / seconds;
            println!(
                "{what:>26}  {:>10.0}  {:>10.0}  {:>6.2}",
                rate(copy),
                rate(upload),
                copy / upload
            );
            ratios.push(copy / upload);
        }
        ratios.sort_by(f64::total_cmp);
        println!("{what:>26}  median ratio {:.2}", ratios[ratios.len() / 2]);
    }
    coordinator.close().await;
    serving.await??;
    Ok(())
}

/// Writes `bytes` bytes of noise into `count` files, which nothing compresses away.
fn generate(folder: &Path, bytes: u64, count: u64) -> anyhow::Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder)?;
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(count);
    let mut content = vec![0; usize::try_from(bytes / count)?];
    let mut files = Vec::new();
    for number in 0..count {
        random.fill_bytes(&mut content);
        let path = folder.join(format!("{number:06}.png"));
        std::fs::write(&path, &content)?;
        files.push(path);
    }
    Ok(files)
}

/// Copies the files one after another, each with an fsync, and syncs their folder. Returns the seconds that
/// it took.
fn copy(files: &[PathBuf], to: &Path) -> anyhow::Result<f64> {
    let began = Instant::now();
    std::fs::create_dir_all(to)?;
    let mut buffer = vec![0; COPIED_AT_ONCE];
    for path in files {
        let name = path.file_name().context("has a name")?;
        let (mut from, mut copy) = (File::open(path)?, File::create(to.join(name))?);
        loop {
            let read = from.read(&mut buffer)?;
            if read == 0 {
                break;
            }
            copy.write_all(&buffer[..read])?;
        }
        copy.sync_data()?;
    }
    File::open(to)?.sync_all()?;
    Ok(began.elapsed().as_secs_f64())
}

/// Uploads the files as a capture of a new person. Returns the seconds that it took.
async fn upload(client: &YotoClient, files: &[PathBuf], run: u32) -> anyhow::Result<f64> {
    let subject = client.create_subject(&format!("run {run}"), "").await?;
    let began = Instant::now();
    let frames = files.iter().enumerate().map(|(number, path)| UploadFile {
        path: format!("frames/{number:06}.png"),
        source: FileSource::Disk(path.clone()),
    });
    let poses = UploadFile {
        path: "poses.json".into(),
        source: FileSource::Memory(b"{}".to_vec()),
    };
    let files = frames.chain([poses]).collect();
    let capture = client.upload_capture(&subject.name, files, |_| {}).await?;
    let seconds = began.elapsed().as_secs_f64();
    // Nothing reads it: its bytes are only in the way.
    client.cancel_job(&capture.ingest_job).await?;
    client.delete_capture(&capture.name, &capture.etag).await?;
    Ok(seconds)
}
