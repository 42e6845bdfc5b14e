//! Files of jobs and checkpoints, fetched to a folder.

use super::OutFolder;
use std::path::PathBuf;
use yoto_client::YotoClient;
use yoto_proto::v1::NamedObject;
use yoto_terminal::progress::{ProgressDisplay, count};

/// Writes the files of a job or a checkpoint, and shows how many bytes have arrived.
pub(crate) async fn download(
    client: &YotoClient,
    parent: &str,
    folder: &OutFolder,
) -> anyhow::Result<Vec<PathBuf>> {
    download_some(client, parent, folder, |_| true).await
}

/// As [`download`], for the `wanted` files alone.
pub(crate) async fn download_some(
    client: &YotoClient,
    parent: &str,
    folder: &OutFolder,
    wanted: impl Fn(&NamedObject) -> bool,
) -> anyhow::Result<Vec<PathBuf>> {
    let mut all = client.list_objects(parent).await?;
    all.retain(wanted);
    let out = &folder.out;
    let paths: Vec<PathBuf> = all.iter().map(|object| out.join(&object.file)).collect();
    let objects = YotoClient::missing_in(all, out).await?;
    folder.ensure_free(|name| objects.iter().any(|object| object.file == name))?;
    let total = objects.iter().map(|object| object.bytes).sum();
    let mut display = ProgressDisplay::new(parent);
    let mut received = 0;
    let on_bytes = &mut |bytes| {
        received += bytes;
        display.received(received, total);
    };
    client.fetch_objects(&objects, out, on_bytes).await?;
    display.finish(&format!(
        "{} in {}",
        count(paths.len(), "file"),
        out.display()
    ));
    Ok(paths)
}
