//! S3: its settings from the environment, named as AWS's tools name them.

use super::{Environment, ObjectsError};
use object_store::aws::{AmazonS3, AmazonS3Builder, AmazonS3ConfigKey};
use object_store::{BackoffConfig, Certificate, ClientOptions, RetryConfig};
use std::time::Duration;
use url::Url;

/// Prefix of the variables.
const PREFIX: &str = "AWS_";
/// Variables with the address of the store; the first one counts.
const ENDPOINTS: [&str; 3] = ["AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT"];
/// Longest wait for a connection.
const CONNECT: Duration = Duration::from_secs(5);
/// Longest wait for the beginning of an answer, while a part is sent, or for its next bytes. A part of
/// [`crate::write::PART_BYTES`] needs 140 kB/s.
const SILENCE: Duration = Duration::from_secs(60);
/// Time after which a request that fails is not sent again. A patient store tries for longer.
const RETRIES: Duration = Duration::from_secs(10);
const FIRST_PAUSE: Duration = Duration::from_millis(100);
const LONGEST_PAUSE: Duration = Duration::from_secs(2);

/// The retries of requests to a remote store.
pub(crate) fn retries() -> RetryConfig {
    RetryConfig {
        backoff: BackoffConfig {
            init_backoff: FIRST_PAUSE,
            max_backoff: LONGEST_PAUSE,
            base: 2.0,
        },
        max_retries: usize::MAX,
        retry_timeout: RETRIES,
    }
}

/// Sets what the client for HTTP encrypts with. If another part of the process has set it, that is as good.
pub(crate) fn set_provider_of_tls() {
    let _ = rustls::crypto::ring::default_provider().install_default();
}

/// Time limits of requests to a remote store. None limits a whole answer: a large object takes as long as it takes.
pub(crate) fn client() -> ClientOptions {
    ClientOptions::new()
        .with_timeout_disabled()
        .with_connect_timeout(CONNECT)
        .with_read_timeout(SILENCE)
}

/// The bucket of `url` (`s3://BUCKET/PREFIX`), with the settings of `environment`.
///
/// # Errors
/// When a setting is wrong, with what to do.
pub(crate) fn bucket(url: &Url, environment: &Environment) -> Result<AmazonS3, ObjectsError> {
    let refused = |reason: String| ObjectsError::url(url, reason);
    let value = |name: &str| environment.get(name);
    if let Some((name, endpoint)) = ENDPOINTS.iter().find_map(|it| Some((it, value(it)?))) {
        check_endpoint(name, endpoint, value("AWS_ALLOW_HTTP")).map_err(refused)?;
    }
    let mut options = client();
    if let Some(file) = value("AWS_CA_BUNDLE") {
        let pem = std::fs::read(file).map_err(|cause| ObjectsError::Disk {
            action: "reading AWS_CA_BUNDLE",
            path: file.into(),
            cause,
        })?;
        let found = Certificate::from_pem_bundle(&pem);
        let found = found.map_err(|error| refused(format!("AWS_CA_BUNDLE {file}: {error}")))?;
        if found.is_empty() {
            return Err(refused(format!("AWS_CA_BUNDLE {file} has no certificates")));
        }
        for certificate in found {
            options = options.with_root_certificate(certificate);
        }
    }
    let mut builder = AmazonS3Builder::new()
        .with_client_options(options)
        .with_retry(retries());
    for (key, value) in environment.iter() {
        if !key.starts_with(PREFIX) {
            continue;
        }
        if let Ok(key) = key.to_ascii_lowercase().parse::<AmazonS3ConfigKey>() {
            builder = builder.with_config(key, value);
        }
    }
    let bucket = url.host_str().filter(|it| !it.is_empty());
    let bucket = bucket.ok_or_else(|| refused("it names no bucket: s3://BUCKET/PREFIX".into()))?;
    let built = builder.with_bucket_name(bucket).build();
    built.map_err(|error| refused(error.to_string()))
}

/// Refuses an endpoint that is no address, has credentials, or sends bytes in the clear without leave.
fn check_endpoint(name: &str, endpoint: &str, allow_http: Option<&str>) -> Result<(), String> {
    let parsed = Url::parse(endpoint);
    let url = parsed.map_err(|error| format!("{name} is not an address: {error}"))?;
    if !url.username().is_empty() || url.password().is_some() || url.query().is_some() {
        return Err(format!(
            "{name} has credentials or parameters in it: they belong in AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"
        ));
    }
    let allowed = allow_http.is_some_and(|it| it == "1" || it.eq_ignore_ascii_case("true"));
    match url.scheme() {
        "https" => Ok(()),
        "http" if allowed => Ok(()),
        "http" => Err(format!(
            "{name} begins with http://, so that anyone on the way can read and change objects: use https://, or set \
             AWS_ALLOW_HTTP=true if the network is trusted"
        )),
        _ => Err(format!("{name} begins with neither https:// nor http://")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(url: &str, environment: &[(&str, &str)]) -> Result<AmazonS3, String> {
        let url = Url::parse(url).expect("a URL");
        let own = |(key, value): &(&str, &str)| ((*key).to_owned(), (*value).to_owned());
        let environment: Vec<_> = environment.iter().map(own).collect();
        bucket(&url, &environment.into()).map_err(|error| error.to_string())
    }

    #[test]
    fn settings_are_checked_before_anything_is_sent() {
        set_provider_of_tls();
        let keys = [("AWS_ACCESS_KEY_ID", "K"), ("AWS_SECRET_ACCESS_KEY", "TOP")];
        let with = |more: &[(&'static str, &'static str)]| {
            let all = [&keys[..], more].concat();
            open("s3://bucket/a", &all)
        };
        assert!(with(&[]).is_ok());
        assert!(with(&[("AWS_ENDPOINT_URL", "https://s:1")]).is_ok());
        let clear = [
            ("AWS_ENDPOINT_URL", "http://s:1"),
            ("AWS_ALLOW_HTTP", "true"),
        ];
        assert!(with(&clear).is_ok());
        for (more, expected) in [
            (&clear[..1], "AWS_ALLOW_HTTP=true"),
            (&[("AWS_ENDPOINT_URL_S3", "s:1")], "neither https://"),
            (
                &[("AWS_ENDPOINT_URL", "https://K:TOP@s")],
                "has credentials",
            ),
            (&[("AWS_CA_BUNDLE", "/no/such/file")], "AWS_CA_BUNDLE"),
        ] {
            let refused = with(more).expect_err("is refused");
            assert!(refused.contains(expected), "{refused}");
            assert!(!refused.contains("TOP"), "{refused}");
        }
        let half = open("s3://bucket/a", &keys[..1]).expect_err("half of a key");
        assert!(half.contains("Secret"), "{half}");
    }
}
