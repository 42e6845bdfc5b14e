//! The layer that authorizes each call of a listener.

use super::credentials::CallHead;
use super::guard::{self, Ended, Guarded, GuardedRequest};
use super::keys::Keys;
use super::rules::{self, Rule};
use super::{Admission, Callers, browser};
use crate::traffic::Call;
use futures::future::BoxFuture;
use std::sync::Arc;
use std::task::{self, Poll};
use tonic::body::Body;
use tonic::codegen::http::{Method, Request, Response};
use tonic::{Code, Status};
use tower::{Layer, Service};
use yoto_http::{is_grpc, transcoding};
use yoto_process::metrics::METRICS;
use yoto_proto::sha256_hex;
use yoto_proto::v1::{ErrorReason, Scope};
use yoto_request::methods::is_unary;
use yoto_request::{Caller, RequestError};
use yoto_store::{KeyRow, Tenant};

/// What a caller without a key is told.
const KEY_MISSING: &str =
    "the service asks for a key: set YOTO_KEY, or send `authorization: Bearer yoto_…`";

/// Authorizes the calls of a listener.
#[derive(Clone)]
pub(crate) struct AccessLayer {
    /// Who has a key.
    pub callers: Arc<Callers>,
    /// Whom the listener admits.
    pub admission: Admission,
    /// What people see who are asked for a key.
    pub sign_in: SignInPage,
}

/// Makes the page in place of one that somebody may not see without a key, from the page that is shown after a sign-in, and why
/// they are asked.
pub(crate) type SignInPage = Arc<dyn Fn(&str, &str) -> Response<axum::body::Body> + Send + Sync>;

impl<S> Layer<S> for AccessLayer {
    type Service = Authorized<S>;

    fn layer(&self, inner: S) -> Authorized<S> {
        Authorized {
            inner,
            access: self.clone(),
        }
    }
}

/// Services whose calls are authorized.
#[derive(Clone)]
pub(crate) struct Authorized<S> {
    inner: S,
    access: AccessLayer,
}

/// The form of a request, and so of a refusal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RequestForm {
    /// A call of gRPC.
    Grpc,
    /// A call over HTTP.
    Json,
    /// A page for people.
    Page,
    /// A request of a page's script. It is authorized as the page is, but a refusal is told to the script, and no browser asks for a
    /// key in the midst of it.
    Script,
    /// Anything else: a page for programs.
    Plain,
}

impl RequestForm {
    fn of(request: &Request<Body>) -> Self {
        let path = request.uri().path();
        if is_grpc(request.headers()) {
            Self::Grpc
        } else if transcoding::is_request(path) {
            Self::Json
        } else if rules::is_of_script(path) {
            Self::Script
        } else if rules::is_of_dashboard(path) {
            Self::Page
        } else {
            Self::Plain
        }
    }

    /// The answer to an unknown path.
    fn unknown(self) -> Response<Body> {
        match self {
            Self::Json => transcoding::unknown().map(Body::new),
            _ => yoto_http::unknown(self == Self::Grpc),
        }
    }

    /// The answer to a caller who may not call.
    ///
    /// `to` is the page that is shown after a sign-in.
    fn refusal(self, status: &Status, sign_in: &SignInPage, to: &str) -> Response<Body> {
        match self {
            Self::Json => transcoding::refusal(status).map(Body::new),
            Self::Page if status.code() == Code::Unauthenticated => {
                // How programs send a key is nothing to people.
                let missing = status.message() == KEY_MISSING;
                let why = if missing { "" } else { status.message() };
                sign_in(to, why).map(Body::new)
            }
            _ => yoto_http::refusal(status, self == Self::Grpc),
        }
    }
}

/// A caller, and the SHA-256 of its key.
type Admitted = (Caller, Option<String>);

impl Admission {
    /// Admits a caller without a key; where people sign in at an issuer (`oidc`), as if the service had keys.
    ///
    /// # Errors
    /// When a key is asked for.
    pub(super) fn without_key(&self, keys: &Keys, oidc: bool) -> Result<(), RequestError> {
        let admitted = match self {
            Self::Process(_) => true,
            Self::Machine | Self::Anyone => !keys.any() && !oidc,
            Self::Nobody => false,
        };
        match admitted {
            true => Ok(()),
            false => Err(RequestError::refused(ErrorReason::KeyMissing, KEY_MISSING)),
        }
    }
}

impl AccessLayer {
    /// Who makes the call.
    async fn admit(&self, request: &CallHead, rule: Rule) -> Result<Admitted, RequestError> {
        if let Admission::Process(tenant) = &self.admission {
            return Ok((Caller::trusted(tenant.clone()), None));
        }
        let oidc = self.callers.at_issuer;
        let keys = self.callers.keys().await?;
        let key = match &request.key {
            Some(key) if keys.any() || oidc => key.of_caller(request)?,
            _ => {
                self.admission.without_key(&keys, oidc)?;
                let on_loopback = self.admission == Admission::Machine;
                browser::check(&request.uri, &request.headers, on_loopback)?;
                return Ok((Caller::trusted(Tenant::default()), None));
            }
        };
        let sha256 = sha256_hex(key.as_bytes());
        let row = keys.find(&sha256)?;
        allows(row, rule)?;
        if self.callers.ring.is_news(&keys, row) {
            self.note_use(row.id.clone());
        }
        let tenant = Tenant::new(&row.tenant).ok_or(RequestError::NoTenant)?;
        if let Some(rate) = row.calls_per_second
            && !is_of_workers(rule)
        {
            self.callers.rates.take(&tenant, rate)?;
        }
        let caller = Caller::with_key(tenant, row.id.as_str().into());
        Ok((caller, Some(sha256)))
    }

