//! Usage and quotas of tenants.

use crate::support::{Service, Trained, assert_invalid, assert_refused, claim, file, id, job_name};
use std::sync::Arc;
use tempfile::TempDir;
use tonic::transport::Channel;
use tonic::{Code, Status};
use tonic_types::StatusExt;
use yoto_proto::keys;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::tenant_service_client::TenantServiceClient;
use yoto_proto::v1::{
    CancelJobRequest, CreateJobRequest, CreateSubjectRequest, DeleteJobRequest, GetUsageRequest,
    JobSpec, ListUsageRequest, Orbit, Quota, RenderSpec, RenderedFile, Scope, SetQuotaRequest,
    Subject, TrainSpec, Usage, job_spec,
};
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_proto::worker::v1::{CommitOutputRequest, LeaseJobRequest};
use yoto_server::clock::ManualClock;

/// A noon of UTC, seconds since 1970.
const NOON: f64 = 11_574.0 * DAY + DAY / 2.0;
const DAY: f64 = 86_400.0;

impl Service {
    fn tenants(&self) -> TenantServiceClient<Channel> {
        TenantServiceClient::new(self.connector.channel())
    }

    async fn usage(&self) -> Usage {
        let usage = self.tenants().get_usage(GetUsageRequest::default()).await;
        usage.expect("is told").into_inner()
    }

    async fn quota(&self, quota: Quota) {
        let request = SetQuotaRequest {
            tenant: String::new(),
            quota: Some(quota),
        };
        self.tenants().set_quota(request).await.expect("is set");
    }

    async fn new_person(&self) -> Result<Subject, Status> {
        let request = CreateSubjectRequest {
            display_name: "somebody".into(),
            ..<_>::default()
        };
        let made = self.subjects().create_subject(request).await;
        made.map(|it| it.into_inner())
    }
}

/// A model whose training has ended.
async fn ended(service: &Service) -> Trained {
    let trained = service.trained().await;
    let training = service.complete_training(&trained.training, &trained.checkpoint);
    training.await;
    trained
}

fn training(trained: &Trained) -> job_spec::Kind {
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
            views: 1,
            size: 8,
            ..<_>::default()
        })),
        ..<_>::default()
    })
}

/// Refused, and the metadata name the quota.
fn assert_reached<T: std::fmt::Debug>(answer: Result<T, Status>, quota: &str) {
    let status = answer.as_ref().expect_err("is refused");
    let details = status.get_error_details();
    let info = details.error_info().expect("has an ErrorInfo");
    assert_eq!(info.metadata.get("quota").map(String::as_str), Some(quota));
    assert_refused(answer, Code::ResourceExhausted, "QUOTA");
}

#[tokio::test]
async fn people_bytes_and_open_jobs_have_a_most() {
    let service = Service::start().await;
    let trained = ended(&service).await;
    let before = service.usage().await;
    assert_eq!((before.people, before.open_jobs), (1, 0));
    let stored = before.stored.expect("by kind");
    assert!(stored.captures > 0 && stored.checkpoints > 0, "{stored:?}");
    let all = stored.uploads + stored.captures + stored.checkpoints + stored.results;
    assert_eq!(all, before.bytes);
    assert_eq!(before.quota, Some(Quota::default()));

    service
        .quota(Quota {
            people: Some(2),
            bytes: Some(before.bytes + 2),
            open_jobs: Some(1),
            ..Quota::default()
        })
        .await;
    let second = service.new_person().await.expect("has room");
    assert_reached(service.new_person().await, "people");

    let three = [file("poses.json", b"{ }")];
    let refused = service.open_upload(&second.name, &three).await;
    assert_reached(refused, "bytes");
    let job = service.create_job(training(&trained)).await;
    let job = job.expect("bytes are left");
    assert_reached(service.create_job(render(&trained)).await, "open_jobs");
    let asked = CreateJobRequest {
        spec: Some(JobSpec {
            kind: Some(render(&trained)),
        }),
        validate_only: true,
        ..<_>::default()
    };
    assert_reached(service.jobs().create_job(asked).await, "open_jobs");
    let cancel = CancelJobRequest {
        name: job.name,
        ..<_>::default()
    };
    service
        .jobs()
        .cancel_job(cancel)
        .await
        .expect("is cancelled");

    let two = [file("poses.json", b"{}")];
    let upload = service.open_upload(&second.name, &two).await;
    upload.expect("fits exactly");
    assert_reached(service.create_job(training(&trained)).await, "bytes");
    assert_eq!(service.usage().await.bytes, before.bytes + 2);

    service.quota(Quota::default()).await;
    service.new_person().await.expect("nothing is limited");
    service.create_job(training(&trained)).await.expect("same");
}

