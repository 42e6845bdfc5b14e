//! Receives one capture: checks while the bytes arrive, and leaves nothing incomplete behind.
//!
//! Content is not read here. A capture that arrives complete but is faulty becomes REJECTED by
//! its ingest job, so that its owner sees the faults.

use super::{ObjectWriter, paths::CapturePaths};
use crate::{
    config::{MAX_MESSAGE_BYTES, UploadLimits},
    context::Context,
    error::RequestError,
    store::UploadedFile,
};
use futures::{Stream, StreamExt};
use prost::Message;
use sha2::{Digest, Sha256};
use std::sync::Arc;
use tonic::Status;
use yoto_proto::{
    hex, keys,
    media_plan::CAPTURE_ARCHIVES,
    names::Collection,
    pose_track,
    v1::{
        Capture, FileHeader, InputFile, ObjectRef, UploadCaptureRequest,
        upload_capture_request::Part,
    },
};

/// The ingest job's lease lists all files in one message; this leaves room for the rest.
const MAX_LISTING_BYTES: usize = MAX_MESSAGE_BYTES - (1 << 20);
/// A file up to this size is held in memory until its checksum is known; a larger one goes to
/// the store as it arrives, and becomes an object only if the checksum matches.
const HELD_BYTES: u64 = 8 << 20;
/// Memory to reserve at a file's header, before its first byte.
const MAX_RESERVED: u64 = 1 << 20;

/// Receives a capture to its end and starts its ingest job.
///
/// # Errors
/// When the stream ends early or violates a rule; the capture is then removed completely.
pub async fn receive<S>(context: Arc<Context>, mut parts: S) -> Result<Capture, RequestError>
where
    S: Stream<Item = Result<UploadCaptureRequest, Status>> + Unpin,
{
    let Some(Part::Header(header)) = next(&context, &mut parts).await? else {
        return Err(RequestError::invalid(
            "header",
            "a capture starts with its header",
        ));
    };
    let subject = Collection::Subjects
        .parse(&header.subject)
        .map_err(|error| RequestError::invalid("header.subject", error.to_string()))?;
    context.ensure_room(0)?;
    let id = context.store.begin_capture(subject).await?;
    let received = receive_files(&context, &id, &mut parts).await;
    match received {
        Ok(capture) => {
            tracing::info!(
                capture = capture.name,
                job = capture.ingest_job,
                "capture uploaded"
            );
            Ok(capture)
        }
        Err(error) => {
            // The first error is the answer; remains are removed at the next start.
            if let Err(leftover) = discard(&context, &id).await {
                tracing::error!(capture = id, error = %leftover, "could not remove an interrupted upload");
            }
            Err(error)
        }
    }
}

/// Removes the objects and the row of an unfinished upload. A capture with a finished upload
/// is not changed.
///
/// # Errors
/// When a store fails; the row stays until the objects are gone, so it can be tried again.
pub async fn discard(context: &Context, capture_id: &str) -> Result<(), RequestError> {
    if !context
        .store
        .unfinished_captures()
        .await?
        .iter()
        .any(|id| id == capture_id)
    {
        return Ok(());
    }
    let folder = keys::upload(capture_id, "");
    context
        .objects
        .delete_folder(folder.trim_end_matches('/'))
        .await?;
    Ok(context.store.discard_capture(capture_id).await?)
}

async fn receive_files<S>(
    context: &Context,
    capture_id: &str,
    parts: &mut S,
) -> Result<Capture, RequestError>
where
    S: Stream<Item = Result<UploadCaptureRequest, Status>> + Unpin,
{
    let mut upload = Upload::new(context, capture_id);
    if let Err(error) = upload.receive(parts).await {
        upload.give_up().await;
        return Err(error);
    }
    let files = upload.finish()?;
    Ok(context.store.finish_capture(capture_id, &files).await?)
}

