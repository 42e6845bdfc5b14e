//! What the dashboard shows or does that is no call.

use crate::context::Context;
use crate::sign_in;
use axum::response::Response;
use std::sync::Arc;
use std::time::Duration;
use tonic::Status;
use yoto_dashboard::Backend;
use yoto_process::metrics::METRICS;
use yoto_proto::v1::Key;
use yoto_request::RequestError;

/// The coordinator behind the pages.
pub(crate) struct Coordinated(pub Arc<Context>);

#[tonic::async_trait]
impl Backend for Coordinated {
    fn store_id(&self) -> &str {
        &self.0.storage.id
    }

    fn now(&self) -> f64 {
        self.0.config.clock.now()
    }

    fn health_faults(&self) -> Vec<&'static str> {
        self.0.health.found().faults()
    }

    fn last_collected(&self) -> Option<f64> {
        METRICS.last_collected()
    }

    fn grace(&self) -> Duration {
        self.0.config.storage.grace
    }

    async fn key(&self, id: &str) -> Result<Key, Status> {
        let key = self.0.store.key(id).await;
        Ok(key.map_err(RequestError::from)?)
    }

    async fn sign_out(&self, key: &str) -> Result<(), Status> {
        Ok(sign_in::sign_out(&self.0, key).await?)
    }

    fn signed_out(&self) -> Response {
        sign_in::signed_out()
    }
}
