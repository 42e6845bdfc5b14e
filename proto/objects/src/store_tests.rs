//! What every store does: memory, a folder, and S3.

use super::*;
use bytes::Bytes;
use futures::{StreamExt, TryStreamExt};
use object_store::memory::InMemory;
use tempfile::TempDir;
use yoto_test_s3::{BUCKET, Server};

/// A store, and what it needs to live.
struct Store {
    name: &'static str,
    objects: Objects,
    _parts: (Option<TempDir>, Option<Server>),
}

fn stores() -> [Store; 3] {
    let folder = tempfile::tempdir().expect("a folder");
    let url = Url::from_directory_path(folder.path()).expect("a URL");
    let of_folder = Objects::open(&url).expect("opens");
    let server = Server::start();
    let url = Url::parse(&format!("s3://{BUCKET}/some/prefix")).expect("a URL");
    let of_s3 = Objects::open_with(&url, &server.environment().into()).expect("opens");
    let store = |name, objects, folder, server| Store {
        name,
        objects,
        _parts: (folder, server),
    };
    [
        store(
            "memory",
            Objects::over(Arc::new(InMemory::new())),
            None,
            None,
        ),
        store("folder", of_folder, Some(folder), None),
        store("S3", of_s3, None, Some(server)),
    ]
}

async fn listed(objects: &Objects, folder: &str) -> Vec<Listed> {
    let listed: Result<Vec<_>, _> = objects.list(folder).try_collect().await;
    let mut listed = listed.expect("lists");
    listed.sort_by(|a, b| a.key.cmp(&b.key));
    listed
}

/// Bytes that no two places of an object share.
fn large(bytes: usize) -> Bytes {
    let words = (0..bytes as u64 / 8 + 1).flat_map(|it| it.wrapping_mul(0x9e37_79b9).to_le_bytes());
    words.take(bytes).collect()
}

#[tokio::test]
async fn a_store_gives_back_what_was_put() {
    for Store {
        name,
        objects,
        _parts,
    } in stores()
    {
        let text = Bytes::from_static(b"good");
        let written = objects.put("a/b-1/c.bin", text).await.expect("put");
        assert_eq!(
            (written.bytes, written.key.as_str()),
            (4, "a/b-1/c.bin"),
            "{name}"
        );
        assert_eq!(
            objects.read(&written).await.expect("reads"),
            "good",
            "{name}"
        );
        objects.require(&written).await.expect("is there");
        let some = objects.stream(&written, Some(1..3)).await.expect("reads");
        let some: Vec<Bytes> = some.try_collect().await.expect("reads");
        assert_eq!(some.concat(), b"oo", "{name}");
        let empty = objects.put("a/empty", Bytes::new()).await.expect("put");
        assert_eq!(objects.read(&empty).await.expect("reads"), "", "{name}");
        // Written again, as after an answer that was lost.
        let again = objects
            .put("a/b-1/c.bin", Bytes::from_static(b"good"))
            .await;
        assert_eq!(again.expect("put"), written, "{name}");

        let missing = ObjectRef {
            key: "a/none".into(),
            ..written.clone()
        };
        let torn = ObjectRef {
            bytes: 3,
            ..written.clone()
        };
        let altered = ObjectRef {
            sha256: "0".repeat(64),
            ..written
        };
        for (object, expected) in [(missing, "missing"), (torn, "torn"), (altered, "altered")] {
            let error = objects.read(&object).await.expect_err("differs");
            assert!(
                error.is_torn() && error.to_string().contains(expected),
                "{name}: {error}"
            );
        }
    }
}

#[tokio::test]
async fn an_object_of_several_parts_is_one_object() {
    for Store {
        name,
        objects,
        _parts,
    } in stores()
    {
        let bytes = large(3 * write::PART_BYTES + 5);
        let written = objects.put("m/weights", bytes.clone()).await.expect("put");
        assert!(
            objects.read(&written).await.expect("reads") == bytes,
            "{name}"
        );
        let folder = tempfile::tempdir().expect("a folder");
        let copy = folder.path().join("copy");
        objects.copy_to(&written, &copy).await.expect("copies");
        assert!(std::fs::read(&copy).expect("reads") == bytes, "{name}");
        if let Some(server) = &_parts.1 {
            assert_eq!(server.open_uploads(), 0, "{name}");
        }
    }
}

#[tokio::test]
async fn folders_are_listed_in_pages_and_deleted_as_a_whole() {
    for Store {
        name,
        objects,
        _parts,
    } in stores()
    {
        // A page of S3 has 1,000 objects.
        let count = if name == "S3" { 1001 } else { 3 };
        let put = |number| {
            let key = format!("renders/j/1/{number:06}.png");
            let objects = &objects;
            async move { objects.put(&key, Bytes::from_static(b"abc")).await }
        };
        let put = futures::stream::iter(0..count).map(put);
        let put = put.buffer_unordered(16).try_for_each(|_| async { Ok(()) });
        put.await.expect("put");
        let beside = objects
            .put("renders/j/12/0.png", Bytes::new())
            .await
            .expect("put");
        let found = listed(&objects, "renders/j/1").await;
        assert_eq!(found.len(), count, "{name}: a folder is no prefix of names");
        let first = Listed {
            key: "renders/j/1/000000.png".into(),
            bytes: 3,
        };
        assert_eq!(found.first(), Some(&first), "{name}");
        objects.delete_folder("renders/j/1").await.expect("deletes");
        assert_eq!(listed(&objects, "renders").await.len(), 1, "{name}");
        objects
            .delete_folder("renders/j/1")
            .await
            .expect("is gone already");
        objects.delete(&beside.key).await.expect("deletes");
        objects.delete(&beside.key).await.expect("is gone already");
        assert_eq!(listed(&objects, "renders").await, [], "{name}");
    }
}
