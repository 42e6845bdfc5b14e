//! Consent: nobody is in a job of a purpose to which they have not agreed, or no longer agree.

use crate::support::{
    Service, Trained, assert_invalid, assert_refused, claim, eventually, job_name,
};
use std::sync::Arc;
use std::time::Duration;
use tempfile::TempDir;
use tonic::Code;
use yoto_proto::v1::consent_item::State;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    Consent, ConsentPurpose, CreateJobRequest, DeleteSubjectRequest, ErrorReason,
    GetConsentEvidenceRequest, GrantConsentRequest, Job, JobSpec, ListConsentsRequest,
    MotionTransfer, Orbit, RenderSpec, RevokeConsentRequest, RevokeConsentResponse, TrainSpec, job,
    job_spec,
};
use yoto_proto::worker::v1::HeartbeatRequest;
use yoto_server::clock::ManualClock;

const TRAIN: ConsentPurpose = ConsentPurpose::ConsentTrain;
const RENDER: ConsentPurpose = ConsentPurpose::ConsentRender;
const START: f64 = 1e9;

impl Service {
    async fn grant(&self, subject: &str, purpose: ConsentPurpose, seconds: Option<f64>) -> Consent {
        let request = GrantConsentRequest {
            subject: subject.into(),
            purposes: vec![purpose.into()],
            given_by: "a parent".into(),
            note: "on paper".into(),
            expire_time: seconds.map(|it| prost_types::Timestamp {
                seconds: (START + it) as i64,
                nanos: 0,
            }),
            ..<_>::default()
        };
        let granted = self.subjects().grant_consent(request).await;
        granted.expect("is recorded").into_inner()
    }

    async fn revoke_consent(
        &self,
        subject: &str,
        purposes: &[ConsentPurpose],
    ) -> RevokeConsentResponse {
        let request = RevokeConsentRequest {
            subject: subject.into(),
            purposes: purposes.iter().map(|it| (*it).into()).collect(),
            note: "by telephone".into(),
            ..<_>::default()
        };
        let revoked = self.subjects().revoke_consent(request).await;
        revoked.expect("is revoked").into_inner()
    }

    async fn consents(&self, subject: &str) -> Vec<Consent> {
        let request = ListConsentsRequest {
            parent: subject.into(),
            ..<_>::default()
        };
        let listed = self.subjects().list_consents(request).await;
        listed.expect("lists").into_inner().consents
    }
}

fn train(trained: &Trained) -> job_spec::Kind {
    job_spec::Kind::Train(TrainSpec {
        model: trained.model.name.clone(),
        seconds: 1.0,
        ..<_>::default()
    })
}

fn render(trained: &Trained) -> job_spec::Kind {
    job_spec::Kind::Render(RenderSpec {
        model: trained.model.name.clone(),
        subject: trained.subject.name.clone(),
        what: Some(What::Orbit(Orbit {
            frame: 0,
            views: 1,
            size: 8,
        })),
        ..<_>::default()
    })
}

/// The job has ended in `state` for want of consent, and says whose.
fn assert_stopped(job: &Job, state: job::State) {
    assert_eq!(job.state(), state, "{job:?}");
    let error = job.error.as_ref().expect("says why");
    assert_eq!(error.code, "CONSENT");
    assert!(error.message.contains("Ada"), "{}", error.message);
}

/// A service on a clock of its own that looks for jobs without consent only after a revocation.
async fn seldom(required: bool) -> (Service, Arc<ManualClock>) {
    let clock = Arc::new(ManualClock::at(START));
    let own = Arc::clone(&clock);
    let dir = TempDir::new().expect("a folder");
    let service = Service::start_in(dir, move |config| {
        config.clock = own;
        config.require_consent = required;
        config.reap_interval = Duration::from_secs(3600);
    });
    (service.await, clock)
}

