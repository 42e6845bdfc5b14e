//! An object store that fails as the controls say.

use super::controls::{Controls, StoreFault};
use crate::fault::Fault;
use async_trait::async_trait;
use futures::stream::BoxStream;
use futures::{StreamExt, stream};
use object_store::path::Path;
use object_store::{
    CopyOptions, Error, GetOptions, GetResult, GetResultPayload, ListResult, MultipartUpload,
    ObjectMeta, ObjectStore, PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Time that a late answer takes.
const LATE: Duration = Duration::from_millis(700);

/// A store with faults. While it fails, every second call does, so that a caller that tries again
/// gets on.
#[derive(Debug)]
pub(super) struct FaultyStore {
    inner: Arc<dyn ObjectStore>,
    controls: Controls,
    calls: AtomicU64,
}

impl FaultyStore {
    /// Has `inner` fail by the `controls`.
    pub(super) fn new(inner: Arc<dyn ObjectStore>, controls: Controls) -> Self {
        Self {
            inner,
            controls,
            calls: AtomicU64::new(0),
        }
    }

    /// The fault of this call, if it has one. A poisoned object ends the process. Only reads can last for
    /// ever: an upload beside a training has no thread of its own.
    fn fault(&self, location: &Path, reads: bool) -> Option<StoreFault> {
        if self.controls.is_poison(location.as_ref()) {
            self.controls.end_here(Fault::Poison);
        }
        let fault = self.controls.store()?;
        if fault == StoreFault::Never && !reads {
            return None;
        }
        let odd = self.calls.fetch_add(1, Ordering::Relaxed) % 2 == 1;
        if odd {
            return None;
        }
        if let Err(error) = self.controls.note(fault.fault()) {
            tracing::error!(%error, "could not note a fault");
        }
        Some(fault)
    }
}

fn broken() -> Error {
    Error::Generic {
        store: "faulty store",
        source: "it fails on purpose".into(),
    }
}

/// An answer that breaks off after half of its bytes.
async fn half(whole: GetResult) -> Result<GetResult> {
    let (meta, range) = (whole.meta.clone(), whole.range.clone());
    let (attributes, extensions) = (whole.attributes.clone(), whole.extensions.clone());
    let bytes = whole.bytes().await?;
    let begin = bytes.slice(..bytes.len() / 2);
    let broken_off = stream::iter([Ok(begin), Err(broken())]);
    Ok(GetResult {
        payload: GetResultPayload::Stream(broken_off.boxed()),
        meta,
        range,
        attributes,
        extensions,
    })
}

impl fmt::Display for FaultyStore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "faulty {}", self.inner)
    }
}

#[async_trait]
impl ObjectStore for FaultyStore {
    async fn put_opts(
        &self,
        location: &Path,
        payload: PutPayload,
        options: PutOptions,
    ) -> Result<PutResult> {
        match self.fault(location, false) {
            None | Some(StoreFault::Never) => {}
            Some(StoreFault::Error) => return Err(broken()),
            Some(StoreFault::Late) => tokio::time::sleep(LATE).await,
            Some(StoreFault::Half) => {
                let bytes = bytes::Bytes::from(payload);
                let half = bytes.slice(..bytes.len() / 2);
                self.inner.put_opts(location, half.into(), options).await?;
                return Err(broken());
            }
        }
        self.inner.put_opts(location, payload, options).await
    }

    async fn put_multipart_opts(
        &self,
        location: &Path,
        options: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.inner.put_multipart_opts(location, options).await
    }

    async fn get_opts(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        let head = options.head;
        match self.fault(location, true) {
            None => {}
            Some(StoreFault::Error) => return Err(broken()),
            Some(StoreFault::Late) => tokio::time::sleep(LATE).await,
            Some(StoreFault::Half) if !head => {
                let whole = self.inner.get_opts(location, options).await?;
                return half(whole).await;
            }
            Some(StoreFault::Half) => {}
            // A job reads on its own thread, which now hangs as in a driver.
            Some(StoreFault::Never) => loop {
                std::thread::park();
            },
        }
        self.inner.get_opts(location, options).await
    }

    fn delete_stream(
        &self,
        locations: BoxStream<'static, Result<Path>>,
    ) -> BoxStream<'static, Result<Path>> {
        self.inner.delete_stream(locations)
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        self.inner.list(prefix)
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.inner.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, options: CopyOptions) -> Result<()> {
        self.inner.copy_opts(from, to, options).await
    }
}