/// The stream's next part; the wait is limited to the longest silence of a client.
async fn next<S>(context: &Context, parts: &mut S) -> Result<Option<Part>, RequestError>
where
    S: Stream<Item = Result<UploadCaptureRequest, Status>> + Unpin,
{
    let idle = context.config.upload.idle;
    let message = tokio::time::timeout(idle, parts.next())
        .await
        .map_err(|_| {
            let message = format!("nothing arrived for {} seconds", idle.as_secs_f64());
            RequestError::Stream(Status::deadline_exceeded(message))
        })?;
    match message {
        None => Ok(None),
        Some(Err(status)) => Err(RequestError::Stream(status)),
        Some(Ok(UploadCaptureRequest { part: Some(part) })) => Ok(Some(part)),
        Some(Ok(UploadCaptureRequest { part: None })) => Err(RequestError::invalid(
            "part",
            "a message needs a header, a file or a chunk",
        )),
    }
}

/// A file during its upload.
struct OpenFile {
    header: FileHeader,
    came: u64,
    hash: Sha256,
    into: Destination,
}

/// Destination of a file's bytes during its upload.
enum Destination {
    Memory(Vec<u8>),
    Store(Box<ObjectWriter>),
}

/// The received part of a capture.
struct Upload<'a> {
    context: &'a Context,
    limits: &'a UploadLimits,
    capture_id: &'a str,
    paths: CapturePaths,
    done: Vec<UploadedFile>,
    open: Option<OpenFile>,
    announced_bytes: u64,
    listing_bytes: usize,
}

impl<'a> Upload<'a> {
    fn new(context: &'a Context, capture_id: &'a str) -> Self {
        Self {
            context,
            limits: &context.config.upload,
            capture_id,
            paths: CapturePaths::default(),
            done: Vec::new(),
            open: None,
            announced_bytes: 0,
            listing_bytes: 0,
        }
    }

    /// Takes parts until the stream ends.
    async fn receive<S>(&mut self, parts: &mut S) -> Result<(), RequestError>
    where
        S: Stream<Item = Result<UploadCaptureRequest, Status>> + Unpin,
    {
        while let Some(part) = next(self.context, parts).await? {
            match part {
                Part::Header(_) => {
                    return Err(RequestError::invalid("header", "a capture has one header"));
                }
                Part::File(file) => self.begin(file).await?,
                Part::Chunk(chunk) => self.append(&chunk).await?,
            }
        }
        self.nothing_open()
    }

    /// Removes the open file from the store.
    async fn give_up(self) {
        if let Some(OpenFile {
            into: Destination::Store(writer),
            ..
        }) = self.open
            && let Err(error) = writer.abort().await
        {
            tracing::warn!(%error, "could not discard an incomplete file");
        }
    }

    async fn begin(&mut self, mut header: FileHeader) -> Result<(), RequestError> {
        self.nothing_open()?;
        header.sha256.make_ascii_lowercase();
        let shown: String = header.path.chars().take(80).collect();
        self.paths
            .add(&header.path)
            .map_err(|reason| RequestError::invalid("file.path", format!("'{shown}': {reason}")))?;
        if header.bytes > self.limits.file_bytes {
            let message = format!(
                "{shown}: {} bytes; a file has at most {}",
                header.bytes, self.limits.file_bytes
            );
            return Err(RequestError::invalid("file.bytes", message));
        }
        if !is_sha256(&header.sha256) {
            let message = format!("{shown}: a SHA-256 is 64 hex digits");
            return Err(RequestError::invalid("file.sha256", message));
        }
        self.announced_bytes = self.announced_bytes.saturating_add(header.bytes);
        if self.announced_bytes > self.limits.capture_bytes {
            let message = format!(
                "{shown}: a capture has at most {} bytes",
                self.limits.capture_bytes
            );
            return Err(RequestError::invalid("file.bytes", message));
        }
        self.context.ensure_room(header.bytes)?;
        // A message in a list costs its length, a tag, and up to four bytes for the length.
        self.listing_bytes += 5 + input_file(self.capture_id, &uploaded(&header)).encoded_len();
        if self.done.len() >= self.limits.files || self.listing_bytes > MAX_LISTING_BYTES {
            let message = format!(
                "{shown}: too many files, {} were sent before it",
                self.done.len()
            );
            return Err(RequestError::invalid("file", message));
        }
        let into = if header.bytes > HELD_BYTES {
            let key = keys::upload(self.capture_id, &header.path);
            Destination::Store(Box::new(self.context.objects.writer(&key).await?))
        } else {
            Destination::Memory(Vec::with_capacity(header.bytes.min(MAX_RESERVED) as usize))
        };
        self.open = Some(OpenFile {
            header,
            came: 0,
            hash: Sha256::new(),
            into,
        });
        self.store_if_whole().await
    }