#[tokio::test]
async fn a_revoked_consent_refuses_jobs_of_its_purpose_and_no_others() {
    let service = Service::start().await;
    let trained = service.trained().await;
    let ada = &trained.subject.name;
    // Nobody was asked for a consent so far.
    service.create_job(render(&trained)).await.expect("queued");
    service.grant(ada, RENDER, None).await;
    service.grant(ada, TRAIN, None).await;
    service.revoke_consent(ada, &[RENDER]).await;
    let refused = service.create_job(render(&trained)).await;
    let said = refused
        .as_ref()
        .expect_err("is refused")
        .message()
        .to_owned();
    assert!(said.contains("Ada") && said.contains("render"), "{said}");
    assert_refused(refused, Code::FailedPrecondition, "CONSENT");
    service.create_job(train(&trained)).await.expect("queued");
    // A new consent counts, whatever was revoked before.
    service.grant(ada, RENDER, None).await;
    service.create_job(render(&trained)).await.expect("queued");
}

/// Somebody's motion on another body is a render of both.
#[tokio::test]
async fn the_motion_of_whoever_has_revoked_their_consent_moves_nobody() {
    let service = Service::start().await;
    let trained = service.trained().await;
    let bea = service.ready_subject("Bea").await.name;
    let by_bea = || {
        job_spec::Kind::Render(RenderSpec {
            what: Some(What::Motion(MotionTransfer {
                driver: bea.clone(),
                frame_count: 1,
                frame_step: 1,
                size: 8,
                ..<_>::default()
            })),
            model: trained.model.name.clone(),
            subject: trained.subject.name.clone(),
            ..<_>::default()
        })
    };
    let queued = service.create_job(by_bea()).await.expect("queued");
    service.revoke_consent(&bea, &[RENDER]).await;
    let ended = service.get_job(&queued.name).await;
    assert_eq!(ended.state(), job::State::Failed, "{ended:?}");
    let why = ended.error.expect("says why");
    assert!(
        why.code == "CONSENT" && why.message.contains("Bea"),
        "{why:?}"
    );
    let refused = service.create_job(by_bea()).await;
    let said = refused.as_ref().map_err(|it| it.message().to_owned());
    let said = said.expect_err("is refused");
    assert!(said.contains("Bea") && said.contains("render"), "{said}");
    assert_refused(refused, Code::FailedPrecondition, "CONSENT");
    service.create_job(render(&trained)).await.expect("queued");
}

#[tokio::test]
async fn a_service_that_asks_for_consent_refuses_whoever_gave_none() {
    let service = Service::start_with(|config| config.require_consent = true).await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    let order = || {
        job_spec::Kind::Train(TrainSpec {
            model: model.name.clone(),
            seconds: 1.0,
            ..<_>::default()
        })
    };
    let reason = ErrorReason::Consent.as_str_name();
    let refused = service.create_job(order()).await;
    let said = refused
        .as_ref()
        .expect_err("is refused")
        .message()
        .to_owned();
    assert!(
        said.contains("Ada") && said.contains("--for train"),
        "{said}"
    );
    assert_refused(refused, Code::FailedPrecondition, reason);
    let checked = CreateJobRequest {
        spec: Some(JobSpec {
            kind: Some(order()),
        }),
        validate_only: true,
        ..<_>::default()
    };
    let checked = service.jobs().create_job(checked).await;
    assert_refused(checked, Code::FailedPrecondition, reason);
    // That is another purpose.
    service.grant(&ada.name, RENDER, None).await;
    let refused = service.create_job(order()).await;
    assert_refused(refused, Code::FailedPrecondition, reason);
    service.grant(&ada.name, TRAIN, None).await;
    service.create_job(order()).await.expect("is queued");
}

