//! Links to pages: who has one sees the page without a key, until it ends, and nobody else sees anything.

use crate::support::{
    SCOPES, Service, ask, ask_with, assert_invalid, assert_refused, id, job_name, listen, listen_as,
};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tonic::{Code, Status};
use yoto_proto::keys;
use yoto_proto::v1::share::State;
use yoto_proto::v1::share_service_client::ShareServiceClient;
use yoto_proto::v1::{
    ConsentPurpose, CreateShareRequest, CreateShareResponse, DeleteJobRequest, ExportForm,
    ExportResult, ExportSpec, ExportedFile, GrantConsentRequest, ListJobsRequest,
    ListSharesRequest, RevokeConsentRequest, RevokeShareRequest, Share, Subject, job_result,
    job_spec,
};
use yoto_server::Admission;
use yoto_server::clock::ManualClock;

const START: f64 = 1e9;
/// What the exported page says.
const PAGE: &str = "<!doctype html><title>Ada</title>";

/// Bytes of a page that does not fit into the buffers between service and client.
const LARGE: usize = 16 << 20;

/// A service with an export of Ada's page.
struct Exported {
    service: Service,
    clock: Arc<ManualClock>,
    ada: Subject,
    job: String,
}

impl Exported {
    async fn new(required: bool) -> Self {
        Self::with_page(required, PAGE.as_bytes()).await
    }

    async fn with_page(required: bool, page: &[u8]) -> Self {
        let clock = Arc::new(ManualClock::at(START));
        let own = Arc::clone(&clock);
        let dir = TempDir::new().expect("a folder");
        let service = Service::start_in(dir, move |config| {
            config.clock = own;
            config.require_consent = required;
        });
        let service = service.await;
        let ada = service.ready_subject("Ada").await;
        if required {
            for purpose in [ConsentPurpose::ConsentTrain, ConsentPurpose::ConsentExport] {
                agree(&service, &ada, purpose).await;
            }
        }
        let model = service.model_of(&ada).await;
        let worker = service.worker(&["train", "export"]).await;
        let (_, checkpoint) = service.train_to(&model, &worker, 40).await;
        let spec = ExportSpec {
            model: model.name,
            subject: ada.name.clone(),
            form: ExportForm::Page.into(),
            ..ExportSpec::default()
        };
        let job = service.create_job(job_spec::Kind::Export(spec)).await;
        let job = job.expect("is queued").name;
        let lease = service.lease(&worker).await.expect("the export waits");
        assert_eq!(job_name(&lease), job);
        let key = keys::render(id(&job), lease.token, "ada.html");
        let page = ExportedFile {
            file: "ada.html".into(),
            object: Some(service.put(&key, page).await),
            content_type: "text/html; charset=utf-8".into(),
        };
        let result = ExportResult {
            files: vec![page],
            checkpoint: checkpoint.name,
            splats: 1,
            ..ExportResult::default()
        };
        let completed = service.complete(&lease, job_result::Kind::Export(result));
        completed.await.expect("completes");
        Self {
            service,
            clock,
            ada,
            job,
        }
    }

    async fn share(&self, seconds: Option<f64>) -> Result<CreateShareResponse, Status> {
        let request = CreateShareRequest {
            job: self.job.clone(),
            note: "for Bob".into(),
            embed: false,
            expire_time: seconds.map(|it| prost_types::Timestamp {
                seconds: (START + it) as i64,
                nanos: 0,
            }),
        };
        let made = shares(&self.service).create_share(request).await;
        made.map(tonic::Response::into_inner)
    }

    async fn listed(&self) -> Vec<Share> {
        let request = ListSharesRequest {
            subject: self.ada.name.clone(),
            ..ListSharesRequest::default()
        };
        let listed = shares(&self.service).list_shares(request).await;
        listed.expect("lists").into_inner().shares
    }

    async fn revoke_consent(&self) {
        let request = RevokeConsentRequest {
            subject: self.ada.name.clone(),
            purposes: vec![ConsentPurpose::ConsentShare.into()],
            ..RevokeConsentRequest::default()
        };
        let revoked = self.service.subjects().revoke_consent(request).await;
        revoked.expect("is revoked");
    }
}

fn shares(service: &Service) -> ShareServiceClient<tonic::transport::Channel> {
    ShareServiceClient::new(service.connector.channel())
}

async fn agree(service: &Service, person: &Subject, purpose: ConsentPurpose) {
    let request = GrantConsentRequest {
        subject: person.name.clone(),
        purposes: vec![purpose.into()],
        ..GrantConsentRequest::default()
    };
    let granted = service.subjects().grant_consent(request).await;
    granted.expect("is recorded");
}

