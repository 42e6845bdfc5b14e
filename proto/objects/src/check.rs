//! The check of a remote store when a program starts: everything that the program does later is tried once, and what is
//! wrong is told in a line that says what to do.

use super::class::{self, element, status};
use super::{Objects, ObjectsError};
use bytes::Bytes;
use futures::TryStreamExt;
use url::Url;
use yoto_proto::v1::ObjectRef;

/// Folder of the objects that checks write. Collections of garbage don't look into it.
const FOLDER: &str = "check";
/// Bytes of such an object.
const PROBE: &[u8] = b"yoto checks that it can write here";

/// What a program does with a store.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rights {
    /// Reads and writes: a worker.
    ReadWrite,
    /// Lists and deletes as well: a coordinator.
    All,
}

/// A step of the check.
#[derive(Debug, Clone, Copy)]
enum Step {
    Write,
    Read,
    ReadMissing,
    List,
    Delete,
}

impl Step {
    /// What it does, and the right that it needs on S3.
    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Write => ("write", "s3:PutObject"),
            Self::Read => ("read", "s3:GetObject"),
            // Without it, S3 answers 403 for an object that does not exist.
            Self::ReadMissing => ("look for", "s3:ListBucket"),
            Self::List => ("list", "s3:ListBucket"),
            Self::Delete => ("delete", "s3:DeleteObject"),
        }
    }
}

impl Objects {
    /// Tries everything that a program with these `rights` does. A folder of this machine is not tried.
    ///
    /// # Errors
    /// [`ObjectsError::Unusable`] with what to do about it.
    pub async fn check(&self, rights: Rights) -> Result<(), ObjectsError> {
        let Some(url) = self.remote.as_deref() else {
            return Ok(());
        };
        let told = |step| move |error| unusable(url, step, &error);
        let key = format!("{FOLDER}/{}", uuid::Uuid::new_v4());
        // A worker can't delete what it writes, so each writes the same.
        let key = match rights {
            Rights::All => key,
            Rights::ReadWrite => format!("{FOLDER}/worker"),
        };
        let put = self.put(&key, Bytes::from_static(PROBE)).await;
        let written = put.map_err(told(Step::Write))?;
        self.read(&written).await.map_err(told(Step::Read))?;
        let missing = ObjectRef {
            key: format!("{FOLDER}/{}", uuid::Uuid::new_v4()),
            ..written
        };
        match self.read(&missing).await {
            Err(ObjectsError::Missing { .. }) => {}
            Err(error) => return Err(told(Step::ReadMissing)(error)),
            Ok(_) => {
                return Err(no_store(
                    url,
                    "it answers for objects that nobody has written",
                ));
            }
        }
        if rights == Rights::All {
            let listed: Result<Vec<_>, _> = self.list(FOLDER).try_collect().await;
            let listed = listed.map_err(told(Step::List))?;
            if !listed.iter().any(|it| it.key == key) {
                return Err(no_store(
                    url,
                    "its list lacks an object that was just written",
                ));
            }
            self.delete(&key).await.map_err(told(Step::Delete))?;
        }
        Ok(())
    }
}

fn no_store(url: &Url, reason: &str) -> ObjectsError {
    ObjectsError::Unusable {
        url: url.clone(),
        reason: format!("{reason}: check AWS_ENDPOINT_URL"),
    }
}

/// The error of a `step`, as a line that says what to do.
fn unusable(url: &Url, step: Step, error: &ObjectsError) -> ObjectsError {
    ObjectsError::Unusable {
        url: url.clone(),
        reason: advice(url, step, &class::text(error)),
    }
}

fn advice(url: &Url, step: Step, text: &str) -> String {
    let bucket = url.host_str().unwrap_or_default();
    let (does, right) = step.words();
    match element(text, "Code").unwrap_or_default() {
        "NoSuchBucket" | "ContainerNotFound" => {
            format!(
                "there is no bucket '{bucket}': create it, or correct the URL or AWS_ENDPOINT_URL"
            )
        }
        "InvalidAccessKeyId" | "NotSignedUp" => {
            "it does not know the key: correct AWS_ACCESS_KEY_ID".into()
        }
        "SignatureDoesNotMatch" => {
            "the secret does not belong to the key: correct AWS_SECRET_ACCESS_KEY".into()
        }
        "ExpiredToken" | "InvalidToken" => {
            "the credentials have expired: renew AWS_SESSION_TOKEN and its key".into()
        }
        "RequestTimeTooSkewed" => {
            "its clock and this machine's differ by more than it allows: set this machine's clock"
                .into()
        }
        "AuthorizationHeaderMalformed"
        | "PermanentRedirect"
        | "IllegalLocationConstraintException" => wrong_region(element(text, "Region")),
        "AccessDenied" | "AuthorizationPermissionMismatch" => format!(
            "the credentials may not {does} objects in '{bucket}': allow {right} for this prefix"
        ),
        _ => without_code(bucket, step, text),
    }
}

fn wrong_region(region: Option<&str>) -> String {
    match region {
        Some(region) => format!("the bucket is in another region: set AWS_REGION={region}"),
        None => "the bucket is in another region: set AWS_REGION to the bucket's".into(),
    }
}

/// What to do about an answer that has no code of S3, or about no answer.
fn without_code(bucket: &str, step: Step, text: &str) -> String {
    let (does, right) = step.words();
    let has = |words: &[&str]| words.iter().any(|it| text.contains(it));
    // The last cause is the plainest.
    let last = text.rsplit(": ").next().unwrap_or(text);
    if has(&["redirect without LOCATION"]) {
        return wrong_region(None);
    }
    // The address at which clouds give credentials to their machines.
    if has(&["169.254.169.254"]) {
        return "there are no credentials: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY; profiles in ~/.aws are not \
                read, and this machine has no role"
            .into();
    }
    if has(&["invalid peer certificate"]) {
        return format!(
            "its certificate is not trusted ({last}): set AWS_CA_BUNDLE to a file with its authority, or correct \
             AWS_ENDPOINT_URL"
        );
    }
    if has(&["InvalidContentType", "corrupt message"]) {
        return "it does not speak TLS: if the network is trusted, AWS_ENDPOINT_URL begins with http:// and \
                AWS_ALLOW_HTTP is true"
            .into();
    }
    match status(text) {
        Some(401 | 403) => {
            format!("the credentials may not {does} objects in '{bucket}': allow {right}")
        }
        Some(status @ (408 | 429 | 500..)) => {
            format!("it answers {status} for now: start again later")
        }
        Some(status) => format!(
            "it does not answer as an object store, but with status {status}: check AWS_ENDPOINT_URL"
        ),
        None if has(&["error sending request", "HTTP error"]) => {
            format!("it can't be reached ({last}): check AWS_ENDPOINT_URL and the network")
        }
        None => format!("it could not {does} an object ({text}): check AWS_ENDPOINT_URL"),
    }
}
