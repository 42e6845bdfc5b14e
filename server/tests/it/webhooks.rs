//! Addresses that are told when jobs end.

use crate::support::{Service, assert_invalid, eventually, id};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;
use std::sync::{Arc, Mutex};
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::{TcpListener, TcpStream};
use tonic::Status;
use tonic::transport::Channel;
use yoto_proto::v1::webhook_service_client::WebhookServiceClient;
use yoto_proto::v1::{
    CancelJobRequest, CreateWebhookRequest, CreateWebhookResponse, DeleteWebhookRequest,
    ListWebhooksRequest, Webhook,
};

/// A request that a receiver got.
#[derive(Clone, Debug, Default)]
pub(crate) struct Received {
    headers: Vec<(String, String)>,
    body: String,
}

impl Received {
    fn header(&self, name: &str) -> &str {
        let found = self.headers.iter().find(|(it, _)| it == name);
        found.map_or("", |(_, value)| value)
    }
}

/// Somebody who is told of jobs, and answers with `answers` one after the other, then with the last one.
pub(crate) struct Receiver {
    pub(crate) url: String,
    got: Arc<Mutex<Vec<Received>>>,
}

impl Receiver {
    pub(crate) async fn start(answers: &'static [&'static str]) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
        let url = format!(
            "http://{}/hook?of=yoto",
            listener.local_addr().expect("bound")
        );
        let got = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&got);
        tokio::spawn(async move {
            while let Ok((stream, _)) = listener.accept().await {
                let number = kept.lock().expect("unbroken").len();
                let answer = answers[number.min(answers.len() - 1)];
                let request = receive(stream, answer).await;
                kept.lock().expect("unbroken").push(request);
            }
        });
        Self { url, got }
    }

    pub(crate) fn all(&self) -> Vec<Received> {
        self.got.lock().expect("unbroken").clone()
    }

    async fn got(&self, count: usize) -> Vec<Received> {
        let enough = || async { Some(self.all()).filter(|it| it.len() >= count) };
        eventually("enough requests", enough).await
    }
}

async fn receive(stream: TcpStream, answer: &str) -> Received {
    let mut stream = BufReader::new(stream);
    let (mut request, mut line) = (Received::default(), String::new());
    loop {
        line.clear();
        stream.read_line(&mut line).await.expect("reads");
        match line.trim_end().split_once(": ") {
            Some((name, value)) => request
                .headers
                .push((name.to_lowercase(), value.to_owned())),
            None if line.trim_end().is_empty() => break,
            None => assert!(line.starts_with("POST /hook?of=yoto HTTP/1.1"), "{line}"),
        }
    }
    let mut body = vec![0; request.header("content-length").parse().expect("a length")];
    stream.read_exact(&mut body).await.expect("reads");
    request.body = String::from_utf8(body).expect("text");
    let answer = format!(
        "HTTP/1.1 {answer}\r\ncontent-length: 0\r\nconnection: close\r\nlocation: /other\r\n\r\n"
    );
    stream.write_all(answer.as_bytes()).await.expect("writes");
    request
}

fn webhooks(service: &Service) -> WebhookServiceClient<Channel> {
    WebhookServiceClient::new(service.channel.clone())
}

async fn create(service: &Service, url: &str) -> Result<CreateWebhookResponse, Status> {
    let request = CreateWebhookRequest {
        url: url.into(),
        note: "a test".into(),
    };
    let created = webhooks(service).create_webhook(request).await;
    created.map(|it| it.into_inner())
}

async fn only(service: &Service) -> Webhook {
    let listed = webhooks(service)
        .list_webhooks(ListWebhooksRequest {})
        .await;
    let mut listed = listed.expect("lists").into_inner().webhooks;
    assert_eq!(listed.len(), 1);
    listed.remove(0)
}

/// A training that ends before anybody runs it; its name.
pub(crate) async fn ended_job(service: &Service, model: &str) -> String {
    let subject = service.ready_subject(model).await;
    let model = service.model_of(&subject).await;
    let job = service.train(&model).await;
    cancel(service, &job.name).await;
    job.name
}

pub(crate) async fn cancel(service: &Service, name: &str) {
    let request = CancelJobRequest {
        name: name.into(),
        ..CancelJobRequest::default()
    };
    let cancelled = service.jobs().cancel_job(request).await;
    cancelled.expect("is cancelled");
}