/// The answer is the same whatever is wrong with a link.
async fn assert_shows_nothing(address: SocketAddr, path: &str, why: &str) {
    let (status, head, body) = ask(address, "GET", path).await;
    assert_eq!(status, 404, "{why}: {body}");
    let never = format!("/share/{}", "0".repeat(64));
    let (_, other, words) = ask(address, "GET", &never).await;
    assert_eq!(body, words, "{why}");
    let undated = |head: &str| {
        let lines = head.lines().filter(|it| !it.starts_with("date:"));
        lines.map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(undated(&head), undated(&other), "{why}");
}

#[tokio::test]
async fn a_page_that_is_being_sent_ends_with_its_link() {
    let it = Exported::with_page(false, &vec![b' '; LARGE]).await;
    let (address, _serving) = listen(&it.service).await;
    for by_consent in [false, true] {
        let made = it.share(None).await.expect("is made");
        let mut connection = TcpStream::connect(address).await.expect("connects");
        let request = format!("GET {} HTTP/1.1\r\nHost: {address}\r\n\r\n", made.path);
        connection
            .write_all(request.as_bytes())
            .await
            .expect("writes");
        let mut first = vec![0; 64 << 10];
        connection.read_exact(&mut first).await.expect("begins");
        match by_consent {
            true => it.revoke_consent().await,
            false => {
                let name = made.share.expect("a link").name;
                let request = RevokeShareRequest { name };
                let revoked = shares(&it.service).revoke_share(request).await;
                revoked.expect("is revoked");
            }
        }
        // The buffers of both sides are full by now, and the link is looked at again.
        tokio::time::sleep(Duration::from_secs(1)).await;
        let mut rest = Vec::new();
        let read = tokio::time::timeout(Duration::from_secs(20), connection.read_to_end(&mut rest));
        let _ = read.await.expect("ends");
        let got = first.len() + rest.len();
        assert!(got < LARGE, "{got} of {LARGE} bytes");
    }
}

#[tokio::test]
async fn whoever_has_a_link_sees_the_page_without_a_key_until_it_is_revoked() {
    let it = Exported::new(false).await;
    let made = it.share(None).await.expect("is made");
    // From the first key on, nobody is answered without one.
    it.service.key("default", &SCOPES[..1]).await;
    let (address, serving) = listen_as(&it.service, Admission::Anyone).await;
    let (status, _, _) = ask(address, "GET", "/people").await;
    assert_eq!(status, 401);
    let (status, head, body) = ask(address, "GET", &made.path).await;
    assert_eq!((status, body.as_str()), (200, PAGE));
    for line in [
        "content-type: text/html; charset=utf-8",
        "cache-control: no-store",
        "referrer-policy: no-referrer",
        "x-content-type-options: nosniff",
    ] {
        assert!(head.contains(line), "{line}: {head}");
    }
    let policy = head
        .lines()
        .find(|it| it.starts_with("content-security-policy:"));
    let policy = policy.expect("a policy");
    assert!(
        policy.contains("sandbox allow-scripts; default-src 'none'")
            && policy.contains("frame-ancestors 'none'")
            && !policy.contains("allow-same-origin"),
        "{policy}"
    );
    assert!(!head.contains("access-control-allow-origin"), "{head}");
    let share = made.share.expect("a link");
    assert_eq!(it.listed().await, std::slice::from_ref(&share));
    assert_eq!(
        (share.state(), share.note.as_str()),
        (State::Valid, "for Bob")
    );

    let request = RevokeShareRequest { name: share.name };
    for _ in 0..2 {
        let revoked = shares(&it.service).revoke_share(request.clone()).await;
        let revoked = revoked.expect("is revoked").into_inner();
        assert_eq!(revoked.state(), State::Revoked);
        assert!(revoked.revoke_time.is_some());
    }
    assert_shows_nothing(address, &made.path, "revoked").await;
    assert_shows_nothing(address, "/share/x", "no secret").await;
    let (status, head, script) = ask(address, "GET", "/assets/yoto-avatar.js").await;
    assert!(
        status == 200 && script.contains("customElements.define(\"yoto-avatar\""),
        "{script}"
    );
    assert!(
        head.contains("cross-origin-resource-policy: cross-origin"),
        "{head}"
    );
    serving.abort();
}

#[tokio::test]
async fn a_link_ends_at_its_time_and_with_its_export() {
    let it = Exported::new(false).await;
    let short = it.share(Some(60.0)).await.expect("is made");
    let long = it.share(None).await.expect("is made");
    assert_ne!(short.path, long.path);
    let (address, serving) = listen(&it.service).await;
    assert_eq!(ask(address, "GET", &short.path).await.0, 200);
    it.clock.advance(61.0);
    assert_shows_nothing(address, &short.path, "expired").await;
    let states: Vec<State> = it.listed().await.iter().map(Share::state).collect();
    assert_eq!(states, [State::Valid, State::Expired]);
    assert_eq!(ask(address, "GET", &long.path).await.0, 200);
    let request = DeleteJobRequest {
        name: it.job.clone(),
        ..DeleteJobRequest::default()
    };
    it.service
        .jobs()
        .delete_job(request)
        .await
        .expect("deletes");
    assert_shows_nothing(address, &long.path, "deleted").await;
    assert_eq!(it.listed().await, []);
    serving.abort();
}

#[tokio::test]
async fn a_link_shows_somebody_as_long_as_they_agree() {
    let it = Exported::new(false).await;
    let made = it.share(None).await.expect("is made");
    let (address, serving) = listen(&it.service).await;
    it.revoke_consent().await;
    assert_shows_nothing(address, &made.path, "without consent").await;
    assert_eq!(it.listed().await[0].state(), State::WithoutConsent);
    assert_refused(
        it.share(None).await.map(drop),
        Code::FailedPrecondition,
        "CONSENT",
    );
    agree(&it.service, &it.ada, ConsentPurpose::ConsentShare).await;
    assert_eq!(ask(address, "GET", &made.path).await.0, 200);
    serving.abort();
}

#[tokio::test]
async fn a_service_that_asks_for_consent_makes_no_link_without_it() {
    let it = Exported::new(true).await;
    let refused = it.share(None).await.map(drop);
    let said = refused.as_ref().expect_err("is refused").message();
    assert!(said.contains("Ada") && said.contains("share"), "{said}");
    assert_refused(refused, Code::FailedPrecondition, "CONSENT");
    agree(&it.service, &it.ada, ConsentPurpose::ConsentShare).await;
    let made = it.share(None).await.expect("is made");
    let (address, serving) = listen(&it.service).await;
    assert_eq!(ask(address, "GET", &made.path).await.0, 200);
    serving.abort();
}

#[tokio::test]
async fn a_link_needs_an_export_with_a_page() {
    let it = Exported::new(false).await;
    let ask = async |job: &str| {
        let request = CreateShareRequest {
            job: job.to_owned(),
            ..CreateShareRequest::default()
        };
        shares(&it.service).create_share(request).await.map(drop)
    };
    assert_invalid(ask("ada").await, "job");
    assert_refused(ask("jobs/none").await, Code::NotFound, "NOT_FOUND");
    let running = it
        .service
        .jobs()
        .list_jobs(ListJobsRequest::default())
        .await;
    let running = running.expect("lists").into_inner().jobs;
    let training = running
        .iter()
        .find(|job| job.name != it.job && job.result.is_none());
    let training = &training.expect("a training").name;
    assert_refused(
        ask(training).await,
        Code::FailedPrecondition,
        "NOT_SUCCEEDED",
    );
    let request = CreateShareRequest {
        job: it.job.clone(),
        note: "two\nlines".into(),
        ..CreateShareRequest::default()
    };
    let made = shares(&it.service).create_share(request).await;
    assert_invalid(made.map(drop), "note");
}

#[tokio::test]
async fn the_page_of_an_export_makes_links_and_revokes_them() {
    use crate::dashboard::forms::{FORM, field_in, token};
    let it = Exported::new(false).await;
    let (address, serving) = listen(&it.service).await;
    let page = format!("/{}", it.job);
    let token = token(address, &page).await;
    let send = async |path: &str, body: &str| {
        let headers = format!("{FORM}Origin: https://people.example\r\n");
        ask_with(address, "POST", path, &headers, body).await
    };
    let create = format!("{page}/share");
    assert_eq!(send(&create, "days=30").await.0, 403, "without the token");
    let (status, _, _) = send(&create, &format!("token={token}&days=31")).await;
    assert_eq!(status, 400, "no choice of the form");
    let made = format!("token={token}&days=30&note=%3Cb%3EBob&embed=yes");
    let (status, _, shown) = send(&create, &made).await;
    assert_eq!(status, 200, "{shown}");
    let path = shown.split("href=\"/share/").nth(1).expect("a link");
    let path = format!("/share/{}", path.split('"').next().unwrap_or_default());
    assert!(
        shown.contains(&format!("https://people.example{path}")),
        "{shown}"
    );
    assert!(
        shown.contains("aria-label=\"The link as a QR code\"><svg"),
        "{shown}"
    );
    let (status, head, body) = ask(address, "GET", &path).await;
    assert_eq!((status, body.as_str()), (200, PAGE));
    assert!(
        head.contains("frame-ancestors *") && head.contains("access-control-allow-origin: *"),
        "{head}"
    );

    let (_, _, listed) = ask(address, "GET", &page).await;
    assert!(
        listed.contains("&lt;b&gt;Bob") && !listed.contains("<b>Bob"),
        "{listed}"
    );
    assert!(!listed.contains(&path), "the secret is shown once");
    assert!(!field_in(&listed, "token").is_empty());
    let share = it.listed().await.remove(0);
    let revoke = format!("/{}/revoke", share.name);
    let (status, head, _) = send(&revoke, &format!("token={token}")).await;
    assert!(
        status == 303 && head.contains(&format!("location: {page}")),
        "{head}"
    );
    assert_shows_nothing(address, &path, "revoked").await;
    serving.abort();
}
