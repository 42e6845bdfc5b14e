//! The way of a file's bytes to a client: from the object store if it signs a URL and can be reached, otherwise through the
//! service. Each way goes on where the other one ended.

use super::direct::DirectError;
use super::retry::Retries;
use super::{ClientError, YotoClient};
use sha2::{Digest, Sha256};
use std::io::{self, SeekFrom};
use std::path::Path;
use tokio::io::{AsyncSeek, AsyncSeekExt, AsyncWrite, AsyncWriteExt};
use tonic::{Code, Status};
use yoto_proto::hex;
use yoto_proto::v1::{DownloadObjectRequest, NamedObject, SignDownloadRequest};

/// Smallest file that is worth a URL: a smaller one arrives with the answer that a URL would cost.
const WORTH_A_URL: u64 = 64 << 10;

/// A file on its way to `to`.
struct Transfer<'a, W> {
    object: &'a NamedObject,
    to: &'a mut W,
    /// Receives the size of each part.
    on_bytes: &'a mut (dyn FnMut(u64) + Send),
    hash: Sha256,
    offset: u64,
    /// Bytes that `on_bytes` has counted: after a new beginning, more than have arrived.
    counted: u64,
}

impl<W: AsyncWrite + AsyncSeek + Unpin> Transfer<'_, W> {
    async fn take(&mut self, chunk: &[u8]) -> io::Result<()> {
        self.hash.update(chunk);
        self.offset += chunk.len() as u64;
        if self.offset > self.counted {
            (self.on_bytes)(self.offset - self.counted);
            self.counted = self.offset;
        }
        self.to.write_all(chunk).await
    }

    /// Begins anew.
    async fn restart(&mut self) -> io::Result<()> {
        self.hash = Sha256::new();
        self.offset = 0;
        self.to.flush().await?;
        self.to.seek(SeekFrom::Start(0)).await.map(|_| ())
    }

    fn lacks_bytes(&self) -> bool {
        self.offset < self.object.bytes
    }

    fn is_right(&self) -> bool {
        hex(&self.hash.clone().finalize()) == self.object.sha256
    }
}

impl YotoClient {
    /// Writes the content of `object` to the beginning of `to`, which errors call `path`.
    pub(super) async fn receive<W: AsyncWrite + AsyncSeek + Unpin>(
        &self,
        object: &NamedObject,
        path: &Path,
        to: &mut W,
        on_bytes: &mut (dyn FnMut(u64) + Send),
    ) -> Result<(), ClientError> {
        let mut transfer = Transfer {
            object,
            to,
            on_bytes,
            hash: Sha256::new(),
            offset: 0,
            counted: 0,
        };
        let file = |error| ClientError::file("writing", path)(error);
        if object.bytes >= WORTH_A_URL {
            self.read_store(&mut transfer).await.map_err(file)?;
        }
        if object.bytes > 0 && !transfer.lacks_bytes() && !transfer.is_right() {
            // The service looks at the object and knows what is wrong.
            self.direct.reads.give_up(&DirectError::Altered.to_string());
            transfer.restart().await.map_err(file)?;
        }
        self.read_service(&mut transfer, path).await?;
        if transfer.is_right() {
            return Ok(());
        }
        Err(ClientError::Contract(format!(
            "fetching {}: {} bytes arrived with a wrong SHA-256",
            object.name, transfer.offset
        )))
    }

    /// Takes what the store sends by itself. Only an error of `transfer` is one.
    async fn read_store<W: AsyncWrite + AsyncSeek + Unpin>(
        &self,
        transfer: &mut Transfer<'_, W>,
    ) -> io::Result<()> {
        while transfer.lacks_bytes() && self.direct.reads.is_on() {
            let before = transfer.offset;
            let why = match self.url_of(transfer.object).await {
                Ok(url) => match self.read(&url, transfer).await? {
                    Ok(()) => continue,
                    Err(error) => error.to_string(),
                },
                Err(None) => return Ok(()),
                Err(Some(why)) => why.to_owned(),
            };
            match transfer.offset > before {
                // The last URL may have ended.
                true => tracing::debug!(why, "the object store is read again"),
                false => self.direct.reads.give_up(&why),
            }
        }
        Ok(())
    }

    /// The URL of `object`, or the reason why no file has one. `Err(None)` is a refusal of this file alone, which the
    /// service repeats when it is asked for the file.
    async fn url_of(&self, object: &NamedObject) -> Result<String, Option<&'static str>> {
        let request = SignDownloadRequest {
            name: object.name.clone(),
        };
        match self.object_service().sign_download(request).await {
            Ok(answer) => match answer.into_inner().url {
                none if none.is_empty() => Err(Some("the service signs no URLs")),
                url => Ok(url),
            },
            Err(status) if status.code() == Code::Unimplemented => {
                Err(Some("the service is of an earlier version"))
            }
            Err(_) => Err(None),
        }
    }

    /// Reads the rest at `url`. The outer error comes from `transfer`, which can't be written.
    async fn read<W: AsyncWrite + AsyncSeek + Unpin>(
        &self,
        url: &str,
        transfer: &mut Transfer<'_, W>,
    ) -> io::Result<Result<(), DirectError>> {
        let bytes = transfer.object.bytes;
        let mut content = match self.direct.get(url, transfer.offset, bytes).await {
            Ok(content) => content,
            Err(error) => return Ok(Err(error)),
        };
        loop {
            match content.chunk().await {
                Ok(Some(chunk)) if chunk.len() as u64 > bytes - transfer.offset => {
                    return Ok(Err(DirectError::Size));
                }
                Ok(Some(chunk)) => transfer.take(&chunk).await?,
                Ok(None) if transfer.lacks_bytes() => return Ok(Err(DirectError::Size)),
                Ok(None) => return Ok(Ok(())),
                Err(error) => return Ok(Err(error)),
            }
        }
    }

    /// Takes the rest from the service.
    async fn read_service<W: AsyncWrite + AsyncSeek + Unpin>(
        &self,
        transfer: &mut Transfer<'_, W>,
        path: &Path,
    ) -> Result<(), ClientError> {
        let mut retries = Retries::new();
        while transfer.lacks_bytes() {
            let before = transfer.offset;
            let outcome = async {
                let request = DownloadObjectRequest {
                    name: transfer.object.name.clone(),
                    offset: transfer.offset,
                    length: 0,
                };
                let answer = self.object_service().download_object(request).await?;
                let mut stream = answer.into_inner();
                while let Some(part) = stream.message().await? {
                    if let Err(error) = transfer.take(&part.chunk).await {
                        return Ok(Err(error));
                    }
                }
                Ok::<_, Status>(Ok(()))
            }
            .await;
            match outcome {
                Ok(Ok(())) if transfer.offset == before => break,
                Ok(Ok(())) => {}
                Ok(Err(error)) => return Err(ClientError::file("writing", path)(error)),
                Err(status) => {
                    if transfer.offset > before {
                        retries.reset();
                    }
                    let doing = format!("fetching {}", transfer.object.name);
                    let waited = retries.wait(status).await;
                    waited.map_err(ClientError::refused(doing))?;
                }
            }
        }
        Ok(())
    }
}
