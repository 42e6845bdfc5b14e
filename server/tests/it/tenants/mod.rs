//! Tenants: nobody sees, uses or changes what is another's, and nobody learns that it exists.
//!
//! The contract's descriptors are walked, so that a new call is covered without being named here.

pub(crate) mod calls;
pub(crate) mod requests;

use crate::support::{SCOPES, Service, chunks as chunks_of, file};
use calls::{Answer, call};
use prost_reflect::{DynamicMessage, FieldDescriptor, MethodDescriptor};
use requests::{Content, is_report, leaves, methods, unknown, with};
use std::collections::{BTreeSet, HashMap};
use std::mem;
use tonic::Code;
use tonic::transport::Channel;
use yoto_proto::key::{Connection, connection};
use yoto_proto::names;
use yoto_proto::v1::upload_service_client::UploadServiceClient;
use yoto_proto::v1::{
    CreateSubjectRequest, EraseSubjectRequest, FinishUploadRequest, GetUploadRequest, JobKind,
    ListSubjectsRequest, PauseJobsRequest, Scope,
};
use yoto_server::{Admission, Tenant, in_memory};

/// Connects as another tenant.
fn connect(service: &Service, tenant: &str) -> Channel {
    let (connector, incoming) = in_memory();
    let tenant = Tenant::new(tenant).expect("an id");
    let serving =
        service
            .coordinator
            .serve_to(Admission::Process(tenant), incoming, std::future::pending());
    tokio::spawn(serving);
    connector.channel()
}

/// One of everything, made by the current tenant of `service`.
async fn content(service: &Service) -> Content {
    let trained = service.trained().await;
    let files = [file("poses.json", b"{}")];
    let upload = service.open_upload(&trained.subject.name, &files).await;
    Content {
        capture: trained.subject.captures[0].clone(),
        subject: trained.subject.name,
        upload: upload.expect("is opened").name,
        object: names::object(&trained.checkpoint.name, "weights.safetensors"),
        model: trained.model.name,
        checkpoint: trained.checkpoint.name,
        job: trained.training.job.expect("has a job").name,
        worker: trained.worker,
        key: "keys/none".into(),
        erasure: erased(service).await,
        share: "shares/none".into(),
        webhook: "webhooks/none".into(),
        consent: "consents/none".into(),
    }
}

/// A link to a job of the tenant.
async fn shared(service: &Service, tenant: &str, content: &Content) -> String {
    // As long as other ids, so that answers differ in nothing else.
    let id = yoto_proto::sha256_hex(tenant.as_bytes())[..36].to_owned();
    let (job, subject) = (requests::id(&content.job), requests::id(&content.subject));
    let insert = format!(
        "INSERT INTO shares (id, tenant, job, subject, sha256, note, embed, create_time)
         VALUES ('{id}', '{tenant}', '{job}', '{subject}', '{id}', '', 0, 1.0)"
    );
    service.database.run(&insert).await;
    format!("shares/{id}")
}

/// An address that the tenant has told the service.
async fn webhook(service: &Service, tenant: &str) -> String {
    let id = yoto_proto::sha256_hex(format!("webhook of {tenant}").as_bytes())[..36].to_owned();
    let insert = format!(
        "INSERT INTO webhooks (id, tenant, url, secret, note, create_time)
         VALUES ('{id}', '{tenant}', 'https://example.org/', 'whsec_', '', 1.0)"
    );
    service.database.run(&insert).await;
    format!("webhooks/{id}")
}

/// A consent of the tenant's person, with a file that proves it.
async fn proved(service: &Service, content: &Content) -> String {
    let subject = requests::id(&content.subject);
    let id = yoto_proto::sha256_hex(format!("consent of {subject}").as_bytes())[..36].to_owned();
    let insert = format!(
        "INSERT INTO consents (id, subject, given_by, note, create_time) VALUES ('{id}', '{subject}', '', '', 1.0)"
    );
    service.database.run(&insert).await;
    let file = format!(
        "INSERT INTO consent_evidence (consent, file_name, bytes, sha256, content) VALUES ('{id}', 'form.pdf', 1, '{id}', "
    );
    let (sqlite, postgres) = (
        format!("{file}x'00')"),
        format!("{file}decode('00', 'hex'))"),
    );
    service.database.run_either(&sqlite, &postgres).await;
    format!("consents/{id}")
}

