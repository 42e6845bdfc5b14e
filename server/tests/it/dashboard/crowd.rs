//! A service with many people, models, jobs and workers.

use super::stage::{Stage, ingest};
use crate::support::{Service, claim, id, job_name};
use yoto_proto::keys;
use yoto_proto::v1::{
    ConsentPurpose, EvaluateResult, EvaluateSpec, GrantConsentRequest, Model, RenderedFile, Scores,
    Subject, SubjectScores, TradeoffSpec, job_result, job_spec,
};
use yoto_proto::worker::v1::CommitOutputRequest;
use yoto_proto::worker::v1::end_job_request::Outcome;

/// People, and models.
const MANY: usize = 50;
/// People in the model whose page is looked at, each with several captures and consents.
const TOGETHER: usize = 6;
/// Captures of each of them.
const CAPTURES: usize = 3;
/// Workers with a running training.
const BUSY: usize = 5;
/// Time for which a lease lasts without a report, seconds.
const LEASE_SECONDS: f64 = 3600.0;
/// Models with a training that waits or runs.
const TRAININGS: usize = 15;

/// The service, and what it has.
pub(super) struct Crowd {
    pub stage: Stage,
    pub people: Vec<Subject>,
    /// The first one has several people, checkpoints, trainings, a render, an evaluation and an export; each other has a person.
    pub models: Vec<Model>,
    /// A training that waits, and a render that waits and has written a file.
    pub waiting: String,
    pub put_back: String,
}

impl Crowd {
    pub(super) async fn gathered() -> Self {
        // All that runs goes on running, however long the others take to come.
        let service = Service::start_with(|it| it.lease_seconds = LEASE_SECONDS).await;
        let stage = Stage::set_in(service).await;
        let service = &stage.service;
        let mut people = Vec::new();
        for number in 0..MANY {
            people.push(service.ready_subject(&format!("person {number}")).await);
        }
        let mut model = stage.model.clone();
        for person in people.iter().take(TOGETHER) {
            model = service.joined(model, person).await;
            stage.filmed_again(person).await;
            stage.agreed(person, &[ConsentPurpose::ConsentTrain]).await;
            let more = [ConsentPurpose::ConsentRender, ConsentPurpose::ConsentShare];
            stage.agreed(person, &more).await;
        }
        let mut models = vec![model];
        for person in &people {
            let model = service.model(&format!("of {}", person.display_name)).await;
            models.push(service.joined(model, person).await);
        }
        stage.evaluated(&models[0]).await;
        stage.export("page.html", b"<!doctype html>").await;
        let put_back = stage.put_back(&models[0]).await;
        let mut waiting = String::new();
        for model in models.iter().take(TRAININGS) {
            waiting = service.train(model).await.name;
        }
        for number in 0..BUSY {
            let name = format!("busy {number}");
            let worker = service.worker_called(&name, &["train"]).await;
            let lease = service.lease(&worker).await;
            lease.expect("a training waits");
        }
        Self {
            stage,
            people,
            models,
            waiting,
            put_back,
        }
    }
}

impl Stage {
    /// More captures of a person, with reports of their checks.
    async fn filmed_again(&self, person: &Subject) {
        let worker = self.service.worker(&["ingest"]).await;
        for _ in 1..CAPTURES {
            self.service.upload_good(&person.name).await;
            let lease = self.service.lease(&worker).await;
            ingest(&self.service, &lease.expect("the ingest job waits")).await;
        }
    }

    async fn agreed(&self, person: &Subject, purposes: &[ConsentPurpose]) {
        let request = GrantConsentRequest {
            subject: person.name.clone(),
            purposes: purposes.iter().map(|&it| it.into()).collect(),
            given_by: "a parent".into(),
            ..GrantConsentRequest::default()
        };
        let granted = self.service.subjects().grant_consent(request).await;
        granted.expect("is recorded");
    }

    /// An evaluation with a trade-off.
    async fn evaluated(&self, model: &Model) {
        let spec = EvaluateSpec {
            model: model.name.clone(),
            tradeoff: Some(TradeoffSpec::default()),
            ..EvaluateSpec::default()
        };
        let ordered = self
            .service
            .create_job(job_spec::Kind::Evaluate(spec))
            .await;
        ordered.expect("is queued");
        let worker = self.service.worker(&["evaluate"]).await;
        let lease = self.service.lease(&worker).await.expect("it waits");
        let (of_model, of_job) = (id(&model.name), job_name(&lease));
        let key = keys::tradeoff(of_model, id(&of_job), lease.token, 1);
        let curve = br#"{"version": 2, "machine": {"cpu": "x", "cores": 2, "device": "gpu"}, "size": 8, "views": 1,
            "points": [{"settings": {}, "seconds": 1.0, "psnr_to_full": 100.0, "psnr": 25.0}]}"#;
        let scores = Some(Scores {
            pictures: 2,
            ..Scores::default()
        });
        let subjects = model.slots.iter().map(|it| SubjectScores {
            subject: it.subject.clone(),
            scores,
            ..SubjectScores::default()
        });
        let result = EvaluateResult {
            checkpoint: format!("{}/checkpoints/1", model.name),
            tradeoff: Some(self.service.put(&key, curve).await),
            subjects: subjects.collect(),
            mean: scores,
            ..EvaluateResult::default()
        };
        let kind = job_result::Kind::Evaluate(result);
        let ended = self.service.complete(&lease, kind).await;
        ended.expect("succeeds");
    }

    /// A render that was given back after its first file. Its name.
    async fn put_back(&self, model: &Model) -> String {
        let checkpoint = format!("{}/checkpoints/1", model.name);
        let render = self.service.render(model, &self.subject, &checkpoint);
        let render = render.await.name;
        let worker = self.service.worker(&["render"]).await;
        let lease = self.service.lease(&worker).await.expect("it waits");
        let key = keys::render(id(&render), lease.token, "000000.png");
        let file = RenderedFile {
            file: "000000.png".into(),
            object: Some(self.service.put(&key, b"picture").await),
        };
        let request = CommitOutputRequest {
            claim: Some(claim(&lease)),
            file: Some(file),
        };
        let committed = self.service.workers().commit_output(request).await;
        committed.expect("holds the lease");
        let back = self.service.end(&lease, Outcome::Returned(<_>::default()));
        back.await.expect("is given back");
        render
    }
}