#[tokio::test]
async fn work_counts_for_thirty_days_also_without_its_job() {
    let clock = Arc::new(ManualClock::at(NOON));
    let own = Arc::clone(&clock);
    let dir = TempDir::new().expect("a folder");
    let service = Service::start_in(dir, move |config| {
        config.clock = own;
        config.lease_seconds = 1000.0;
    })
    .await;
    let trained = ended(&service).await;
    let before = service.usage().await;
    let order = service.create_job(render(&trained)).await;
    let order = order.expect("is queued");
    let worker = service.worker(&["render"]).await;
    let lease = service.lease(&worker).await.expect("waits");
    clock.advance(100.0);
    let running = service.usage().await;
    assert_eq!(running.device_seconds, before.device_seconds + 100.0);
    assert_eq!(running.open_jobs, 1);

    let key = keys::render(id(&job_name(&lease)), lease.token, "000000.png");
    let commit = CommitOutputRequest {
        claim: Some(claim(&lease)),
        file: Some(RenderedFile {
            file: "000000.png".into(),
            object: Some(service.put(&key, b"picture").await),
        }),
    };
    let committed = service.workers().commit_output(commit).await;
    committed.expect("is committed");
    service.complete_render(&lease).await;
    let delete = DeleteJobRequest {
        name: order.name,
        ..<_>::default()
    };
    service.jobs().delete_job(delete).await.expect("is deleted");
    let ended = service.usage().await;
    assert_eq!(ended.device_seconds, running.device_seconds);
    assert_eq!((ended.pictures, ended.open_jobs), (1, 0));

    service
        .quota(Quota {
            pictures: Some(1),
            ..Quota::default()
        })
        .await;
    assert_reached(service.create_job(render(&trained)).await, "pictures");
    let queued = service.create_job(training(&trained)).await;
    let name = queued.expect("has no pictures").name;
    let cancel = CancelJobRequest {
        name,
        ..<_>::default()
    };
    service
        .jobs()
        .cancel_job(cancel)
        .await
        .expect("is cancelled");
    service
        .quota(Quota {
            device_seconds: Some(ended.device_seconds),
            ..Quota::default()
        })
        .await;
    let refused = service.create_job(training(&trained)).await;
    assert_reached(refused, "device_seconds");
    // What is uploaded is read nevertheless.
    service.upload_good(&trained.subject.name).await;

    clock.advance(30.0 * DAY);
    let day_30 = service.usage().await;
    assert_eq!(day_30.device_seconds, ended.device_seconds);
    clock.advance(DAY / 2.0);
    let day_31 = service.usage().await;
    assert_eq!((day_31.device_seconds, day_31.pictures), (0.0, 0));
    service.create_job(training(&trained)).await.expect("again");
}

#[tokio::test]
async fn calls_at_once_do_not_share_the_last_place() {
    let service = Service::start().await;
    // In the first rounds the database's connections are still opened one after the other.
    for round in 1..=6 {
        let quota = Quota {
            people: Some(3 * round),
            ..Quota::default()
        };
        service.quota(quota).await;
        let calls = (0..8).map(|_| service.new_person());
        let answers = futures::future::join_all(calls).await;
        assert_eq!(answers.iter().filter(|it| it.is_ok()).count(), 3);
        assert_eq!(service.usage().await.people, 3 * round);
    }
}