#[tokio::test]
async fn a_revocation_ends_queued_and_running_jobs_at_once() {
    let (service, _) = seldom(false).await;
    let trained = service.trained().await;
    let ada = &trained.subject.name;
    let running = job_name(&trained.training);
    let queued = service.create_job(render(&trained)).await.expect("queued");
    let bob = service.ready_subject("Bob").await;
    let theirs = service.model_of(&bob).await;
    let theirs = service.train(&theirs).await;
    // Without a purpose, all are revoked. There was no record of any of them.
    let ended = service.revoke_consent(ada, &[]).await.jobs;
    assert_eq!(ended, [running.clone(), queued.name.clone()]);
    assert_stopped(&service.get_job(&queued.name).await, job::State::Failed);
    assert_stopped(&service.get_job(&running).await, job::State::Cancelled);
    let beat = HeartbeatRequest {
        claim: Some(claim(&trained.training)),
        progress: None,
    };
    let stale = service.workers().heartbeat(beat).await;
    assert_refused(stale, Code::FailedPrecondition, "STALE_LEASE");
    let published = service.publish(&trained.training, 2).await;
    assert_refused(published, Code::FailedPrecondition, "STALE_LEASE");
    let other = service.get_job(&theirs.name).await;
    assert_eq!(other.state(), job::State::Queued);
    let kept = service.consents(ada).await;
    assert_eq!((kept.len(), kept[0].items.len()), (1, 4));
    assert_eq!(kept[0].note, "by telephone");
}

#[tokio::test]
async fn a_job_whose_consent_has_run_out_in_the_queue_is_never_leased() {
    for required in [false, true] {
        let (service, clock) = seldom(required).await;
        let ada = service.ready_subject("Ada").await;
        let model = service.model_of(&ada).await;
        service.grant(&ada.name, TRAIN, Some(60.0)).await;
        let queued = service.train(&model).await;
        clock.advance(61.0);
        let worker = service.worker(&["train"]).await;
        assert!(service.lease(&worker).await.is_none());
        assert_stopped(&service.get_job(&queued.name).await, job::State::Failed);
    }
}

#[tokio::test]
async fn a_job_that_nobody_was_asked_about_is_not_leased_once_consent_is_asked_for() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    let queued = service.train(&model).await;
    let dir = service.stop().await;
    let service = Service::start_in(dir, |config| config.require_consent = true).await;
    let worker = service.worker(&["train"]).await;
    assert!(service.lease(&worker).await.is_none());
    assert_stopped(&service.get_job(&queued.name).await, job::State::Failed);
}

#[tokio::test]
async fn running_jobs_end_when_a_consent_runs_out() {
    let clock = Arc::new(ManualClock::at(START));
    let own = Arc::clone(&clock);
    let dir = TempDir::new().expect("a folder");
    let service = Service::start_in(dir, move |config| config.clock = own).await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    service.grant(&ada.name, TRAIN, Some(10.0)).await;
    let worker = service.worker(&["train"]).await;
    let (lease, _) = service.train_to(&model, &worker, 1).await;
    clock.advance(9.0);
    service
        .publish(&lease, 2)
        .await
        .expect("is still agreed to");
    clock.advance(2.0);
    let job = job_name(&lease);
    let ended = eventually("the end", async || {
        let job = service.get_job(&job).await;
        job.state().is_terminal().then_some(job)
    });
    assert_stopped(&ended.await, job::State::Cancelled);
}

#[tokio::test]
async fn records_are_kept_with_their_states() {
    let (service, clock) = seldom(false).await;
    let ada = service.subject("Ada").await.name;
    let first = service.grant(&ada, TRAIN, Some(60.0)).await;
    let request = GrantConsentRequest {
        subject: ada.clone(),
        purposes: vec![RENDER.into(), TRAIN.into(), RENDER.into()],
        request_id: "once".into(),
        ..<_>::default()
    };
    let second = service.subjects().grant_consent(request.clone()).await;
    let again = service.subjects().grant_consent(request).await;
    let second = second.expect("is recorded").into_inner();
    assert_eq!(second, again.expect("repeats").into_inner());
    let states = |consent: &Consent| {
        let items = consent.items.iter();
        let item = |it: &yoto_proto::v1::ConsentItem| (it.purpose(), it.state());
        items.map(item).collect::<Vec<_>>()
    };
    assert_eq!(states(&first), [(TRAIN, State::Valid)]);
    assert_eq!(first.given_by, "a parent");
    assert_eq!(first.note, "on paper");
    assert_eq!(
        states(&second),
        [(TRAIN, State::Valid), (RENDER, State::Valid)]
    );
    clock.advance(60.0);
    service.revoke_consent(&ada, &[RENDER]).await;
    let kept = service.consents(&ada).await;
    let kept: Vec<_> = kept.iter().map(states).collect();
    let newest = vec![(TRAIN, State::Valid), (RENDER, State::Revoked)];
    assert_eq!(kept, [newest, vec![(TRAIN, State::Expired)]]);
    let page = ListConsentsRequest {
        parent: ada.clone(),
        page_size: 1,
        ..<_>::default()
    };
    let page = service.subjects().list_consents(page).await;
    let page = page.expect("lists").into_inner();
    assert_eq!(page.consents[0].name, second.name);
    let rest = ListConsentsRequest {
        parent: ada,
        page_size: 1,
        page_token: page.next_page_token,
    };
    let rest = service.subjects().list_consents(rest).await;
    assert_eq!(
        rest.expect("lists").into_inner().consents[0].name,
        first.name
    );
}

