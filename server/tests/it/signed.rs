//! Files that clients read from the object store by signed URLs.

use crate::support::{Service, assert_refused, id};
use std::path::PathBuf;
use std::time::Duration;
use tonic::Code;
use url::Url;
use yoto_client::YotoClient;
use yoto_proto::v1::{
    NamedObject, RenderResult, RenderedFile, SignDownloadRequest, SignDownloadResponse, Unsigned,
    job_result,
};
use yoto_proto::{keys, names};
use yoto_server::ServerConfig;
use yoto_test_s3::{BUCKET, S3Fault, Server};

/// Long enough for a file that is worth a URL.
const BYTES: u32 = 300_000;
const LIFE: Duration = Duration::from_secs(900);

/// A service on S3 with a rendered file.
struct Stage {
    server: Server,
    service: Service,
    picture: NamedObject,
    content: Vec<u8>,
    /// Where the store has it.
    path: PathBuf,
}

impl Stage {
    async fn start(change: impl FnOnce(&mut ServerConfig)) -> Self {
        let server = Server::start();
        let environment = server.environment();
        let service = Service::start_with(|config| {
            config.objects = Some(Url::parse(&format!("s3://{BUCKET}/yoto")).expect("a URL"));
            config.environment = environment.into();
            config.signed_urls = Some(LIFE);
            change(config);
        });
        Self::of(service.await, server).await
    }

    async fn of(service: Service, server: Server) -> Self {
        let trained = service.trained().await;
        let job = service.render(&trained.model, &trained.subject, "").await;
        let lease = service.lease(&trained.worker).await.expect("it waits");
        let content: Vec<u8> = (0..BYTES).map(|n| (n % 251) as u8).collect();
        let key = keys::render(id(&job.name), lease.token, "000000.png");
        let object = service.put(&key, &content).await;
        let files = vec![RenderedFile {
            file: "000000.png".into(),
            object: Some(object),
        }];
        let result = RenderResult {
            files,
            ..<_>::default()
        };
        let done = service.complete(&lease, job_result::Kind::Render(result));
        done.await.expect("completes");
        let client = YotoClient::new(service.channel.clone());
        let listed = client.list_objects(&job.name).await.expect("lists");
        Self {
            path: server.folder().join("yoto").join(key),
            picture: listed[0].clone(),
            server,
            service,
            content,
        }
    }

    /// A client that takes files without TLS, as it takes the service.
    fn client(&self) -> YotoClient {
        YotoClient::new(self.service.channel.clone()).with_clear_store()
    }

    async fn sign(&self) -> SignDownloadResponse {
        let request = SignDownloadRequest {
            name: self.picture.name.clone(),
        };
        let signed = self.service.objects().sign_download(request).await;
        signed.expect("answers").into_inner()
    }

    async fn fetch(&self, client: &YotoClient) -> Vec<u8> {
        client.object(&self.picture).await.expect("arrives")
    }
}

#[tokio::test]
async fn a_file_comes_from_the_store_itself() {
    let stage = Stage::start(|_| {}).await;
    let answer = stage.sign().await;
    assert!(answer.url.contains("X-Amz-Expires=900"));
    assert!(answer.expire_time.is_some());
    let client = stage.client();
    let signed = stage.server.signed();
    assert_eq!(stage.fetch(&client).await, stage.content);
    assert_eq!(stage.server.signed(), signed + 1, "by its URL");
    // The second file has the first one's connection.
    let dir = tempfile::tempdir().expect("a folder");
    let mut counted = 0;
    let count = &mut |bytes| counted += bytes;
    let fetched = client.fetch_object(&stage.picture, dir.path(), count).await;
    let written = std::fs::read(fetched.expect("arrives")).expect("reads");
    assert_eq!((written, counted), (stage.content, u64::from(BYTES)));
    assert_eq!(stage.server.signed(), signed + 2);
}

#[tokio::test]
async fn without_tls_it_comes_to_no_client_that_has_tls_to_the_service() {
    let stage = Stage::start(|_| {}).await;
    let client = YotoClient::new(stage.service.channel.clone());
    assert_eq!(stage.fetch(&client).await, stage.content);
    assert_eq!(stage.server.signed(), 0);
}

#[tokio::test]
async fn a_url_that_has_ended_is_refused_and_the_service_sends_the_file() {
    let stage = Stage::start(|config| config.signed_urls = Some(Duration::ZERO)).await;
    let client = stage.client();
    assert_eq!(stage.fetch(&client).await, stage.content);
    assert_eq!(stage.server.signed(), 1);
    assert_eq!(stage.fetch(&client).await, stage.content);
    assert_eq!(stage.server.signed(), 1, "it is not tried again");
}

#[tokio::test]
async fn a_store_out_of_reach_is_tried_once() {
    let stage = Stage::start(|_| {}).await;
    stage.server.fail(S3Fault::NoSigned);
    let client = stage.client();
    for _ in 0..2 {
        assert_eq!(stage.fetch(&client).await, stage.content);
        assert_eq!(stage.server.signed(), 1);
    }
}

#[tokio::test]
async fn a_connection_that_breaks_is_not_the_end() {
    let stage = Stage::start(|_| {}).await;
    stage.server.fail(S3Fault::CutAnswers);
    let client = stage.client();
    // One of two requests is cut.
    for _ in 0..2 {
        assert_eq!(stage.fetch(&client).await, stage.content);
    }
    assert!(stage.server.signed() > 1);
}

#[tokio::test]
async fn without_signed_urls_the_service_sends_the_file_and_says_why() {
    let stage = Stage::start(|config| config.signed_urls = None).await;
    let answer = stage.sign().await;
    assert_eq!(
        (answer.url.as_str(), answer.unsigned()),
        ("", Unsigned::TurnedOff)
    );
    assert_eq!(stage.fetch(&stage.client()).await, stage.content);
    assert_eq!(stage.server.signed(), 0);
}

#[tokio::test]
async fn a_folder_signs_nothing() {
    let service = Service::start_with(|config| {
        config.objects = None;
        config.signed_urls = Some(LIFE);
    });
    let stage = Stage::of(service.await, Server::start()).await;
    assert_eq!(stage.sign().await.unsigned(), Unsigned::NotSupported);
    assert_eq!(stage.fetch(&stage.client()).await, stage.content);
}

#[tokio::test]
async fn an_altered_object_is_told_as_the_service_tells_it() {
    let stage = Stage::start(|_| {}).await;
    let mut altered = stage.content.clone();
    altered[200_000] ^= 1;
    std::fs::write(&stage.path, &altered).expect("writes");
    let dir = tempfile::tempdir().expect("a folder");
    let client = stage.client();
    for _ in 0..2 {
        let failed = client
            .fetch_object(&stage.picture, dir.path(), &mut |_| ())
            .await;
        let failed = failed.expect_err("is altered").to_string();
        assert!(failed.contains("OBJECT_ALTERED"), "{failed}");
        assert_eq!(stage.server.signed(), 1, "the store is tried once");
    }
    let left = std::fs::read_dir(dir.path()).expect("lists").count();
    assert_eq!(left, 0, "nothing of it stays");
}

#[tokio::test]
async fn there_is_no_url_of_what_another_tenant_has_or_nobody() {
    let stage = Stage::start(|_| {}).await;
    let unknown = names::object("jobs/00000000-0000-4000-8000-000000000000", "000000.png");
    let other = stage.picture.name.replace("000000.png", "000001.png");
    for name in [unknown, other] {
        let request = SignDownloadRequest { name };
        let refused = stage.service.objects().sign_download(request).await;
        assert_refused(refused, Code::NotFound, "NOT_FOUND");
    }
}