#[tokio::test]
async fn a_quota_is_of_one_tenant_and_set_by_the_services_operators() {
    let service = Service::start().await;
    let quota = |tenant: &str, people| SetQuotaRequest {
        tenant: tenant.into(),
        quota: Some(Quota {
            people: Some(people),
            ..Quota::default()
        }),
    };
    service.new_person().await.expect("is made");
    let lab = service.key("lab", &[Scope::Read, Scope::Operate]).await;
    let set = service.tenants().set_quota(quota("lab", 5)).await;
    assert_eq!(set.expect("is set").into_inner().tenant, "lab");

    let mut of_lab = TenantServiceClient::new(service.with_key(&lab));
    let own = of_lab.get_usage(GetUsageRequest::default()).await;
    let own = own.expect("is told").into_inner();
    assert_eq!((own.tenant.as_str(), own.people), ("lab", 0));
    assert_eq!(own.quota.and_then(|it| it.people), Some(5));
    let named = GetUsageRequest {
        tenant: "default".into(),
    };
    let denied = |answer: Result<_, Status>| {
        assert_refused(answer, Code::PermissionDenied, "SCOPE_MISSING");
    };
    denied(of_lab.get_usage(named).await.map(drop));
    denied(of_lab.set_quota(quota("lab", 9)).await.map(drop));
    denied(of_lab.list_usage(ListUsageRequest {}).await.map(drop));

    let all = service.tenants().list_usage(ListUsageRequest {}).await;
    let all = all.expect("is listed").into_inner().usage;
    let found: Vec<_> = all.iter().map(|it| (&*it.tenant, it.people)).collect();
    assert_eq!(found, [("default", 1), ("lab", 0)]);

    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        let request = SetQuotaRequest {
            tenant: "lab".into(),
            quota: Some(Quota {
                device_seconds: Some(bad),
                ..Quota::default()
            }),
        };
        let refused = service.tenants().set_quota(request).await;
        assert_invalid(refused, "quota.device_seconds");
    }
    let refused = service.tenants().set_quota(quota("The Lab", 1)).await;
    assert_invalid(refused, "tenant");
    let refused = service.tenants().set_quota(quota("lab", u64::MAX)).await;
    assert_invalid(refused, "quota.people");
}

#[tokio::test]
async fn calls_beyond_a_tenants_rate_wait_and_those_of_others_and_of_workers_pass() {
    let service = Service::start().await;
    let rate = SetQuotaRequest {
        tenant: "lab".into(),
        quota: Some(Quota {
            calls_per_second: Some(0.01),
            ..Quota::default()
        }),
    };
    service.tenants().set_quota(rate).await.expect("is set");
    let lab = service.key("lab", &[Scope::Read]).await;
    let other = service.key("other", &[Scope::Read]).await;
    let of_workers = service.key("lab", &[Scope::Work]).await;
    let asked = async |key: &_| {
        let mut client = TenantServiceClient::new(service.with_key(key));
        client.get_usage(GetUsageRequest::default()).await
    };
    for _ in 0..10 {
        asked(&lab).await.expect("a burst");
    }
    assert_refused(asked(&lab).await, Code::Unavailable, "BUSY");
    for _ in 0..12 {
        asked(&other).await.expect("another tenant");
        let mut workers = WorkerServiceClient::new(service.with_key(&of_workers));
        let request = LeaseJobRequest {
            worker: "workers/none".into(),
            ..LeaseJobRequest::default()
        };
        let answer = workers
            .lease_job(request)
            .await
            .expect_err("there is no such worker");
        assert_eq!(answer.code(), Code::NotFound);
    }
    assert_refused(asked(&lab).await, Code::Unavailable, "BUSY");
    // A rate counts from the call that sets it, also for keys that were in use.
    let rate = SetQuotaRequest {
        tenant: "other".into(),
        quota: Some(Quota {
            calls_per_second: Some(0.01),
            ..Quota::default()
        }),
    };
    service.tenants().set_quota(rate).await.expect("is set");
    for _ in 0..10 {
        asked(&other).await.expect("a burst");
    }
    assert_refused(asked(&other).await, Code::Unavailable, "BUSY");
}
