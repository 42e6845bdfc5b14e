//! Stores by their URLs.

use super::sign::Signing;
use super::{Environment, Objects, ObjectsError, s3};
use object_store::ObjectStore;
use object_store::local::LocalFileSystem;
use object_store::path::Path as Key;
use object_store::prefix::PrefixStore;
use object_store::signer::Signer;
use std::path::PathBuf;
use std::sync::Arc;
use url::Url;

impl Objects {
    /// Opens the store at `url`: `file:///var/lib/yoto/objects`, whose folder exists, or `s3://BUCKET/PREFIX`, with
    /// credentials and settings of the environment. Nothing is sent yet ([`Objects::check`]).
    ///
    /// # Errors
    /// When the scheme is not supported, the URL has credentials, a setting is wrong, or the folder is missing.
    pub fn open(url: &Url) -> Result<Self, ObjectsError> {
        Self::open_with(url, &Environment::of_process())
    }

    /// [`Objects::open`] with another environment.
    ///
    /// # Errors
    /// As [`Objects::open`].
    pub fn open_with(url: &Url, environment: &Environment) -> Result<Self, ObjectsError> {
        if url.scheme() == "file" {
            let store = LocalFileSystem::new_with_prefix(folder(url)?);
            let store = store.map_err(|error| ObjectsError::url(url, error))?;
            return Ok(Self::over(Arc::new(store.with_fsync(true))));
        }
        if shown(url) != *url {
            let reason = "it has credentials or parameters in it, and URLs are printed and stored: set \
                          AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY in the environment";
            return Err(ObjectsError::url(url, reason));
        }
        s3::set_provider_of_tls();
        remote(url, environment)
    }
}

/// The objects in the bucket of `url`.
fn remote(url: &Url, environment: &Environment) -> Result<Objects, ObjectsError> {
    match url.scheme() {
        "s3" => below(url, s3::bucket(url, environment)?),
        #[cfg(feature = "gcs")]
        "gs" => {
            use object_store::gcp::GoogleCloudStorageBuilder as Builder;
            let builder = Builder::new().with_url(url.as_str());
            let builder = configured(builder, environment, Builder::with_config);
            let bucket = builder.build();
            below(url, bucket.map_err(|error| ObjectsError::url(url, error))?)
        }
        #[cfg(feature = "azure")]
        "az" => {
            use object_store::azure::MicrosoftAzureBuilder as Builder;
            let builder = Builder::new().with_url(url.as_str());
            let builder = configured(builder, environment, Builder::with_config);
            let bucket = builder.build();
            below(url, bucket.map_err(|error| ObjectsError::url(url, error))?)
        }
        _ => {
            let reason = "a store is file:///FOLDER or s3://BUCKET/PREFIX";
            Err(ObjectsError::url(url, reason))
        }
    }
}

/// The builder of another cloud's store, with the variables that its own tools read.
#[cfg(any(feature = "gcs", feature = "azure"))]
fn configured<B, K: std::str::FromStr>(
    builder: B,
    environment: &Environment,
    with: impl Fn(B, K, String) -> B,
) -> B {
    environment.iter().fold(builder, |builder, (key, value)| {
        match key.to_ascii_lowercase().parse() {
            Ok(key) => with(builder, key, value.to_owned()),
            Err(_) => builder,
        }
    })
}

/// The objects of a bucket, below the prefix in `url`.
fn below(url: &Url, bucket: impl ObjectStore + Signer + Clone) -> Result<Objects, ObjectsError> {
    let prefix = Key::from_url_path(url.path());
    let prefix = prefix.map_err(|error| ObjectsError::url(url, error))?;
    let signing = Signing::new(Arc::new(bucket.clone()), prefix.clone());
    let store: Arc<dyn ObjectStore> = match prefix.as_ref() {
        "" => Arc::new(bucket),
        _ => Arc::new(PrefixStore::new(bucket, prefix)),
    };
    Ok(Objects {
        remote: Some(Arc::new(url.clone())),
        signing: Some(signing),
        ..Objects::over(store)
    })
}

/// The folder that a `file` URL names.
///
/// # Errors
/// When it names none.
pub fn folder(url: &Url) -> Result<PathBuf, ObjectsError> {
    let path = url.to_file_path();
    path.map_err(|()| ObjectsError::url(url, "names no folder of this machine"))
}

/// `url` as people may see it: without user, password and parameters, in which credentials may be.
pub fn shown(url: &Url) -> Url {
    let mut shown = url.clone();
    // Both fail for URLs that can't have a user at all.
    let _ = shown.set_username("");
    let _ = shown.set_password(None);
    shown.set_query(None);
    shown.set_fragment(None);
    shown
}
