//! The steps of an ingest job before its child starts.

use super::*;
use crate::jobs::test_context::context;
use std::collections::BTreeMap;
use std::path::Path;
use yoto_objects::Objects;
use yoto_proto::sha256_hex;
use yoto_proto::v1::ObjectRef;
use yoto_proto::worker::v1::{InputFile, InputPiece};

/// A file in pieces: part, start, bytes.
fn in_pieces(path: &str, content: &[u8], pieces: &[(u32, u64, u64)]) -> InputFile {
    let pieces = pieces
        .iter()
        .map(|&(part, start, bytes)| InputPiece { part, start, bytes });
    InputFile {
        path: path.into(),
        bytes: content.len() as u64,
        sha256: sha256_hex(content),
        pieces: pieces.collect(),
        object: None,
    }
}

/// Three files in two parts, an empty one, and one that an earlier version has stored.
async fn inputs(objects: &Objects) -> Inputs {
    let put = async |key: &str, bytes: &'static [u8]| {
        let stored = objects.put(key, bytes.into()).await;
        stored.expect("stored")
    };
    let whole = InputFile {
        path: "old.json".into(),
        object: Some(put("uploads/c/old.json", b"[]").await),
        ..InputFile::default()
    };
    Inputs {
        parts: vec![
            // Bytes 2 and 3 were sent again.
            put("uploads/c/parts/1-0", b"abXXwhole").await,
            put("uploads/c/parts/2-0", b"12cde").await,
        ],
        files: vec![
            in_pieces("divided", b"abcde", &[(0, 0, 2), (1, 2, 3)]),
            in_pieces("empty", b"", &[]),
            whole,
            in_pieces("other", b"12", &[(1, 0, 2)]),
            in_pieces("whole", b"whole", &[(0, 4, 5)]),
        ],
        ..Inputs::default()
    }
}

/// What is fetched for `inputs` on the job's own thread: contents by path.
async fn fetched(
    context: JobContext,
    inputs: Inputs,
) -> Result<BTreeMap<String, Vec<u8>>, JobFailure> {
    let job = move || {
        let folder = context.folder().expect("a folder");
        let files = fetch(&context, &inputs, folder.path())?;
        let read = |path: &Path| std::fs::read(path).expect("is there");
        Ok(files
            .iter()
            .map(|(name, path)| (name.clone(), read(path)))
            .collect())
    };
    tokio::task::spawn_blocking(job).await.expect("no panic")
}

#[tokio::test]
async fn files_are_put_together_from_their_pieces() {
    let context = context();
    let inputs = inputs(&context.objects).await;
    let files = fetched(context, inputs).await.expect("are there");
    let expected = [
        ("divided", &b"abcde"[..]),
        ("empty", b""),
        ("old.json", b"[]"),
        ("other", b"12"),
        ("whole", b"whole"),
    ];
    let expected = expected.map(|(path, content)| (path.to_owned(), content.to_vec()));
    assert_eq!(files, BTreeMap::from(expected));
}

#[tokio::test]
async fn bytes_that_are_lost_after_the_upload_are_our_fault_not_the_owner_s() {
    let refused = async |change: &dyn Fn(&mut Inputs) -> Option<(&'static str, &'static str)>| {
        let context = context();
        let mut inputs = inputs(&context.objects).await;
        if let Some((key, content)) = change(&mut inputs) {
            let written = context.objects.put(key, content.into()).await;
            written.expect("altered");
        }
        match fetched(context, inputs).await.expect_err("is refused") {
            JobFailure::Failed {
                code: "OBJECTS",
                message,
            } => message,
            other => panic!("{other:?}"),
        }
    };
    let missing = |inputs: &mut Inputs| {
        inputs.parts[1].key += "-gone";
        None
    };
    let message = refused(&missing).await;
    assert!(message.starts_with("divided and 1 more: "), "{message}");
    assert!(message.contains("parts/2-0-gone' is missing"), "{message}");
    let altered = |_: &mut Inputs| Some(("uploads/c/parts/1-0", "abXXwhale"));
    let message = refused(&altered).await;
    assert!(message.starts_with("divided and 1 more: "), "{message}");
    assert!(message.contains("is altered"), "{message}");
    let torn = |_: &mut Inputs| Some(("uploads/c/parts/2-0", "12c"));
    let message = refused(&torn).await;
    assert!(message.contains("is torn"), "{message}");
    // A part without a checksum: that of the file finds it.
    let unknown = |inputs: &mut Inputs| {
        inputs.parts[0].sha256 = String::new();
        Some(("uploads/c/parts/1-0", "abXXwhale"))
    };
    let message = refused(&unknown).await;
    assert!(message.starts_with("whole: "), "{message}");
    let fewer = |inputs: &mut Inputs| {
        inputs.files[0].pieces.pop();
        None
    };
    let message = refused(&fewer).await;
    assert!(
        message.starts_with("divided: the store has 2 bytes"),
        "{message}"
    );
    let old = |_: &mut Inputs| Some(("uploads/c/old.json", "{}"));
    let message = refused(&old).await;
    assert!(message.starts_with("old.json: "), "{message}");
}

#[tokio::test]
async fn an_order_with_a_part_that_it_does_not_have_is_refused() {
    let context = context();
    let inputs = Inputs {
        files: vec![in_pieces("a", b"a", &[(0, 0, 1)])],
        parts: Vec::<ObjectRef>::new(),
        ..Inputs::default()
    };
    let failure = fetched(context, inputs).await.expect_err("is refused");
    let JobFailure::Failed { code, message } = failure else {
        panic!("{failure:?}");
    };
    assert_eq!(
        (code, &*message),
        ("INTERNAL", "a: the order has no part 0")
    );
}
