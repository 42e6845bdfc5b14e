//! Renders: requests for pictures, and downloads, each checked against its SHA-256.

use super::{ClientError, MAX_MESSAGE, YotoClient, request_id};
use std::path::{Path, PathBuf};
use yoto_proto::sha256_hex;
use yoto_proto::v1::render_service_client::RenderServiceClient;
use yoto_proto::v1::{
    CreateRenderRequest, DownloadRenderRequest, Job, RenderResult, RenderSpec, RenderedFile,
    job_result,
};

/// One fetched file of a render job.
#[derive(Debug, Clone)]
pub struct Downloaded {
    /// E.g. "000003.png", "animation.png".
    pub file: String,
    /// Its content.
    pub bytes: Vec<u8>,
}

impl YotoClient {
    fn render_service(&self) -> RenderServiceClient<tonic::transport::Channel> {
        RenderServiceClient::new(self.channel.clone())
            .max_decoding_message_size(MAX_MESSAGE)
            .max_encoding_message_size(MAX_MESSAGE)
    }

    /// Queues a render.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. for a model without a checkpoint.
    pub async fn create_render(&self, spec: RenderSpec) -> Result<Job, ClientError> {
        let doing = format!("creating a render of {} by {}", spec.subject, spec.model);
        let request = CreateRenderRequest {
            spec: Some(spec),
            request_id: request_id(),
        };
        Ok(self
            .render_service()
            .create_render(request)
            .await
            .map_err(ClientError::refused(doing))?
            .into_inner())
    }

    /// Fetches one file of a render job that has succeeded.
    ///
    /// # Errors
    /// [`ClientError::Refused`]; [`ClientError::Contract`] when the content differs
    /// from the job's result.
    pub async fn download(
        &self,
        job: &str,
        file: &RenderedFile,
    ) -> Result<Downloaded, ClientError> {
        let doing = format!("fetching {} of {job}", file.file);
        let request = DownloadRenderRequest {
            job: job.to_owned(),
            file: file.file.clone(),
        };
        let answer = self.render_service().download_render(request).await;
        let mut stream = answer.map_err(ClientError::refused(&doing))?.into_inner();
        let mut bytes = Vec::new();
        while let Some(part) = stream
            .message()
            .await
            .map_err(ClientError::refused(&doing))?
        {
            bytes.extend_from_slice(&part.chunk);
        }
        if let Some(object) = &file.object
            && object.sha256 != sha256_hex(&bytes)
        {
            return Err(ClientError::Contract(format!(
                "{doing}: {} bytes arrived with a wrong SHA-256",
                bytes.len()
            )));
        }
        Ok(Downloaded {
            file: file.file.clone(),
            bytes,
        })
    }

    /// Fetches all files of a finished render job into `dir`, in the job's order.
    ///
    /// # Errors
    /// As [`download`](Self::download); [`ClientError::File`] when `dir` can't be written.
    pub async fn download_all(&self, job: &Job, dir: &Path) -> Result<Vec<PathBuf>, ClientError> {
        tokio::fs::create_dir_all(dir)
            .await
            .map_err(ClientError::file("creating", dir))?;
        let mut paths = Vec::new();
        for file in &render_result(job)?.files {
            let path = dir.join(plain_name(&file.file)?);
            let downloaded = self.download(&job.name, file).await?;
            tokio::fs::write(&path, downloaded.bytes)
                .await
                .map_err(ClientError::file("writing", &path))?;
            paths.push(path);
        }
        Ok(paths)
    }
}

/// The result of a finished render job.
fn render_result(job: &Job) -> Result<&RenderResult, ClientError> {
    match job.result.as_ref().and_then(|result| result.kind.as_ref()) {
        Some(job_result::Kind::Render(result)) => Ok(result),
        _ => Err(ClientError::Contract(format!(
            "{} has no render result",
            job.name
        ))),
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
