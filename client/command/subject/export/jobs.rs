//! Jobs about a person, and the files of renders and exports that show nobody else.

use super::{ExportedPart, PersonExport, id};
use anyhow::Context;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::Path;
use yoto_proto::names::Collection;
use yoto_proto::v1::{Job, JobKind, JobResult, job_result};
use yoto_terminal::output;

impl PersonExport<'_> {
    /// Writes the files of all jobs that are about them alone.
    pub(super) async fn jobs(&self) -> anyhow::Result<ExportedPart> {
        let mut part = ExportedPart::default();
        for job in self.client.list_jobs().await? {
            let people = people(&job);
            if !people.contains(&*self.subject.name) {
                continue;
            }
            // Names of others in its order and its result are not this person's data.
            part.about.push(json!({
                "job": job.name,
                "kind": job.kind().as_str_name(),
                "state": job.state().as_str_name(),
                "create_time": job.create_time.as_ref().map(output::message),
                "end_time": job.end_time.as_ref().map(output::message),
            }));
            if matches!(job.kind(), JobKind::Evaluate) {
                self.scores(&job, &mut part)?;
                continue;
            }
            let objects = match job.kind() {
                JobKind::Render | JobKind::Export => self.client.list_objects(&job.name).await?,
                _ => continue,
            };
            if people.len() > 1 && !objects.is_empty() {
                part.left_out.push(format!(
                    "the files of {}, which show or need somebody else too",
                    job.name
                ));
                continue;
            }
            let folder = self.out.join("jobs").join(id(&job.name));
            let (client, quietly) = (self.client, &mut |_| ());
            part.files
                .extend(client.fetch_objects(&objects, &folder, quietly).await?);
        }
        Ok(part)
    }

    /// Writes what an evaluation has measured of them.
    fn scores(&self, job: &Job, part: &mut ExportedPart) -> anyhow::Result<()> {
        let result = job.result.as_ref().and_then(|it| it.kind.as_ref());
        let Some(job_result::Kind::Evaluate(result)) = result else {
            return Ok(());
        };
        let own = result.subjects.iter();
        let own: Vec<Value> = own
            .filter(|scores| scores.subject == self.subject.name)
            .map(output::message)
            .collect();
        let text = serde_json::to_vec_pretty(&own).context("writing scores")?;
        let place = Path::new("jobs").join(id(&job.name)).join("scores.json");
        part.files.push(self.write(&place, &text)?);
        Ok(())
    }
}

/// The people whom a job's order or result names. An order that names nobody, as of a training of all people of a model,
/// is no one's alone.
fn people(job: &Job) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    if let Some(spec) = &job.spec {
        collect(&output::message(spec), &mut found);
    }
    if let Some(result) = &job.result {
        collect(&output::message::<JobResult>(result), &mut found);
    }
    found
}

/// Adds all names of subjects in `value`.
fn collect(value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::String(text) if Collection::Subjects.parse(text).is_ok() => {
            found.insert(text.clone());
        }
        Value::Array(values) => values.iter().for_each(|it| collect(it, found)),
        Value::Object(fields) => fields.values().for_each(|it| collect(it, found)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::{Actor, JobSpec, RenderSpec, Scene, job, job_spec, render_spec};

    #[test]
    fn people_are_found_wherever_an_order_names_them() {
        let [ada, ben] = ["subjects/0a", "subjects/0b"];
        let render = |spec: RenderSpec| Job {
            spec: Some(JobSpec {
                kind: Some(job_spec::Kind::Render(spec)),
            }),
            state: job::State::Succeeded.into(),
            ..Job::default()
        };
        let alone = render(RenderSpec {
            subject: ada.into(),
            ..RenderSpec::default()
        });
        assert_eq!(people(&alone), [ada.to_owned()].into());
        let actor = |subject: &str| Actor {
            subject: subject.into(),
            ..Actor::default()
        };
        let scene = render(RenderSpec {
            what: Some(render_spec::What::Scene(Scene {
                actors: vec![actor(ada), actor(ben)],
                ..Scene::default()
            })),
            ..RenderSpec::default()
        });
        assert_eq!(people(&scene), [ada.to_owned(), ben.to_owned()].into());
        assert!(people(&Job::default()).is_empty());
    }
}