/// The erasure of a person who is in nothing.
async fn erased(service: &Service) -> String {
    let nobody = service.subject("Nobody").await;
    let request = EraseSubjectRequest {
        name: nobody.name,
        display_name: "Nobody".into(),
        ..<_>::default()
    };
    let erased = service.subjects().erase_subject(request).await;
    erased.expect("is erased").into_inner().name
}

/// A service with one of everything of each of two tenants, and keys of the second one.
struct TwoTenants {
    /// It runs as long as this lives.
    _service: Service,
    /// What the default tenant has.
    theirs: Content,
    /// What the tenant `other` has.
    own: Content,
    /// The tenant's connection for each scope.
    keyed: HashMap<Scope, Connection>,
}

async fn two_tenants() -> TwoTenants {
    // Thousands of calls are refused.
    let mut service = Service::start_with(|config| config.traffic.refused_calls = 1_000_000).await;
    let mut theirs = content(&service).await;
    theirs.share = shared(&service, "default", &theirs).await;
    theirs.webhook = webhook(&service, "default").await;
    theirs.consent = proved(&service, &theirs).await;
    theirs.key = service.key("default", &[Scope::Read]).await.name;
    let door = service.door(Admission::Nobody);
    let (mut keyed, mut of_worker) = (HashMap::new(), String::new());
    for scope in SCOPES {
        let key = service.key("other", &[scope]).await;
        of_worker = key.name.clone();
        keyed.insert(scope, connection(door.clone(), Some(key.secret)));
    }
    let revoked = service.key("other", &[Scope::Read]).await.name;
    service.channel = connect(&service, "other");
    let mut own = content(&service).await;
    own.key = revoked;
    own.share = shared(&service, "other", &own).await;
    own.webhook = webhook(&service, "other").await;
    own.consent = proved(&service, &own).await;
    // As if it had registered with the key.
    let bound = format!(
        "UPDATE workers SET key = '{}' WHERE id = '{}'",
        requests::id(&of_worker),
        requests::id(&own.worker)
    );
    service.database.run(&bound).await;
    TwoTenants {
        _service: service,
        theirs,
        own,
        keyed,
    }
}

impl TwoTenants {
    /// The connection that may call the method.
    fn connection(&self, method: &MethodDescriptor) -> Connection {
        self.keyed[&requests::scope(method)].clone()
    }
}

/// The answer to a call in which the field at the end of `path` is `name`.
async fn ask(
    two: &TwoTenants,
    method: &MethodDescriptor,
    path: &[FieldDescriptor],
    name: &str,
) -> Answer {
    let request = with(&method.input(), path, &two.own, name);
    call(two.connection(method), method, &request).await
}

