//! Names for people of the resources that a page mentions, read once per page.

use super::asker::Asker;
use super::words::{kind, name, page_of, short, told};
use maud::{Markup, html};
use std::collections::{BTreeSet, HashMap};
use tonic::Status;
use yoto_proto::v1::Job;

/// The names of what a page mentions, by resource. What was deleted has none.
#[derive(Debug, Default)]
pub(crate) struct Names(HashMap<String, String>);

/// What a job is about: its model, or its capture; empty if both were deleted.
pub(crate) fn about(job: &Job) -> &str {
    match job.model.as_str() {
        "" => &job.capture,
        model => model,
    }
}

impl Names {
    /// The names for people of models, people, and the people of captures.
    ///
    /// # Errors
    /// When the service can't tell.
    pub(crate) async fn read<'r>(
        asker: &Asker,
        resources: impl IntoIterator<Item = &'r str>,
    ) -> Result<Self, Status> {
        let resources: BTreeSet<&str> = resources.into_iter().collect();
        let resources: Vec<&str> = resources.into_iter().collect();
        let tenant = asker.tenant()?;
        Ok(Self(asker.backend().names(&tenant, &resources).await?))
    }

    /// The name of one resource, which is known.
    pub(crate) fn of(resource: &str, display_name: &str) -> Self {
        Self([(resource.to_owned(), display_name.to_owned())].into())
    }

    /// The name for people of a resource, or the beginning of its id if it was deleted.
    pub(crate) fn plain(&self, resource: &str) -> String {
        let found = self.0.get(resource).cloned();
        found.unwrap_or_else(|| short(resource))
    }

    /// The name of a resource, linked to its page if it has one.
    pub(crate) fn link(&self, resource: &str) -> Markup {
        match self.0.get(resource) {
            Some(found) if !resource.starts_with("captures/") => {
                html! { a href=(page_of(resource)) { (name(found)) } }
            }
            Some(found) => name(found),
            None => html! { (short(resource)) },
        }
    }

    /// What a job is about: its model, or the person of its capture.
    pub(crate) fn about(&self, job: &Job) -> Markup {
        match about(job) {
            "" => html! { "–" },
            about => self.link(about),
        }
    }

    /// `training of ada`.
    pub(crate) fn title(&self, job: &Job) -> String {
        match about(job) {
            "" => kind(job).to_owned(),
            about => format!("{} of {}", kind(job), told(&self.plain(about))),
        }
    }
}
