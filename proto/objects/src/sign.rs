//! URLs with which others read or write one object of a remote store, without its credentials.

use super::{Objects, ObjectsError, parse};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use object_store::path::Path as Key;
use object_store::signer::{HeaderName, HeaderValue, Method, SignedUrlOptions, Signer};
use std::fmt;
use std::sync::Arc;
use std::time::Duration;
use url::Url;

/// Has the store compare the bytes that arrive, in base64. A store without checksums ignores it.
const CHECKSUM: &str = "x-amz-checksum-sha256";

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

    /// The key in the bucket of the object at `key`.
    fn path(&self, key: &str) -> Result<Key, ObjectsError> {
        let path = parse(key)?;
        Ok(self.prefix.parts().chain(path.parts()).collect())
    }
}

/// A request that writes one object.
#[derive(Clone)]
pub struct SignedPut {
    /// For PUT. A secret.
    pub url: Url,
    /// Headers that the request has to have.
    pub headers: Vec<(String, String)>,
}

impl fmt::Debug for SignedPut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SignedPut").finish_non_exhaustive()
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
        let Some(signing) = &self.signing else {
            return Ok(None);
        };
        let path = signing.path(key)?;
        let signed = self.attempt("signing a URL of", key, || {
            signing.signer.signed_url(Method::GET, &path, life)
        });
        signed.await.map(Some)
    }

    /// A request with which anyone can write the bytes with this SHA-256 as the object at `key` for `life`, also over an
    /// earlier object; `None` where the store signs none. Only a store that knows checksums refuses other bytes.
    ///
    /// # Errors
    /// When the key is malformed, or the store's credentials can't be had.
    pub async fn signed_put(
        &self,
        key: &str,
        sha256: &[u8; 32],
        life: Duration,
    ) -> Result<Option<SignedPut>, ObjectsError> {
        let Some(signing) = &self.signing else {
            return Ok(None);
        };
        let path = signing.path(key)?;
        let checksum = BASE64.encode(sha256);
        let mut options = SignedUrlOptions::new();
        if let Ok(value) = HeaderValue::from_str(&checksum) {
            options = options.with_signed_header(HeaderName::from_static(CHECKSUM), value);
        }
        let signed = self.attempt("signing a URL of", key, || async {
            let signed = signing
                .signer
                .signed_url_opts(Method::PUT, &path, life, &options);
            match signed.await {
                Err(object_store::Error::NotSupported { .. }) => Ok(None),
                signed => signed.map(Some),
            }
        });
        Ok(signed.await?.map(|url| SignedPut {
            url,
            headers: vec![(CHECKSUM.to_owned(), checksum)],
        }))
    }

    /// Whether the store signs URLs, as far as is known without a try.
    pub fn signs(&self) -> bool {
        self.signing.is_some()
    }
}