#[tokio::test]
async fn a_consent_names_a_person_and_purposes() {
    let service = Service::start().await;
    let ada = service.subject("Ada").await.name;
    let good = GrantConsentRequest {
        subject: ada,
        purposes: vec![TRAIN.into()],
        ..<_>::default()
    };
    let nobody = GrantConsentRequest {
        subject: "subjects/nobody".into(),
        ..good.clone()
    };
    let answer = service.subjects().grant_consent(nobody).await;
    assert_refused(answer, Code::NotFound, "NOT_FOUND");
    for (purposes, given_by, field) in [
        (vec![], "", "purposes"),
        (vec![0], "", "purposes"),
        (vec![99], "", "purposes"),
        (vec![1], "two\nlines", "given_by"),
    ] {
        let bad = GrantConsentRequest {
            purposes,
            given_by: given_by.into(),
            ..good.clone()
        };
        assert_invalid(service.subjects().grant_consent(bad).await, field);
    }
}

#[tokio::test]
async fn a_file_proves_a_consent_and_goes_with_the_person() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let request = |evidence: &[u8], name: &str| GrantConsentRequest {
        subject: subject.name.clone(),
        purposes: vec![TRAIN.into()],
        evidence: evidence.to_vec(),
        evidence_file_name: name.into(),
        ..<_>::default()
    };
    let form = [&b"%PDF signed"[..], &[0, 255]].concat();
    let granted = service
        .subjects()
        .grant_consent(request(&form, "form.pdf"))
        .await;
    let granted = granted.expect("is recorded").into_inner();
    let evidence = granted.evidence.clone().expect("a file");
    assert_eq!((&*evidence.file_name, evidence.bytes), ("form.pdf", 13));
    assert_eq!(evidence.sha256, yoto_proto::sha256_hex(&form));
    assert_eq!(
        service.consents(&subject.name).await.first(),
        Some(&granted)
    );
    let get = GetConsentEvidenceRequest {
        name: granted.name.clone(),
    };
    let file = service.subjects().get_consent_evidence(get.clone()).await;
    assert_eq!(file.expect("is there").into_inner().content, form);

    let large = vec![0; yoto_proto::limits::EVIDENCE_BYTES + 1];
    for (bytes, name, field) in [
        (&form[..], "", "evidence_file_name"),
        (&form[..], "../form.pdf", "evidence_file_name"),
        (&form[..], "..", "evidence_file_name"),
        (b"", "form.pdf", "evidence"),
        (&large[..], "form.pdf", "evidence"),
    ] {
        let refused = service.subjects().grant_consent(request(bytes, name)).await;
        assert_invalid(refused, field);
    }
    let without = service.grant(&subject.name, RENDER, None).await;
    let none = GetConsentEvidenceRequest { name: without.name };
    let refused = service.subjects().get_consent_evidence(none).await;
    assert_refused(refused, Code::NotFound, "NOT_FOUND");

    let delete = DeleteSubjectRequest {
        name: subject.name.clone(),
        ..<_>::default()
    };
    service
        .subjects()
        .delete_subject(delete)
        .await
        .expect("is deleted");
    let refused = service.subjects().get_consent_evidence(get).await;
    assert_refused(refused, Code::NotFound, "NOT_FOUND");
}
