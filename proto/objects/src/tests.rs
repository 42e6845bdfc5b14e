//! What callers rely on whatever the store: checksums, and faults that are waited out or told.

use super::*;
use bytes::Bytes;
use futures::TryStreamExt;
use futures::stream::BoxStream;
use object_store::memory::InMemory;
use object_store::path::Path;
use object_store::{
    CopyOptions, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta,
    PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
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
async fn an_altered_object_is_refused_by_name() {
    let objects = Objects::over(Arc::new(InMemory::new()));
    let written = objects
        .put("m/weights", Bytes::from_static(b"good"))
        .await
        .expect("put");
    objects
        .put("m/weights", Bytes::from_static(b"gooD"))
        .await
        .expect("overwritten");
    let error = objects.read(&written).await.expect_err("altered");
    assert!(
        error.is_torn() && error.to_string().contains("m/weights"),
        "{error}"
    );

    let missing = ObjectRef {
        key: "m/none".into(),
        ..written
    };
    let error = objects.read(&missing).await.expect_err("missing");
    assert!(
        error.is_torn() && error.to_string().contains("m/none"),
        "{error}"
    );
}

#[tokio::test]
async fn a_store_that_recovers_is_waited_for() {
    let flaky = Flaky::failing(2);
    let objects = Objects::over(flaky.clone()).patient();
    let written = objects
        .put("k", Bytes::from_static(b"v"))
        .await
        .expect("third attempt");
    assert_eq!(flaky.seen.load(Ordering::SeqCst), 2);
    assert_eq!(objects.read(&written).await.expect("get"), "v");
}

#[tokio::test]
async fn a_store_that_stays_down_is_reported_and_not_called_torn() {
    let objects = Objects::over(Flaky::failing(u32::MAX)).patient();
    let error = objects
        .put("k", Bytes::from_static(b"v"))
        .await
        .expect_err("down");
    assert!(
        matches!(error, ObjectsError::Store { .. }) && !error.is_torn(),
        "{error}"
    );
}

#[tokio::test]
async fn a_coordinator_s_store_answers_at_once() {
    let flaky = Flaky::failing(1);
    let objects = Objects::over(flaky.clone());
    let error = objects.put("k", Bytes::new()).await.expect_err("one fault");
    assert!(matches!(error, ObjectsError::Store { .. }), "{error}");
    assert_eq!(flaky.seen.load(Ordering::SeqCst), 1);
}

#[tokio::test]
async fn every_way_to_read_finds_an_altered_object() {
    let dir = tempfile::tempdir().expect("a folder");
    let file = dir.path().join("copy");
    let objects = Objects::over(Arc::new(InMemory::new()));
    let put = |bytes: &'static [u8]| objects.put("m/w", Bytes::from_static(bytes));
    let good = put(b"good").await.expect("put");
    let all = async |object: &ObjectRef| {
        let chunks = objects.stream(object, None).await?;
        chunks.try_collect::<Vec<_>>().await.map(|it| it.concat())
    };
    assert_eq!(all(&good).await.expect("reads"), b"good");
    let some = objects.stream(&good, Some(1..3)).await.expect("reads");
    let some: Vec<Bytes> = some.try_collect().await.expect("reads");
    assert_eq!(some.concat(), b"oo");
    objects.copy_to(&good, &file).await.expect("copies");
    assert_eq!(std::fs::read(&file).expect("reads"), b"good");

    put(b"gooD").await.expect("overwritten");
    let found = [
        objects.read(&good).await.map(drop),
        objects.copy_to(&good, &file).await,
        all(&good).await.map(drop),
    ];
    for found in found {
        let error = found.expect_err("altered");
        assert!(matches!(error, ObjectsError::Altered { .. }), "{error}");
    }
    put(b"longer").await.expect("overwritten");
    let found = [
        objects.read(&good).await.map(drop),
        objects.copy_to(&good, &file).await,
        all(&good).await.map(drop),
        objects.require(&good).await,
    ];
    for found in found {
        let error = found.expect_err("torn");
        assert!(matches!(error, ObjectsError::Size { .. }), "{error}");
    }
}

#[tokio::test]
async fn a_full_disk_is_not_the_store_s_fault() {
    let objects = Objects::over(Arc::new(InMemory::new())).patient();
    let written = objects.put("k", Bytes::from_static(b"v")).await;
    let nowhere = std::path::Path::new("no/such/folder/copy");
    let copied = objects.copy_to(&written.expect("put"), nowhere).await;
    let error = copied.expect_err("there is no such folder");
    assert!(matches!(error, ObjectsError::Disk { .. }) && !error.is_torn());
}

#[test]
fn a_useless_url_says_which() {
    for url in ["file:///no/such/folder", "gopher://x/y"] {
        let error = Objects::open(&Url::parse(url).expect("a URL")).expect_err("refused");
        assert!(error.to_string().contains(url), "{error}");
    }
}

#[test]
fn credentials_are_not_shown() {
    for (url, expected) in [
        (
            "s3://KEY:HIDDEN@bucket/a?token=HIDDEN#HIDDEN",
            "s3://bucket/a",
        ),
        (
            "file:///var/lib/yoto/objects",
            "file:///var/lib/yoto/objects",
        ),
    ] {
        let url = Url::parse(url).expect("a URL");
        assert_eq!(shown(&url).as_str(), expected);
    }
    let url = Url::parse("none://KEY:HIDDEN@bucket/a").expect("a URL");
    let refused = Objects::open(&url).expect_err("is no store");
    assert!(!refused.to_string().contains("HIDDEN"), "{refused}");
}
