//! Files that jobs have written, each checked against its SHA-256. An interrupted transfer continues
//! where it ended.

use super::retry::read;
use super::upload::measure;
use super::{ClientError, YotoClient};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use tokio::io::AsyncWriteExt;
use yoto_proto::key::Connection;
use yoto_proto::v1::object_service_client::ObjectServiceClient;
use yoto_proto::v1::{ExportResult, ExportedFile, ListObjectsRequest, NamedObject};

impl YotoClient {
    pub(super) fn object_service(&self) -> ObjectServiceClient<Connection> {
        ObjectServiceClient::new(self.channel.clone())
    }

    /// The files of a job (`jobs/{id}`) or of a checkpoint (`models/{id}/checkpoints/{step}`). Each file
    /// of a render appears once it is committed.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. while an evaluation runs.
    pub async fn list_objects(&self, parent: &str) -> Result<Vec<NamedObject>, ClientError> {
        let (mut objects, mut page_token) = (Vec::new(), String::new());
        loop {
            let request = ListObjectsRequest {
                parent: parent.to_owned(),
                page_size: 0,
                page_token,
            };
            let list = || {
                let (mut service, request) = (self.object_service(), request.clone());
                async move { service.list_objects(request).await }
            };
            let doing = format!("listing files of {parent}");
            let page = read(list).await.map_err(ClientError::refused(doing))?;
            objects.extend(page.objects);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(objects);
            }
        }
    }

    /// The content of one file.
    ///
    /// # Errors
    /// As [`Self::fetch_object`].
    pub async fn object(&self, object: &NamedObject) -> Result<Vec<u8>, ClientError> {
        let mut bytes = Cursor::new(Vec::new());
        self.receive(object, Path::new(&object.file), &mut bytes, &mut |_| ())
            .await?;
        Ok(bytes.into_inner())
    }

    /// The contents of all files of the export `job`, in the order of its `result`.
    ///
    /// # Errors
    /// As [`Self::fetch_object`].
    pub async fn exported(
        &self,
        job: &str,
        result: &ExportResult,
    ) -> Result<Vec<Vec<u8>>, ClientError> {
        let objects = self.list_objects(job).await?;
        let mut contents = Vec::new();
        for ExportedFile { file, .. } in &result.files {
            let object = objects.iter().find(|it| it.file == *file);
            let object =
                object.ok_or_else(|| ClientError::Contract(format!("{job} has no file {file}")))?;
            contents.push(self.object(object).await?);
        }
        Ok(contents)
    }

    /// Writes one file into `dir`, under its own name, and returns its path; `on_bytes` receives the
    /// size of each part. The file appears once it is complete.
    ///
    /// # Errors
    /// [`ClientError::Refused`]; [`ClientError::Contract`] when the content differs from its
    /// checksum; [`ClientError::File`] when `dir` can't be written.
    pub async fn fetch_object(
        &self,
        object: &NamedObject,
        dir: &Path,
        on_bytes: &mut (dyn FnMut(u64) + Send),
    ) -> Result<PathBuf, ClientError> {
        let path = dir.join(plain_name(&object.file)?);
        let part = dir.join(format!(".{}.part", object.file));
        let file = tokio::fs::File::create(&part).await;
        let mut file = file.map_err(ClientError::file("writing", &part))?;
        let received = self.receive(object, &part, &mut file, on_bytes).await;
        let flushed = file.flush().await;
        if let Err(error) = received {
            // The remains of a failed transfer are useless; the failure itself is reported.
            let _ = tokio::fs::remove_file(&part).await;
            return Err(error);
        }
        flushed.map_err(ClientError::file("writing", &part))?;
        let moved = tokio::fs::rename(&part, &path).await;
        moved.map_err(ClientError::file("writing", &path))?;
        Ok(path)
    }

    /// The files that `dir` lacks, or holds with other content.
    ///
    /// # Errors
    /// [`ClientError::File`] when one can't be read; [`ClientError::Contract`] for a name that leads
    /// out of `dir`.
    pub async fn missing_in(
        objects: Vec<NamedObject>,
        dir: &Path,
    ) -> Result<Vec<NamedObject>, ClientError> {
        let mut missing = Vec::new();
        for object in objects {
            let path = dir.join(plain_name(&object.file)?);
            let same_size = match tokio::fs::metadata(&path).await {
                Ok(known) => known.len() == object.bytes,
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => false,
                Err(error) => return Err(ClientError::file("reading", &path)(error)),
            };
            if !same_size || measure(&path).await?.1 != object.sha256 {
                missing.push(object);
            }
        }
        Ok(missing)
    }

    /// Writes all of the files into `dir`, in their order, as [`Self::fetch_object`].
    ///
    /// # Errors
    /// As [`Self::fetch_object`].
    pub async fn fetch_objects(
        &self,
        objects: &[NamedObject],
        dir: &Path,
        on_bytes: &mut (dyn FnMut(u64) + Send),
    ) -> Result<Vec<PathBuf>, ClientError> {
        let made = tokio::fs::create_dir_all(dir).await;
        made.map_err(ClientError::file("creating", dir))?;
        let mut paths = Vec::new();
        for object in objects {
            paths.push(self.fetch_object(object, dir, on_bytes).await?);
        }
        Ok(paths)
    }
}

/// Checks that a name from the service does not lead out of the user's folder.
fn plain_name(file: &str) -> Result<&str, ClientError> {
    let plain =
        !file.is_empty() && !file.starts_with('.') && !file.contains(['/', '\\', ':', '\0']);
    plain
        .then_some(file)
        .ok_or_else(|| ClientError::Contract(format!("{file:?} is not a plain file name")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_elsewhere_are_refused() {
        assert!(plain_name("000003.png").is_ok());
        for bad in ["", "..", "../x", "a/b", "c:\\x", ".bashrc", "a\\b"] {
            assert!(plain_name(bad).is_err(), "{bad}");
        }
    }
}