#[tokio::test]
async fn a_name_of_another_tenant_is_answered_like_one_that_does_not_exist() {
    let two = two_tenants().await;
    let theirs = &two.theirs;
    let (mut asked, mut faults) = (0, Vec::new());
    for method in methods() {
        for path in leaves(&method.input()) {
            let fields: Vec<&str> = path.iter().map(|it| it.name()).collect();
            let shown = format!("{} {}", method.full_name(), fields.join("."));
            let mut seen = Vec::new();
            for name in theirs.names() {
                let missing = unknown(name);
                let answer = ask(&two, &method, &path, name).await;
                let expected = ask(&two, &method, &path, &missing).await;
                if answer.without(name) != expected.without(&missing) {
                    faults.push(format!("{shown} tells whether {name} exists: {answer:?}"));
                }
                if answer.code == Code::Ok && !is_report(&path) {
                    faults.push(format!("{shown} takes {name}"));
                }
                seen.push(answer);
                asked += 1;
            }
            let mut missing = seen.iter().filter(|it| it.code == Code::NotFound);
            let names = |it: &Answer| {
                theirs
                    .names()
                    .any(|name| it.message.contains(requests::id(name)))
            };
            let named = missing.any(names);
            if !named && !is_report(&path) {
                let answers: BTreeSet<&str> = seen.iter().map(|it| &*it.message).collect();
                faults.push(format!(
                    "{shown} is not looked up: give `requests` what such a request needs beside it, or \
                     list the field as one that holds no name: {answers:?}"
                ));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(asked > 200, "only {asked} calls");
}

#[tokio::test]
async fn no_answer_holds_an_id_of_another_tenant() {
    let two = two_tenants().await;
    let (theirs, own) = (&two.theirs, &two.own);
    let mut listed = 0;
    for method in methods() {
        let request = DynamicMessage::new(method.input());
        let answer = call(two.connection(&method), &method, &request).await;
        for name in theirs.names() {
            let id = requests::id(name);
            assert!(!answer.holds(id), "{} shows {name}", method.full_name());
        }
        let has = |name: &str| answer.holds(requests::id(name));
        listed += usize::from(own.names().any(has));
    }
    assert!(listed >= 4, "people, models, jobs and workers: {listed}");
}

#[tokio::test]
async fn request_ids_and_pauses_are_a_tenants_own() {
    let mut service = Service::start().await;
    let create = |display_name: &str| CreateSubjectRequest {
        display_name: display_name.into(),
        request_id: "same".into(),
        ..CreateSubjectRequest::default()
    };
    let first = service.subjects().create_subject(create("Ada")).await;
    let first = first.expect("creates").into_inner();
    let other = connect(&service, "other");
    let default = mem::replace(&mut service.channel, other);
    let second = service.subjects().create_subject(create("Bob")).await;
    let second = second.expect("is no repetition").into_inner();
    assert_ne!(first.name, second.name);
    let listed = service
        .subjects()
        .list_subjects(ListSubjectsRequest::default())
        .await;
    let listed = listed.expect("lists").into_inner().subjects;
    assert_eq!(listed, [second]);

    let pause = PauseJobsRequest {
        kind: JobKind::Ingest.into(),
        reason: "theirs".into(),
    };
    service.jobs().pause_jobs(pause).await.expect("pauses");
    service.channel = default;
    service.upload_good(&first.name).await;
    let worker = service.worker(&["ingest"]).await;
    assert!(service.lease(&worker).await.is_some(), "is not paused");
}

#[tokio::test]
async fn nobody_stops_the_writer_of_anothers_upload() {
    let service = Service::start().await;
    let ada = service.subject("Ada").await;
    let files = [file("poses.json", b"{}"), file("a", b"0123456789")];
    let upload = service.open_upload(&ada.name, &files).await;
    let upload = upload.expect("is opened").name;
    let (sender, receiver) = tokio::sync::mpsc::channel(1);
    let chunks = tokio_stream::wrappers::ReceiverStream::new(receiver);
    let mut uploads = service.uploads();
    let writing = tokio::spawn(async move { uploads.write_upload(chunks).await });
    let mut messages = chunks_of(&upload, &files).into_iter();
    let first = messages.next().expect("a chunk");
    sender.send(first).await.expect("is received");

    let mut other = UploadServiceClient::new(connect(&service, "other"));
    let stop = GetUploadRequest {
        name: upload.clone(),
        stop_writer: true,
    };
    let stopped = other.get_upload(stop).await.expect_err("is another's");
    assert_eq!(stopped.code(), Code::NotFound);
    let finish = FinishUploadRequest {
        name: upload.clone(),
        request_id: String::new(),
    };
    let finished = other.finish_upload(finish).await;
    assert_eq!(finished.expect_err("is another's").code(), Code::NotFound);
    let mut theirs = chunks_of(&upload, &files);
    theirs.truncate(1);
    let written = other.write_upload(futures::stream::iter(theirs)).await;
    assert_eq!(written.expect_err("is another's").code(), Code::NotFound);

    for message in messages {
        sender.send(message).await.expect("is received");
    }
    drop(sender);
    let written = writing.await.expect("no panic").expect("goes on");
    assert_eq!(written.into_inner().committed_bytes, 12);
}

#[tokio::test]
async fn a_worker_runs_the_jobs_of_its_tenant() {
    let mut service = Service::start().await;
    let ada = service.subject("Ada").await;
    service.upload_good(&ada.name).await;
    let own = service.worker(&["ingest"]).await;
    let other = connect(&service, "other");
    let default = mem::replace(&mut service.channel, other);
    let theirs = service.worker(&["ingest"]).await;
    assert!(service.lease(&theirs).await.is_none());
    service.channel = default;
    let lease = service.lease(&own).await.expect("the ingest job waits");
    let claim = crate::support::claim(&lease);
    // The token alone is not enough.
    service.channel = connect(&service, "other");
    let beat = yoto_proto::worker::v1::HeartbeatRequest {
        claim: Some(claim),
        progress: None,
    };
    let refused = service.workers().heartbeat(beat).await;
    assert_eq!(refused.expect_err("is another's").code(), Code::NotFound);
}
