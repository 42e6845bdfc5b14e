//! One stream of an upload: what the service has not committed yet, in order.

use super::{Meter, UploadFile, committed};
use crate::ClientError;
use bytes::Bytes;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Status;
use yoto_proto::crc32c;
use yoto_proto::key::Connection;
use yoto_proto::limits::CHUNK_BYTES;
use yoto_proto::v1::upload_service_client::UploadServiceClient;
use yoto_proto::v1::{FileHeader, Upload, WriteUploadRequest};

/// Chunks that are read ahead of the connection.
const AHEAD: usize = 4;

/// Sends all bytes of `files`, described by `headers`, that `upload` does not have. The inner error is
/// the service's or the connection's.
///
/// # Errors
/// [`ClientError::File`] when a file can't be read or has changed.
pub(super) async fn send<F: FnMut(u64)>(
    mut service: UploadServiceClient<Connection>,
    upload: &Upload,
    files: &[UploadFile],
    headers: &[FileHeader],
    meter: &mut Meter<F>,
) -> Result<Result<(), Status>, ClientError> {
    meter.reached(upload.committed_bytes);
    if upload.committed_bytes == upload.bytes {
        return Ok(Ok(()));
    }
    let (chunks, queue) = mpsc::channel(AHEAD);
    let call = service.write_upload(ReceiverStream::new(queue));
    tokio::pin!(call);
    tokio::select! {
        fed = feed(chunks, upload, files, headers, meter) => fed?,
        // The service may refuse before the last byte.
        early = &mut call => return Ok(early.map(drop)),
    }
    Ok(call.await.map(drop))
}

/// Feeds all chunks; returns early when the call has ended, since its answer has the reason.
async fn feed<F: FnMut(u64)>(
    chunks: mpsc::Sender<WriteUploadRequest>,
    upload: &Upload,
    files: &[UploadFile],
    headers: &[FileHeader],
    meter: &mut Meter<F>,
) -> Result<(), ClientError> {
    let committed = committed(upload);
    let mut behind = upload.committed_bytes;
    // A service with small parts gets small chunks: a chunk is committed as a whole.
    let chunk_bytes = upload.part_bytes.clamp(1, CHUNK_BYTES as u64);
    for (file, header) in files.iter().zip(headers) {
        let mut offset = committed.get(&*file.path).copied().unwrap_or(0);
        if offset == header.bytes {
            continue;
        }
        let mut reader = file
            .source
            .read_from(offset, header.bytes, chunk_bytes)
            .await?;
        while let Some(chunk) = reader.next().await? {
            let length = chunk.len() as u64;
            let message = WriteUploadRequest {
                upload: upload.name.clone(),
                path: file.path.clone(),
                offset,
                crc32c: crc32c(&chunk),
                chunk: Bytes::from(chunk),
            };
            if chunks.send(message).await.is_err() {
                return Ok(());
            }
            offset += length;
            behind += length;
            meter.reached(behind);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FileSource;
    use yoto_proto::v1::CommittedFile;

    #[tokio::test]
    async fn a_file_from_disk_and_one_from_memory_go_on_with_the_same_chunks() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let content: Vec<u8> = (0..2 * CHUNK_BYTES + 9).map(|i| (i % 251) as u8).collect();
        let disk = dir.path().join("a.png");
        std::fs::write(&disk, &content).expect("writes");
        let mut streams = Vec::new();
        for source in [FileSource::Disk(disk), FileSource::Memory(content.clone())] {
            let path = "frames/0.png".to_owned();
            let done = UploadFile {
                path: "done".into(),
                source: FileSource::Memory(vec![1]),
            };
            let files = [done, UploadFile { path, source }];
            let headers = [
                files[0].header().await.expect("is measured"),
                files[1].header().await.expect("is measured"),
            ];
            let commit = |path: &str, bytes| CommittedFile {
                path: path.into(),
                bytes,
            };
            let upload = Upload {
                name: "uploads/1".into(),
                part_bytes: 8 << 20,
                committed_bytes: 8,
                committed: vec![commit("done", 1), commit("frames/0.png", 7)],
                ..Upload::default()
            };
            let (chunks, mut queue) = mpsc::channel(16);
            let mut told = 0;
            let mut meter = Meter {
                on_bytes: |more| told += more,
                told: 0,
            };
            let fed = feed(chunks, &upload, &files, &headers, &mut meter).await;
            fed.expect("feeds");
            assert_eq!(told, content.len() as u64 + 1, "with what was there before");
            let mut stream = Vec::new();
            while let Some(chunk) = queue.recv().await {
                assert_eq!(crc32c(&chunk.chunk), chunk.crc32c);
                stream.push(chunk);
            }
            streams.push(stream);
        }
        assert_eq!(streams[0], streams[1]);
        assert_eq!(streams[0].len(), 3, "two full chunks, and a rest");
        assert_eq!(
            (streams[0][0].offset, streams[0][0].path.as_str()),
            (7, "frames/0.png")
        );
        let sent: Vec<u8> = streams[0].iter().flat_map(|it| it.chunk.to_vec()).collect();
        assert_eq!(sent, content[7..]);
    }
}
