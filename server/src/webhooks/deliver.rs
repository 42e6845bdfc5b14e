//! One request to one address.

use super::address::{AddressError, check_url, resolved};
use super::signature::sign;
use crate::api::public_job;
use crate::outgoing;
use reqwest::header::CONTENT_TYPE;
use reqwest::{Client, redirect};
use rustls::ClientConfig;
use serde_json::{Value, json};
use std::time::Duration;
use thiserror::Error;
use yoto_http::transcoding::json_of;
use yoto_store::DueDelivery;

/// Longest time of the search for the host, and of the request.
const LONGEST: Duration = Duration::from_secs(15);

/// Why an address was told nothing.
#[derive(Debug, Error)]
pub(super) enum SendError {
    #[error(transparent)]
    Address(#[from] AddressError),
    #[error("{}", causes(.0))]
    Http(#[from] reqwest::Error),
    #[error("it has answered {0}")]
    Status(reqwest::StatusCode),
    #[error("its host's addresses are not told in time")]
    Slow,
    #[error("TLS: {0}")]
    Tls(#[from] rustls::Error),
    #[error("the row of the webhook is invalid: its secret can't sign")]
    Secret,
}

/// An error with what has caused it, and without the address, which may have a secret in it.
fn causes(error: &reqwest::Error) -> String {
    let first: &dyn std::error::Error = error;
    let causes = std::iter::successors(first.source(), |it| it.source());
    let words: Vec<String> = causes.map(ToString::to_string).collect();
    match words.as_slice() {
        [] if error.is_timeout() => "it does not answer in time".to_owned(),
        [] => "the request has failed".to_owned(),
        words => words.join(": "),
    }
}

/// Sends requests.
pub(super) struct Sender {
    private: bool,
    tls: ClientConfig,
}

impl Sender {
    /// `private` allows addresses of this machine and of private networks, and HTTP without TLS.
    ///
    /// # Errors
    /// When TLS can't be used.
    pub(super) fn new(private: bool) -> Result<Self, SendError> {
        Ok(Self {
            private,
            tls: outgoing::tls()?,
        })
    }

    /// Makes one attempt.
    ///
    /// # Errors
    /// When the address is not allowed, can't be reached, or answers with another status than 2xx.
    pub(super) async fn send(&self, delivery: &DueDelivery) -> Result<(), SendError> {
        // The operator may have allowed more when it was added.
        let url = check_url(&delivery.url, self.private)?;
        let found = tokio::time::timeout(LONGEST, resolved(&url, self.private)).await;
        let addresses = found.map_err(|_| SendError::Slow)??;
        let body = body(delivery);
        let seconds = delivery.time as u64;
        let signature = sign(&delivery.secret, &delivery.id, seconds, &body);
        let signature = signature.ok_or(SendError::Secret)?;
        // The request goes to the addresses that were checked, whatever the name leads to meanwhile.
        let client = Client::builder()
            .tls_backend_preconfigured(self.tls.clone())
            .redirect(redirect::Policy::none())
            .no_proxy()
            .timeout(LONGEST)
            .resolve_to_addrs(url.host_str().unwrap_or_default(), &addresses)
            .build()?;
        let request = client
            .post(url)
            .header(CONTENT_TYPE, "application/json")
            .header("webhook-id", &delivery.id)
            .header("webhook-timestamp", seconds.to_string())
            .header("webhook-signature", signature)
            .body(body);
        let answer = request.send().await.map_err(reqwest::Error::without_url)?;
        match answer.status().is_success() {
            true => Ok(()),
            false => Err(SendError::Status(answer.status())),
        }
    }
}

/// What is told: the job as `GET /v1/jobs/{id}` tells it.
fn body(delivery: &DueDelivery) -> String {
    let time = delivery.job.end_time.as_ref().map(ToString::to_string);
    json!({
        "type": "job.ended",
        "timestamp": time,
        "data": json_of(&public_job(delivery.job.clone())).unwrap_or(Value::Null),
    })
    .to_string()
}