    async fn append(&mut self, chunk: &[u8]) -> Result<(), RequestError> {
        let Some(open) = &mut self.open else {
            return Err(RequestError::invalid(
                "chunk",
                "a chunk follows a file that needs it",
            ));
        };
        let missing = open.header.bytes - open.came;
        if chunk.len() as u64 > missing {
            let message = format!(
                "{}: more than the {} bytes announced",
                open.header.path, open.header.bytes
            );
            return Err(RequestError::invalid("chunk", message));
        }
        open.hash.update(chunk);
        open.came += chunk.len() as u64;
        match &mut open.into {
            Destination::Memory(bytes) => bytes.extend_from_slice(chunk),
            Destination::Store(writer) => writer.write(chunk).await?,
        }
        self.store_if_whole().await
    }

    /// Checks and writes the open file after its last byte.
    async fn store_if_whole(&mut self) -> Result<(), RequestError> {
        let whole = |open: &OpenFile| open.came == open.header.bytes;
        let Some(open) = self.open.as_ref().filter(|open| whole(open)) else {
            return Ok(());
        };
        let found = hex(&open.hash.clone().finalize());
        if found != open.header.sha256 {
            let message = format!("{}: the received bytes have {found}", open.header.path);
            return Err(RequestError::invalid("file.sha256", message));
        }
        let Some(file) = self.open.take() else {
            return Ok(());
        };
        match file.into {
            Destination::Memory(bytes) => {
                let key = keys::upload(self.capture_id, &file.header.path);
                self.context.objects.put(&key, bytes.into()).await?;
            }
            Destination::Store(writer) => writer.finish().await?,
        }
        self.done.push(uploaded(&file.header));
        Ok(())
    }

    fn nothing_open(&self) -> Result<(), RequestError> {
        match &self.open {
            None => Ok(()),
            Some(open) => {
                let (came, all) = (open.came, open.header.bytes);
                let message = format!("{}: received {came} of {all} bytes", open.header.path);
                Err(RequestError::invalid("chunk", message))
            }
        }
    }

    fn finish(self) -> Result<Vec<UploadedFile>, RequestError> {
        let told =
            |path: &str| pose_track::FILES.contains(&path) || CAPTURE_ARCHIVES.contains(&path);
        if !self.done.iter().any(|file| told(&file.path)) {
            let message = format!(
                "the capture has none of {}, {}",
                pose_track::FILES.join(", "),
                CAPTURE_ARCHIVES.join(", ")
            );
            return Err(RequestError::invalid("file", message));
        }
        Ok(self.done)
    }
}

fn uploaded(header: &FileHeader) -> UploadedFile {
    UploadedFile {
        path: header.path.clone(),
        bytes: header.bytes,
        sha256: header.sha256.clone(),
    }
}

/// An uploaded file as the ingest job gets it.
pub fn input_file(capture_id: &str, file: &UploadedFile) -> InputFile {
    InputFile {
        path: file.path.clone(),
        object: Some(ObjectRef {
            key: keys::upload(capture_id, &file.path),
            bytes: file.bytes,
            sha256: file.sha256.clone(),
        }),
    }
}

/// Whether `text` is a SHA-256 in the contract's form.
pub fn is_sha256(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'))
}
