//! `yoto.v1.KeyService`.

use super::{fields, paging};
use crate::access;
use crate::context::Context;
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_proto::names::Collection;
use yoto_proto::v1::key_service_server::KeyService;
use yoto_proto::v1::{
    CreateKeyRequest, CreateKeyResponse, ErrorReason, Key, ListKeysRequest, ListKeysResponse,
    RevokeKeyRequest, Scope,
};
use yoto_request::validation::both;
use yoto_request::{Caller, RequestError};
use yoto_store::NewKey;

/// Keys of callers.
pub(crate) struct KeyApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

#[tonic::async_trait]
impl KeyService for KeyApi {
    async fn create_key(
        &self,
        request: Request<CreateKeyRequest>,
    ) -> Result<Response<CreateKeyResponse>, Status> {
        let caller = Caller::of(&request)?;
        let request = request.into_inner();
        let (new, secret) = new_key(&request, self.context.config.clock.now())?;
        let tenant = caller.tenant(&request.tenant)?;
        self.may_give(&caller, &new.scopes).await?;
        let key = self.context.store.create_key(&tenant, &new).await;
        let key = key.map_err(RequestError::from)?;
        tracing::info!(key = key.name, %tenant, by = caller.key(), "a key was created");
        self.context.callers.renew_keys().await;
        Ok(Response::new(CreateKeyResponse {
            key: Some(key),
            secret,
        }))
    }

    async fn list_keys(
        &self,
        request: Request<ListKeysRequest>,
    ) -> Result<Response<ListKeysResponse>, Status> {
        let caller = Caller::of(&request)?;
        let request = request.into_inner();
        let tenant = caller.tenant(&request.tenant)?;
        let (size, token) = (request.page_size, request.page_token.as_str());
        let filter = ListKeysRequest {
            tenant: tenant.id().to_owned(),
            ..ListKeysRequest::default()
        };
        let asked = paging::Request::read("keys", size, token, &filter)?;
        let found = self.context.store.keys(&tenant, asked.page()).await;
        let (keys, next_page_token) = asked.cut(found.map_err(RequestError::from)?);
        Ok(Response::new(ListKeysResponse {
            keys,
            next_page_token,
        }))
    }

    async fn revoke_key(
        &self,
        request: Request<RevokeKeyRequest>,
    ) -> Result<Response<Key>, Status> {
        let caller = Caller::of(&request)?;
        let id = fields::id(Collection::Keys, "name", &request.get_ref().name)?;
        let tenant = caller.tenant("")?;
        // The service's operators revoke keys of all tenants.
        let of = (!caller.is_of_service()).then_some(&tenant);
        let key = self.context.store.revoke_key(of, &id).await;
        let key = key.map_err(RequestError::from)?;
        tracing::info!(key = key.name, by = caller.key(), "a key was revoked");
        self.context.callers.renew_keys().await;
        Ok(Response::new(key))
    }
}

impl KeyApi {
    /// Refuses a new key with a scope that the caller's key lacks: otherwise `operate` would give itself every scope. Operators may always
    /// make keys of workers.
    async fn may_give(&self, caller: &Caller, scopes: &[Scope]) -> Result<(), RequestError> {
        let Some(id) = caller.key() else {
            return Ok(());
        };
        let keys = self.context.callers.keys().await?;
        let own = keys.scopes(id);
        let lacks = |it: &&Scope| **it != Scope::Work && !own.contains(it);
        match scopes.iter().find(lacks) {
            None => Ok(()),
            Some(scope) => {
                let message = format!(
                    "{} is not a scope of the key that makes it",
                    scope.as_str_name()
                );
                Err(RequestError::refused(ErrorReason::ScopeMissing, message))
            }
        }
    }
}

/// The key that a request asks for, and the key itself.
pub(crate) fn new_key(
    request: &CreateKeyRequest,
    now: f64,
) -> Result<(NewKey, String), RequestError> {
    let name = fields::display_name(&request.display_name);
    let end = fields::end("expire_time", request.expire_time.as_ref(), Some(now));
    let ((display_name, scopes), expire_time) = both(both(name, scopes(&request.scopes)), end)?;
    let secret = access::keys::new_secret();
    let new = NewKey {
        display_name,
        sha256: yoto_proto::sha256_hex(secret.as_bytes()),
        scopes,
        expire_time,
        session: false,
    };
    Ok((new, secret))
}

/// The scopes of a new key: at least one, and [`Scope::Work`] alone, so that the key of a machine that runs jobs opens nothing
/// else.
fn scopes(numbers: &[i32]) -> Result<Vec<Scope>, RequestError> {
    let refused = |message: String| RequestError::invalid("scopes", message);
    let mut scopes = Vec::new();
    for number in numbers {
        match Scope::try_from(*number) {
            Err(_) | Ok(Scope::Unspecified) => {
                return Err(refused(format!("{number} is not a scope")));
            }
            Ok(scope) if scopes.contains(&scope) => {}
            Ok(scope) => scopes.push(scope),
        }
    }
    if scopes.is_empty() {
        return Err(refused("a key needs at least one scope".to_owned()));
    }
    if scopes.len() > 1 && scopes.contains(&Scope::Work) {
        return Err(refused(
            "a worker's key has the scope work alone".to_owned(),
        ));
    }
    Ok(scopes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_has_scopes_and_a_workers_key_has_one() {
        let read = scopes(&[1, 2, 1]).expect("good");
        assert_eq!(read, [Scope::Read, Scope::Write]);
        assert_eq!(scopes(&[4]).expect("good"), [Scope::Work]);
        for bad in [&[][..], &[0], &[9], &[1, 4]] {
            assert!(scopes(bad).is_err(), "{bad:?}");
        }
    }
}
