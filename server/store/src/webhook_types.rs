//! Webhooks in the interface of the store. Their secrets are in it, so nothing here can be printed.

use crate::Tenant;
use yoto_proto::v1::Job;

/// An address that is added.
#[derive(Clone)]
pub struct NewWebhook {
    /// Where it is.
    pub url: String,
    /// What its requests are signed with.
    pub secret: String,
    /// What it is for.
    pub note: String,
}

/// An address that is to be told something now.
#[derive(Debug, Clone)]
pub struct DueWebhook {
    /// Its id.
    pub id: String,
    /// Whose it is.
    pub tenant: Tenant,
}

/// The end of a job that an address is to be told now.
#[derive(Clone)]
pub struct DueDelivery {
    /// Its id, the same for all attempts.
    pub id: String,
    /// Id of the webhook.
    pub webhook_id: String,
    /// Where it is.
    pub url: String,
    /// What the request is signed with.
    pub secret: String,
    /// Number of attempts, with this one.
    pub attempts: u32,
    /// The time of this attempt, seconds since 1970.
    pub time: f64,
    /// The job.
    pub job: Job,
}
