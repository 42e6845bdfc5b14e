//! Names for people of the resources that a page mentions, each read once per page.

use super::asker::Asker;
use super::words::{kind, name, page_of, short};
use maud::{Markup, html};
use std::collections::HashMap;
use tonic::{Code, Status};
use yoto_proto::v1::{GetCaptureRequest, GetModelRequest, GetSubjectRequest, Job};

/// The names that were read so far, by resource.
pub struct Names<'a> {
    asker: &'a Asker,
    known: HashMap<String, Option<String>>,
}

/// The resource, or `None` if it does not exist any more.
fn if_there<T>(found: Result<tonic::Response<T>, Status>) -> Result<Option<T>, Status> {
    match found {
        Ok(found) => Ok(Some(found.into_inner())),
        Err(error) if error.code() == Code::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

impl<'a> Names<'a> {
    /// None yet.
    pub fn of(asker: &'a Asker) -> Self {
        Self {
            asker,
            known: HashMap::new(),
        }
    }

    /// The name for people of `models/{id}`, `subjects/{id}` or of the person of `captures/{id}`; `None` if it was deleted.
    async fn find(&mut self, resource: &str) -> Result<Option<String>, Status> {
        if let Some(known) = self.known.get(resource) {
            return Ok(known.clone());
        }
        let asker = self.asker;
        let asked = resource.to_owned();
        let mut subject = resource.to_owned();
        let found = if resource.starts_with("models/") {
            let model = asker.request(GetModelRequest { name: asked });
            let model = asker.services().models.get_model(model).await;
            if_there(model)?.map(|it| it.display_name)
        } else {
            if resource.starts_with("captures/") {
                let capture = asker.request(GetCaptureRequest { name: asked });
                let capture = asker.services().subjects.get_capture(capture).await;
                subject = if_there(capture)?.map_or_else(String::new, |it| it.subject);
            }
            match subject.as_str() {
                "" => None,
                _ => {
                    let subject = asker.request(GetSubjectRequest { name: subject });
                    let subject = asker.services().subjects.get_subject(subject).await;
                    if_there(subject)?.map(|it| it.display_name)
                }
            }
        };
        self.known.insert(resource.to_owned(), found.clone());
        Ok(found)
    }

    /// The name for people of a resource, or the beginning of its id if it was deleted.
    ///
    /// # Errors
    /// When the service can't tell.
    pub async fn plain(&mut self, resource: &str) -> Result<String, Status> {
        let found = self.find(resource).await?;
        Ok(found.unwrap_or_else(|| short(resource)))
    }

    /// The name of a resource, linked to its page if it has one.
    ///
    /// # Errors
    /// When the service can't tell.
    pub async fn link(&mut self, resource: &str) -> Result<Markup, Status> {
        Ok(match self.find(resource).await? {
            Some(found) if !resource.starts_with("captures/") => {
                html! { a href=(page_of(resource)) { (name(&found)) } }
            }
            Some(found) => name(&found),
            None => html! { (short(resource)) },
        })
    }

    /// What a job is about: its model, or the person of its capture.
    ///
    /// # Errors
    /// When the service can't tell.
    pub async fn about(&mut self, job: &Job) -> Result<Markup, Status> {
        match (job.model.as_str(), job.capture.as_str()) {
            ("", "") => Ok(html! { "–" }),
            ("", capture) => self.link(capture).await,
            (model, _) => self.link(model).await,
        }
    }

    /// `training of ada`.
    ///
    /// # Errors
    /// When the service can't tell.
    pub async fn title(&mut self, job: &Job) -> Result<String, Status> {
        let about = match (job.model.as_str(), job.capture.as_str()) {
            ("", "") => return Ok(kind(job).to_owned()),
            ("", capture) => capture,
            (model, _) => model,
        };
        let about = self.plain(about).await?;
        Ok(format!("{} of {}", kind(job), super::words::told(&about)))
    }
}
