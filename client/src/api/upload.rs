//! Uploads of captures: files as one stream of headers and chunks.

use super::{ClientError, YotoClient};
use sha2::{Digest, Sha256};
use std::path::PathBuf;
use tokio::io::AsyncReadExt;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use yoto_proto::v1::upload_capture_request::Part;
use yoto_proto::v1::{CaptureHeader, FileHeader, UploadCaptureRequest, UploadCaptureResponse};

/// Bytes of one chunk: far below any message limit, large enough for full speed.
const CHUNK: usize = 256 << 10;

/// Source of a file's content.
#[derive(Debug, Clone)]
pub enum FileSource {
    /// Read from disk while it is sent.
    Disk(PathBuf),
    /// Held in memory.
    Memory(Vec<u8>),
}

/// One file of a capture.
#[derive(Debug, Clone)]
pub struct UploadFile {
    /// Path inside the capture: "poses.json", "frames/000000.png".
    pub path: String,
    /// Its content.
    pub source: FileSource,
}

impl YotoClient {
    /// Uploads one capture of `subject` and starts its ingest job. `on_bytes` receives
    /// each chunk's size once it is sent.
    ///
    /// Files are sent in the order given: the pose track belongs last, so that an upload
    /// that ends early can't be mistaken for a complete one.
    ///
    /// # Errors
    /// [`ClientError::File`] when a file can't be read; [`ClientError::Refused`].
    pub async fn upload_capture(
        &self,
        subject: &str,
        files: Vec<UploadFile>,
        on_bytes: impl FnMut(u64),
    ) -> Result<UploadCaptureResponse, ClientError> {
        let (parts, queue) = mpsc::channel(4);
        let mut service = self.subject_service();
        let call = service.upload_capture(ReceiverStream::new(queue));
        tokio::pin!(call);
        let refused = ClientError::refused(format!("uploading a capture of {subject}"));
        tokio::select! {
            fed = feed(parts, subject, files, on_bytes) => fed?,
            // The service may refuse before the last byte.
            early = &mut call => return Ok(early.map_err(refused)?.into_inner()),
        }
        Ok(call.await.map_err(refused)?.into_inner())
    }
}

type Parts = mpsc::Sender<UploadCaptureRequest>;

/// Sends all parts; returns early when the call has ended, since its answer has the reason.
async fn feed(
    parts: Parts,
    subject: &str,
    files: Vec<UploadFile>,
    mut on_bytes: impl FnMut(u64),
) -> Result<(), ClientError> {
    let header = Part::Header(CaptureHeader {
        subject: subject.to_owned(),
    });
    let mut open = send(&parts, header).await;
    for file in files {
        if !open {
            break;
        }
        open = match file.source {
            FileSource::Memory(bytes) => {
                let sha256 = yoto_proto::sha256_hex(&bytes);
                let header = FileHeader {
                    path: file.path,
                    bytes: bytes.len() as u64,
                    sha256,
                };
                let mut open = send(&parts, Part::File(header)).await;
                for chunk in bytes.chunks(CHUNK) {
                    open = open && send(&parts, Part::Chunk(chunk.to_vec())).await;
                    on_bytes(chunk.len() as u64);
                }
                open
            }
            FileSource::Disk(disk) => {
                feed_from_disk(&parts, file.path, disk, &mut on_bytes).await?
            }
        };
    }
    Ok(())
}

async fn feed_from_disk(
    parts: &Parts,
    path: String,
    disk: PathBuf,
    on_bytes: &mut impl FnMut(u64),
) -> Result<bool, ClientError> {
    let (bytes, sha256) = measure(&disk).await?;
    let mut open = send(
        parts,
        Part::File(FileHeader {
            path,
            bytes,
            sha256,
        }),
    )
    .await;
    let mut reader = ChunkReader::open(disk).await?;
    while open && let Some(chunk) = reader.next().await? {
        let length = chunk.len() as u64;
        open = send(parts, Part::Chunk(chunk)).await;
        on_bytes(length);
    }
    Ok(open)
}

async fn send(parts: &Parts, part: Part) -> bool {
    parts
        .send(UploadCaptureRequest { part: Some(part) })
        .await
        .is_ok()
}

/// Size and SHA-256 of a file that may be larger than memory.
pub(super) async fn measure(disk: &std::path::Path) -> Result<(u64, String), ClientError> {
    let mut reader = ChunkReader::open(disk.to_owned()).await?;
    let (mut bytes, mut hash) = (0, Sha256::new());
    while let Some(chunk) = reader.next().await? {
        bytes += chunk.len() as u64;
        hash.update(&chunk);
    }
    Ok((bytes, yoto_proto::hex(&hash.finalize())))
}

struct ChunkReader {
    path: PathBuf,
    file: tokio::fs::File,
}

impl ChunkReader {
    async fn open(path: PathBuf) -> Result<Self, ClientError> {
        let file = tokio::fs::File::open(&path)
            .await
            .map_err(ClientError::file("opening", &path))?;
        Ok(Self { path, file })
    }

    /// Up to [`CHUNK`] bytes; `None` at the end.
    async fn next(&mut self) -> Result<Option<Vec<u8>>, ClientError> {
        let mut chunk = Vec::with_capacity(CHUNK);
        let mut limited = (&mut self.file).take(CHUNK as u64);
        limited
            .read_to_end(&mut chunk)
            .await
            .map_err(ClientError::file("reading", &self.path))?;
        Ok((!chunk.is_empty()).then_some(chunk))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_file_from_disk_and_one_from_memory_become_the_same_parts() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let content: Vec<u8> = (0..CHUNK + 9).map(|i| (i % 251) as u8).collect();
        let disk = dir.path().join("a.png");
        std::fs::write(&disk, &content).expect("writes");
        let mut streams = Vec::new();
        for source in [FileSource::Disk(disk), FileSource::Memory(content.clone())] {
            let (parts, mut queue) = mpsc::channel(16);
            let mut sent = 0;
            let files = vec![UploadFile {
                path: "frames/000000.png".into(),
                source,
            }];
            feed(parts, "subjects/1", files, |bytes| sent += bytes)
                .await
                .expect("feeds");
            assert_eq!(sent, content.len() as u64);
            let mut stream = Vec::new();
            while let Some(part) = queue.recv().await {
                stream.push(part);
            }
            streams.push(stream);
        }
        assert_eq!(streams[0], streams[1]);
        assert_eq!(streams[0].len(), 4, "header, file, two chunks");
        let Some(Part::File(file)) = &streams[0][1].part else {
            panic!("a file header comes second")
        };
        assert_eq!(
            (file.bytes, file.sha256.as_str()),
            (
                content.len() as u64,
                yoto_proto::sha256_hex(&content).as_str()
            )
        );
    }

    #[tokio::test]
    async fn a_missing_file_is_named() {
        let (parts, _queue) = mpsc::channel(16);
        let source = FileSource::Disk("/nowhere/poses.json".into());
        let files = vec![UploadFile {
            path: "poses.json".into(),
            source,
        }];
        let error = feed(parts, "subjects/1", files, |_| {})
            .await
            .expect_err("there is no such file");
        assert!(error.to_string().contains("/nowhere/poses.json"), "{error}");
    }
}
