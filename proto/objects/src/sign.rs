//! URLs with which others read one object of a remote store, without its credentials.

use super::{Objects, ObjectsError, parse};
use object_store::path::Path as Key;
use object_store::signer::{Method, Signer};
use std::sync::Arc;
use std::time::Duration;
use url::Url;

/// What signs the URLs of a store.
#[derive(Debug, Clone)]
pub(crate) struct Signing {
    signer: Arc<dyn Signer>,
    /// Where the store's objects are in the bucket.
    prefix: Key,
}

impl Signing {
    pub(crate) fn new(signer: Arc<dyn Signer>, prefix: Key) -> Self {
        Self { signer, prefix }
    }
}

impl Objects {
    /// A URL with which anyone can read the object at `key` by GET, in whole or in ranges, for `life`; `None` where the store
    /// signs none. It is a secret. Whether the object exists is not looked at.
    ///
    /// # Errors
    /// When the key is malformed, or the store's credentials can't be had.
    pub async fn url_to_read(
        &self,
        key: &str,
        life: Duration,
    ) -> Result<Option<Url>, ObjectsError> {
        let Some(Signing { signer, prefix }) = &self.signing else {
            return Ok(None);
        };
        let path = parse(key)?;
        let path: Key = prefix.parts().chain(path.parts()).collect();
        let signed = self.attempt("signing a URL of", key, || {
            signer.signed_url(Method::GET, &path, life)
        });
        signed.await.map(Some)
    }
}
