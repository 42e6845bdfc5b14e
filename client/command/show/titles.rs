//! What jobs are about, by the display names of models and subjects.

use std::collections::HashMap;
use yoto_client::{ClientError, YotoClient};
use yoto_proto::v1::{Job, JobKind, job_spec};

/// Display names of models and subjects by resource name.
#[derive(Debug, Default)]
pub(crate) struct Titles {
    names: HashMap<String, String>,
    /// The subject of each capture.
    captures: HashMap<String, String>,
}

impl Titles {
    /// Fetches the display names of all models and subjects.
    ///
    /// # Errors
    /// As [`YotoClient::list_models`].
    pub(crate) async fn load(client: &YotoClient) -> Result<Self, ClientError> {
        let models = client.list_models().await?;
        let subjects = client.list_subjects().await?;
        let mut captures = HashMap::new();
        for subject in &subjects {
            for capture in &subject.captures {
                captures.insert(capture.clone(), subject.display_name.clone());
            }
        }
        let models = models.into_iter().map(|it| (it.name, it.display_name));
        let subjects = subjects.into_iter().map(|it| (it.name, it.display_name));
        Ok(Self {
            names: models.chain(subjects).collect(),
            captures,
        })
    }

    /// The display name of a resource, or its own name if it has none.
    pub(crate) fn name<'a>(&'a self, resource: &'a str) -> &'a str {
        let known = self.names.get(resource);
        known
            .or_else(|| self.captures.get(resource))
            .map_or(resource, |it| it)
    }

    /// Whether the model or the capture of a job was there when the names were fetched.
    pub(crate) fn knows(&self, job: &Job) -> bool {
        self.names.contains_key(&job.model) || self.captures.contains_key(&job.capture)
    }

    /// What a job is about: `trio`, `ada by trio`.
    pub(crate) fn of(&self, job: &Job) -> String {
        match job.spec.as_ref().and_then(|spec| spec.kind.as_ref()) {
            Some(job_spec::Kind::Ingest(spec)) => self.name(&spec.capture).to_owned(),
            Some(job_spec::Kind::Train(spec)) => self.name(&spec.model).to_owned(),
            Some(job_spec::Kind::Render(spec)) if spec.subject.is_empty() => {
                format!("a scene by {}", self.name(&spec.model))
            }
            Some(job_spec::Kind::Render(spec)) => {
                format!("{} by {}", self.name(&spec.subject), self.name(&spec.model))
            }
            Some(job_spec::Kind::Evaluate(spec)) => self.name(&spec.model).to_owned(),
            Some(job_spec::Kind::Export(spec)) => {
                format!("{} by {}", self.name(&spec.subject), self.name(&spec.model))
            }
            // A watched job comes without its order.
            None if job.model.is_empty() => self.name(&job.capture).to_owned(),
            None => self.name(&job.model).to_owned(),
        }
    }
}

/// Characters of an id in a list for people.
pub(crate) const ID: usize = 8;

/// The word for a kind of jobs.
pub(crate) fn kind_word(kind: JobKind) -> &'static str {
    match kind {
        JobKind::Ingest => "ingest",
        JobKind::Train => "train",
        JobKind::Render => "render",
        JobKind::Evaluate => "evaluate",
        JobKind::Export => "export",
        JobKind::Unspecified => "unknown",
    }
}

/// The kind of a job.
pub(crate) fn kind(job: &Job) -> &'static str {
    match job.spec.as_ref().and_then(|spec| spec.kind.as_ref()) {
        Some(job_spec::Kind::Ingest(_)) => "ingest",
        Some(job_spec::Kind::Train(_)) => "train",
        Some(job_spec::Kind::Render(_)) => "render",
        Some(job_spec::Kind::Evaluate(it)) if it.tradeoff.is_some() => "trade-off",
        Some(job_spec::Kind::Evaluate(_)) => "evaluate",
        Some(job_spec::Kind::Export(_)) => "export",
        None => kind_word(job.kind()),
    }
}
