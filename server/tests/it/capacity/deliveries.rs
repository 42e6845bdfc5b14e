//! Deliveries of webhooks.

use crate::support::{Service, eventually};
use crate::webhooks::Receiver;
use std::time::{Duration, Instant};
use tokio::net::TcpListener;
use tonic::transport::Channel;
use yoto_proto::v1::CreateWebhookRequest;
use yoto_proto::v1::webhook_service_client::WebhookServiceClient;
use yoto_server::{Admission, Tenant, in_memory};

/// Deliveries of the greedy tenant: more than there can be at once, whose receivers answer after the longest time of an attempt.
const JOBS: usize = 40;
const RECEIVERS: usize = 8;

fn of_tenant(service: &Service, tenant: &str) -> Channel {
    let (connector, incoming) = in_memory();
    let tenant = Tenant::new(tenant).expect("a tenant");
    let serving = (service.coordinator).serve_to(
        Admission::Process(tenant),
        incoming,
        std::future::pending(),
    );
    tokio::spawn(serving);
    connector.channel()
}

async fn add(channel: &Channel, url: &str) {
    let request = CreateWebhookRequest {
        url: url.into(),
        ..CreateWebhookRequest::default()
    };
    let mut webhooks = WebhookServiceClient::new(channel.clone());
    webhooks.create_webhook(request).await.expect("is added");
}

#[tokio::test]
async fn receivers_that_do_not_answer_hold_up_no_other_tenant() {
    let mut service = Service::start_with(|config| config.private_webhooks = true).await;
    let own = service.channel.clone();
    service.channel = of_tenant(&service, "greedy");
    let mut silent = Vec::new();
    for _ in 0..RECEIVERS {
        // Connections wait to be accepted.
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
        let address = listener.local_addr().expect("is bound");
        add(&service.channel, &format!("http://{address}/hook")).await;
        silent.push(listener);
    }
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    for _ in 0..JOBS {
        let job = service.train(&model).await;
        crate::webhooks::cancel(&service, &job.name).await;
    }
    // All that may begin have begun.
    tokio::time::sleep(Duration::from_secs(2)).await;

    service.channel = own;
    let fast = Receiver::start(&["204 No Content"]).await;
    add(&service.channel, &fast.url).await;
    let begun = Instant::now();
    crate::webhooks::ended_job(&service, "other").await;
    eventually("the other tenant is told", || async {
        (!fast.all().is_empty()).then_some(())
    })
    .await;
    let waited = begun.elapsed();
    assert!(
        waited < Duration::from_secs(10),
        "less than an attempt: {waited:?}"
    );
}
