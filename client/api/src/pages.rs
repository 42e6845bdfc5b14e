//! Pages that a service has for people, as files.

use super::{ClientError, YotoClient};
use http_body_util::{BodyExt, Limited};
use tonic::body::Body;
use tonic::codegen::http::{Request, StatusCode};
use tonic::{Code, Status};
use tower::ServiceExt;

/// Longest page that is accepted, bytes. Pages of a service have a few million.
const LONGEST: usize = 64 << 20;

impl YotoClient {
    /// The report of `models/{id}`: one file of HTML with its pictures in it.
    ///
    /// # Errors
    /// [`ClientError::Refused`] when no model has this name, or the service is of a version without reports.
    pub async fn model_report(&self, model: &str) -> Result<Vec<u8>, ClientError> {
        let doing = format!("reading the report of {model}");
        let page = self.page(&format!("/{model}/report.html")).await;
        page.map_err(ClientError::refused(doing))
    }

    async fn page(&self, path: &str) -> Result<Vec<u8>, Status> {
        let request = Request::get(path).body(Body::empty());
        let request = request.map_err(|error| Status::internal(error.to_string()))?;
        let answer = self.channel.clone().oneshot(request).await;
        let answer = answer.map_err(|error| Status::unavailable(error.to_string()))?;
        match answer.status() {
            StatusCode::OK => {}
            refused => return Err(refusal(refused)),
        }
        let page = Limited::new(answer.into_body(), LONGEST).collect().await;
        let page = page.map_err(|error| Status::unavailable(error.to_string()))?;
        Ok(page.to_bytes().to_vec())
    }
}

/// What a status of HTTP means.
fn refusal(status: StatusCode) -> Status {
    match status {
        StatusCode::NOT_FOUND | StatusCode::METHOD_NOT_ALLOWED => Status::new(
            Code::NotFound,
            "the service has no such page; services of earlier versions have no reports",
        ),
        StatusCode::UNAUTHORIZED => Status::unauthenticated("the service asks for a key"),
        StatusCode::FORBIDDEN => Status::permission_denied("the key does not allow it"),
        status => Status::unavailable(format!("the service answers with status {status}")),
    }
}
