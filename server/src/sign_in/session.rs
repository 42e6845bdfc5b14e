//! Sessions of people: keys that the service makes for them.

use super::grants::{self, Claims};
use crate::access::keys::{FRESH, new_secret};
use crate::config::{Grant, OidcConfig};
use crate::context::Context;
use serde_json::Value;
use yoto_proto::sha256_hex;
use yoto_proto::text::is_hidden;
use yoto_proto::v1::Scope;
use yoto_request::RequestError;
use yoto_store::{NewAuditEntry, NewKey, Tenant};

/// What the audit log has as the call by which a session begins.
const SIGN_IN: &str = "sign-in";
/// Maximum length of a name, characters.
const LONGEST_NAME: usize = 100;

/// Makes the key of a session of somebody with these claims, to whom `grant` applies.
///
/// # Errors
/// When the database fails, or the audit log can't be written.
pub(super) async fn begin(
    context: &Context,
    config: &OidcConfig,
    claims: &Claims,
    grant: &Grant,
) -> Result<String, RequestError> {
    let tenant = Tenant::new(&grant.tenant).ok_or(RequestError::NoTenant)?;
    let keys = context.callers.keys().await?;
    let secret = new_secret();
    let new = NewKey {
        display_name: display_name(claims),
        sha256: sha256_hex(secret.as_bytes()),
        scopes: grant.scopes.iter().map(|it| Scope::from(*it)).collect(),
        expire_time: Some(keys.now() + config.hours * 3600.0),
        session: true,
    };
    let entry = NewAuditEntry {
        tenant: tenant.id().to_owned(),
        key: String::new(),
        call: SIGN_IN.to_owned(),
        names: String::new(),
        began: None,
        outcome: String::new(),
    };
    let number = context.audit.begin(entry.clone()).await?;
    let made = context.store.create_key(&tenant, &new).await;
    let (names, outcome) = match &made {
        Ok(key) => (key.name.clone(), "OK"),
        Err(_) => (String::new(), "INTERNAL"),
    };
    let ended = NewAuditEntry {
        began: Some(number),
        names,
        outcome: outcome.to_owned(),
        ..entry
    };
    context.audit.end(ended).await;
    let key = made?;
    tracing::info!(key = key.name, %tenant, "somebody has signed in");
    context.callers.renew_keys().await;
    if context.store.is_shared() {
        // The next page may be another coordinator's, which reads the keys as often.
        tokio::time::sleep(FRESH).await;
    }
    Ok(secret)
}

/// Ends the session with this secret; nothing, if it is none.
///
/// # Errors
/// When the database fails.
pub(super) async fn end(context: &Context, secret: &str) -> Result<(), RequestError> {
    let keys = context.callers.keys().await?;
    match keys.find(&sha256_hex(secret.as_bytes())) {
        Ok(row) => sign_out(context, &row.id).await,
        Err(_) => Ok(()),
    }
}

/// Ends the session with the key of this id. A key that was made for a program stays: its owner has only shown it.
///
/// # Errors
/// When the database fails.
pub(crate) async fn sign_out(context: &Context, key: &str) -> Result<(), RequestError> {
    let keys = context.callers.keys().await?;
    if keys.is_session(key) {
        context.store.revoke_key(None, key).await?;
        context.callers.renew_keys().await;
    }
    Ok(())
}

/// What the list of keys has: a name for people, and the subject by which the issuer tells people apart.
fn display_name(claims: &Claims) -> String {
    let subject = claims.get("sub").and_then(Value::as_str).unwrap_or("?");
    format!(
        "signed in: {} ({})",
        short(grants::name(claims)),
        short(subject)
    )
}

/// One line without hidden characters, and without commas, which separate names in lists.
fn short(name: &str) -> String {
    let shown = name.chars().filter(|it| !is_hidden(*it) && *it != ',');
    shown.take(LONGEST_NAME).collect()
}
