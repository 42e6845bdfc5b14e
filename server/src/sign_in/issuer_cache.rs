//! The issuer as it was found last. Everybody can ask for a sign-in, so not each one asks the issuer.

use super::grants::Claims;
use super::issuer::{Issuer, IssuerError};
use crate::access::cookies::Begun;
use crate::config::OidcConfig;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::{Mutex, Semaphore};

/// Time for which the issuer's description and keys are used.
const FRESH: Duration = Duration::from_secs(60);
/// Codes that are exchanged at the same time; more wait.
const AT_ONCE: usize = 4;

/// The issuer, once it was asked.
#[derive(Debug)]
pub(crate) struct IssuerCache {
    last: Mutex<Option<(Instant, Arc<Issuer>)>>,
    exchanges: Semaphore,
}

impl Default for IssuerCache {
    fn default() -> Self {
        Self {
            last: Mutex::default(),
            exchanges: Semaphore::new(AT_ONCE),
        }
    }
}

impl IssuerCache {
    /// The issuer, as it was at most [`FRESH`] ago. Only one request at a time looks for it.
    ///
    /// # Errors
    /// When it can't be found.
    pub(crate) async fn issuer(&self, config: &OidcConfig) -> Result<Arc<Issuer>, IssuerError> {
        let mut last = self.last.lock().await;
        if let Some((at, issuer)) = &*last
            && at.elapsed() < FRESH
        {
            return Ok(Arc::clone(issuer));
        }
        let issuer = Arc::new(Issuer::find(config).await?);
        *last = Some((Instant::now(), Arc::clone(&issuer)));
        Ok(issuer)
    }

    /// The claims of somebody who has come back with `code`.
    ///
    /// # Errors
    /// When the issuer does not vouch for them, also by the keys that it has now.
    pub(crate) async fn claims(
        &self,
        config: &OidcConfig,
        code: &str,
        begun: &Begun,
    ) -> Result<Claims, IssuerError> {
        let issuer = self.issuer(config).await?;
        let turn = self.exchanges.acquire().await;
        let token = issuer.token(code, begun).await?;
        drop(turn);
        match issuer.claims(&token, begun) {
            // The issuer may sign with a new key since it was asked.
            Err(IssuerError::Token(_)) => {
                *self.last.lock().await = None;
                self.issuer(config).await?.claims(&token, begun)
            }
            claims => claims,
        }
    }
}