#[tokio::test]
async fn the_end_of_a_job_is_told_until_it_is_heard() {
    let receiver =
        Receiver::start(&["500 Internal Server Error", "302 Found", "204 No Content"]).await;
    let service = Service::start_with(|config| config.private_webhooks = true).await;
    let before = ended_job(&service, "before").await;
    let created = create(&service, &receiver.url).await.expect("is added");
    let job = ended_job(&service, "after").await;
    let got = receiver.got(3).await;
    let secret = created.secret.strip_prefix("whsec_").expect("a secret");
    let secret = STANDARD.decode(secret).expect("base64");
    for request in &got {
        let told: Value = serde_json::from_str(&request.body).expect("JSON");
        assert_eq!(told["type"], "job.ended");
        assert!(
            told["timestamp"]
                .as_str()
                .is_some_and(|it| it.ends_with('Z'))
        );
        let data = &told["data"];
        // The ingest of the person who was made for it has ended before.
        assert_ne!(data["name"], before.as_str());
        // Keys of objects are the service's own: one of an ingest job ends so.
        assert!(!request.body.contains("/shard"), "{told}");
        let [id, seconds] = ["webhook-id", "webhook-timestamp"].map(|it| request.header(it));
        let key = ring::hmac::Key::new(ring::hmac::HMAC_SHA256, &secret);
        let signed = ring::hmac::sign(&key, format!("{id}.{seconds}.{}", request.body).as_bytes());
        let expected = format!("v1,{}", STANDARD.encode(signed));
        assert_eq!(request.header("webhook-signature"), expected);
    }
    // Whatever failed comes again under the same id, also a redirection, which is not followed.
    let of_job = |it: &&Received| it.body.contains(&job);
    let enough = || async {
        let all = receiver.all();
        let told: Vec<Received> = all.iter().filter(of_job).cloned().collect();
        let webhook = only(&service).await;
        (!told.is_empty() && webhook.waiting == 0).then_some((told, webhook))
    };
    let (told, webhook) = eventually("everything is told", enough).await;
    let data: Value = serde_json::from_str(&told[0].body).expect("JSON");
    assert_eq!(data["data"]["state"], "CANCELLED");
    assert_eq!(webhook.last_error, "");
    assert!(webhook.last_time.is_some());
    let ids: std::collections::BTreeSet<&str> =
        told.iter().map(|it| it.header("webhook-id")).collect();
    assert_eq!(ids.len(), 1, "one end of the job");
}

#[tokio::test]
async fn a_removed_address_is_told_nothing_and_its_failures_are_listed() {
    let receiver = Receiver::start(&["500 Internal Server Error"]).await;
    let service = Service::start_with(|config| config.private_webhooks = true).await;
    let created = create(&service, &receiver.url).await.expect("is added");
    ended_job(&service, "ada").await;
    let failed = || async {
        let webhook = only(&service).await;
        (!webhook.last_error.is_empty()).then_some(webhook)
    };
    let webhook = eventually("a failure", failed).await;
    assert_eq!(
        webhook.last_error,
        "it has answered 500 Internal Server Error"
    );
    assert!(webhook.waiting > 0);
    let name = created.webhook.expect("a webhook").name;
    let request = DeleteWebhookRequest { name: name.clone() };
    webhooks(&service)
        .delete_webhook(request.clone())
        .await
        .expect("is removed");
    let listed = webhooks(&service)
        .list_webhooks(ListWebhooksRequest {})
        .await;
    assert!(listed.expect("lists").into_inner().webhooks.is_empty());
    let again = webhooks(&service)
        .delete_webhook(request)
        .await
        .expect_err("is gone");
    assert!(again.message().contains(id(&name)), "{again}");
}

#[tokio::test]
async fn addresses_inside_are_refused_unless_they_are_allowed() {
    let service = Service::start().await;
    for url in [
        "https://127.0.0.1/x",
        "https://10.0.0.1/",
        "http://example.org/",
        "nothing",
    ] {
        assert_invalid(create(&service, url).await.map(drop), "url");
    }
    // What a name leads to is looked at with each attempt.
    create(&service, "https://localhost:9/x")
        .await
        .expect("is added");
    ended_job(&service, "ada").await;
    let failed = || async {
        let webhook = only(&service).await;
        (!webhook.last_error.is_empty()).then_some(webhook)
    };
    let webhook = eventually("a refusal", failed).await;
    assert!(
        webhook.last_error.contains("which is of this machine"),
        "{webhook:?}"
    );
}
