//! The store's guarantees, over memory, a folder, and a store that fails on purpose.

use super::*;
use futures::stream::BoxStream;
use object_store::{
    CopyOptions, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta,
    PutMultipartOptions, PutOptions, PutPayload, PutResult, Result, memory::InMemory,
};
use std::sync::atomic::{AtomicU32, Ordering};

/// Fails the first `faults` reads and writes with a fault of the store.
#[derive(Debug)]
struct Flaky {
    store: InMemory,
    faults: AtomicU32,
    seen: AtomicU32,
}

impl Flaky {
    fn failing(faults: u32) -> Arc<Self> {
        Arc::new(Self {
            store: InMemory::new(),
            faults: faults.into(),
            seen: 0.into(),
        })
    }

    fn fault(&self) -> Result<()> {
        let left = self
            .faults
            .fetch_update(Ordering::SeqCst, Ordering::SeqCst, |left| {
                left.checked_sub(1)
            });
        if left.is_err() {
            return Ok(());
        }
        self.seen.fetch_add(1, Ordering::SeqCst);
        Err(object_store::Error::Generic {
            store: "flaky",
            source: "503".into(),
        })
    }
}

impl std::fmt::Display for Flaky {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Flaky({})", self.store)
    }
}

#[async_trait::async_trait]
impl ObjectStore for Flaky {
    async fn put_opts(
        &self,
        to: &Path,
        payload: PutPayload,
        options: PutOptions,
    ) -> Result<PutResult> {
        self.fault()?;
        self.store.put_opts(to, payload, options).await
    }

    async fn put_multipart_opts(
        &self,
        to: &Path,
        options: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.store.put_multipart_opts(to, options).await
    }

    async fn get_opts(&self, from: &Path, options: GetOptions) -> Result<GetResult> {
        self.fault()?;
        self.store.get_opts(from, options).await
    }

    fn delete_stream(
        &self,
        paths: BoxStream<'static, Result<Path>>,
    ) -> BoxStream<'static, Result<Path>> {
        self.store.delete_stream(paths)
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        self.store.list(prefix)
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.store.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, options: CopyOptions) -> Result<()> {
        self.store.copy_opts(from, to, options).await
    }
}

#[tokio::test]
async fn a_folder_gives_back_what_was_put() {
    let folder = tempfile::tempdir().expect("a folder");
    let url = Url::from_directory_path(folder.path()).expect("a URL");
    let objects = Objects::from_url(url.as_str()).expect("opens");
    let written = objects
        .put("a/b-1/c.bin", Bytes::from_static(b"abc"))
        .await
        .expect("put");
    assert_eq!((written.bytes, written.key.as_str()), (3, "a/b-1/c.bin"));
    assert_eq!(objects.get(&written).await.expect("get"), "abc");
}

#[tokio::test]
async fn an_altered_object_is_refused_by_name() {
    let objects = Objects::from_store(Arc::new(InMemory::new()));
    let written = objects
        .put("m/weights", Bytes::from_static(b"good"))
        .await
        .expect("put");
    objects
        .put("m/weights", Bytes::from_static(b"gooD"))
        .await
        .expect("overwritten");
    let error = objects.get(&written).await.expect_err("altered");
    assert!(
        error.is_torn() && error.to_string().contains("m/weights"),
        "{error}"
    );

    let missing = ObjectRef {
        key: "m/none".into(),
        ..written
    };
    let error = objects.get(&missing).await.expect_err("missing");
    assert!(
        error.is_torn() && error.to_string().contains("m/none"),
        "{error}"
    );
}

#[tokio::test]
async fn a_store_that_recovers_is_waited_for() {
    let flaky = Flaky::failing(2);
    let objects = Objects::from_store(flaky.clone());
    let written = objects
        .put("k", Bytes::from_static(b"v"))
        .await
        .expect("third attempt");
    assert_eq!(flaky.seen.load(Ordering::SeqCst), 2);
    assert_eq!(objects.get(&written).await.expect("get"), "v");
}

#[tokio::test]
async fn a_store_that_stays_down_is_reported_and_not_called_torn() {
    let objects = Objects::from_store(Flaky::failing(u32::MAX));
    let error = objects
        .put("k", Bytes::from_static(b"v"))
        .await
        .expect_err("down");
    assert!(
        matches!(error, ObjectsError::Store { .. }) && !error.is_torn(),
        "{error}"
    );
}

#[test]
fn a_useless_url_says_which() {
    for url in ["nonsense", "file:///no/such/folder", "gopher://x/y"] {
        let error = Objects::from_url(url).expect_err("refused");
        assert!(error.to_string().contains(url), "{error}");
    }
}