    /// Counts the call of `caller` in its share.
    ///
    /// # Errors
    /// When the caller has its share of open calls already.
    fn count(&self, call: &Call, caller: &Caller, rule: Rule) -> Result<(), RequestError> {
        let counted = match self.admission {
            Admission::Process(_) => call.of_process(),
            _ => call.admitted(caller, rule.scope(), rule.is_download()),
        };
        counted.inspect_err(|_| METRICS.refused())
    }

    /// Notes the use of a key, which no call waits for.
    fn note_use(&self, id: String) {
        let callers = Arc::clone(&self.callers);
        tokio::spawn(async move {
            if let Err(error) = callers.store.note_key_use(&id).await {
                tracing::warn!(%error, key = id, "the use of a key can't be noted");
            }
        });
    }
}

/// Whether workers make the call: how many they make follows from the jobs, which have quotas of their own.
fn is_of_workers(rule: Rule) -> bool {
    matches!(
        rule,
        Rule::Scope {
            scope: Scope::Work,
            ..
        }
    )
}

/// Refuses what the key does not allow.
fn allows(row: &KeyRow, rule: Rule) -> Result<(), RequestError> {
    let Rule::Scope {
        scope,
        whole_service,
        ..
    } = rule
    else {
        return Ok(());
    };
    let refused = |message| Err(RequestError::refused(ErrorReason::ScopeMissing, message));
    if !row.scopes.contains(&scope) {
        return refused(format!(
            "the call needs a key with the scope {}",
            name(scope)
        ));
    }
    if whole_service && row.tenant != Tenant::default().id() {
        let operators = Tenant::default();
        return refused(format!(
            "the call is about the whole service, and needs a key of the tenant {operators}"
        ));
    }
    Ok(())
}

fn name(scope: Scope) -> String {
    let name = scope.as_str_name().trim_start_matches("SCOPE_");
    name.to_ascii_lowercase()
}

impl<S> Service<Request<Body>> for Authorized<S>
where
    S: Service<Request<Body>, Response = Response<Body>> + Clone + Send + 'static,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = BoxFuture<'static, Result<Response<Body>, S::Error>>;

    fn poll_ready(&mut self, context: &mut task::Context<'_>) -> Poll<Result<(), S::Error>> {
        self.inner.poll_ready(context)
    }

    fn call(&mut self, mut request: Request<Body>) -> Self::Future {
        let access = self.access.clone();
        // The ready one is used, and its clone gets ready for the next call.
        let next = self.inner.clone();
        let mut inner = std::mem::replace(&mut self.inner, next);
        Box::pin(async move {
            let form = RequestForm::of(&request);
            // A form is not sent again after a sign-in.
            let to = match (form, request.uri().path_and_query()) {
                (RequestForm::Page, Some(page)) if request.method() == Method::GET => {
                    page.to_string()
                }
                _ => String::new(),
            };
            let head = CallHead::of(
                &mut request,
                matches!(form, RequestForm::Page | RequestForm::Script),
            );
            let path = request.uri().path();
            let rule = match rules::of_request(request.method(), path) {
                None => return Ok(form.unknown()),
                Some(rule) => rule,
            };
            let open_call = request.extensions().get::<Arc<Call>>().cloned();
            if rule == Rule::Open {
                let counted = match open_call {
                    Some(call) if !rules::is_probe(path) => call.open_to_all(),
                    _ => Ok(()),
                };
                return match counted {
                    Ok(()) => inner.call(request).await,
                    Err(error) => Ok(form.refusal(&error.into(), &access.sign_in, "")),
                };
            }
            let streams = match form {
                RequestForm::Grpc => !is_unary(path),
                RequestForm::Json => transcoding::streams(request.method(), path),
                RequestForm::Page | RequestForm::Script | RequestForm::Plain => {
                    rules::streams(request.method(), path)
                }
            };
            let admitted = access.admit(&head, rule).await;
            let admitted = admitted.and_then(|(caller, sha256)| {
                if let Some(call) = open_call {
                    access.count(&call, &caller, rule)?;
                }
                Ok((caller, sha256))
            });
            let (caller, sha256) = match admitted {
                Ok(admitted) => admitted,
                Err(error) => {
                    return Ok(form.refusal(&error.into(), &access.sign_in, &to));
                }
            };
            request.extensions_mut().insert(caller.own_tenant().clone());
            request.extensions_mut().insert(caller);
            if !streams || matches!(access.admission, Admission::Process(_)) {
                return inner.call(request).await;
            }
            let ended = guard::ended(access.callers, access.admission, sha256);
            let request = request.map(|body| Body::new(GuardedRequest::new(body, ended.clone())));
            until(inner.call(request), ended, form, &access.sign_in).await
        })
    }
}

/// The answer of a stream, which ends with the caller's right. A caller whose right ends before there is an answer is refused in
/// the `form` of the request: over HTTP, the status of gRPC in a header would look like success.
async fn until<E>(
    answer: impl Future<Output = Result<Response<Body>, E>>,
    mut ended: Ended,
    form: RequestForm,
    sign_in: &SignInPage,
) -> Result<Response<Body>, E> {
    tokio::select! {
        answer = answer => Ok(answer?.map(|body| Body::new(Guarded::new(body, ended)))),
        status = &mut ended => Ok(form.refusal(&status, sign_in, "")),
    }
}
