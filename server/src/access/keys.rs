//! The keys of the service in this process: those of the database, read again when they are older than [`FRESH`].
//!
//! So a revocation by another coordinator counts here after at most that time, and one by this coordinator at once. A call of
//! a service without keys costs a look at memory, and one read of an empty table per [`FRESH`].

use std::collections::HashMap;
use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{Mutex, watch};
use yoto_proto::key::PREFIX;
use yoto_proto::v1::{ErrorReason, Scope};
use yoto_request::RequestError;
use yoto_store::{KeyRow, Store, StoreError};

/// Age up to which the keys in memory are used.
pub(crate) const FRESH: Duration = Duration::from_millis(500);
/// Interval of the notes of a key's use: one per call would be a write per call.
const NOTE_EVERY: Duration = Duration::from_secs(600);

/// Keys as they were at one moment.
#[derive(Debug)]
pub(crate) struct Keys {
    /// Before they were read.
    read: Instant,
    /// The time then, seconds since 1970.
    time: f64,
    /// By their SHA-256.
    rows: HashMap<String, KeyRow>,
}

impl Keys {
    /// Whether the service has or had a key: one that was revoked does not open the service again.
    pub(crate) fn any(&self) -> bool {
        !self.rows.is_empty()
    }

    /// The time of the database, seconds since 1970.
    pub(crate) fn now(&self) -> f64 {
        self.time + self.read.elapsed().as_secs_f64()
    }

    /// The scopes of the key with this id; none if it is unknown.
    pub(crate) fn scopes(&self, id: &str) -> &[Scope] {
        let row = self.rows.values().find(|it| it.id == id);
        row.map(|it| it.scopes.as_slice()).unwrap_or_default()
    }

    /// Whether the key with this id is that of a session.
    pub(crate) fn is_session(&self, id: &str) -> bool {
        self.rows.values().any(|it| it.id == id && it.session)
    }

    /// The key with this SHA-256.
    ///
    /// # Errors
    /// When there is none, or it has ended.
    pub(crate) fn find(&self, sha256: &str) -> Result<&KeyRow, RequestError> {
        let refused = |reason, message: &str| Err(RequestError::refused(reason, message));
        let Some(row) = self.rows.get(sha256) else {
            return refused(
                ErrorReason::KeyUnknown,
                "the service does not know this key",
            );
        };
        if row.revoked {
            return refused(ErrorReason::KeyRevoked, "this key was revoked");
        }
        if row.expire_time.is_some_and(|end| end <= self.now()) {
            return refused(ErrorReason::KeyExpired, "the time of this key is over");
        }
        Ok(row)
    }
}

/// The keys of this process.
#[derive(Debug, Default)]
pub(crate) struct KeyRing {
    known: std::sync::Mutex<Option<Arc<Keys>>>,
    /// Held by the one who reads them.
    reading: Mutex<()>,
    /// Wakes the guards of streams after a change by this process.
    changed: watch::Sender<()>,
    /// When the use of keys was noted by this process, by their ids.
    noted: std::sync::Mutex<HashMap<String, Instant>>,
}

impl KeyRing {
    /// The keys, no older than [`FRESH`].
    ///
    /// # Errors
    /// When the database can't be read: nobody knows then whose key was revoked.
    pub(crate) async fn current(&self, store: &Store) -> Result<Arc<Keys>, StoreError> {
        if let Some(keys) = self.fresh() {
            return Ok(keys);
        }
        let _reading = self.reading.lock().await;
        // Somebody else may have read them meanwhile.
        match self.fresh() {
            Some(keys) => Ok(keys),
            None => self.read(store).await,
        }
    }

    /// Reads the keys after a change, and has running streams check theirs now. They find them in memory, so no message passes between
    /// the change and its end.
    pub(crate) async fn renew(&self, store: &Store) {
        {
            let _reading = self.reading.lock().await;
            *self.known() = None;
            if let Err(error) = self.read(store).await {
                // The next call or guard that needs them tries again.
                tracing::warn!(%error, "the keys can't be read after a change");
            }
        }
        self.changed.send_replace(());
    }

    fn fresh(&self) -> Option<Arc<Keys>> {
        let known = self.known();
        let keys = known.as_ref().filter(|it| it.read.elapsed() < FRESH);
        keys.map(Arc::clone)
    }

    async fn read(&self, store: &Store) -> Result<Arc<Keys>, StoreError> {
        let read = Instant::now();
        let (rows, time) = store.all_keys().await?;
        let rows = rows.into_iter().map(|row| (row.sha256.clone(), row));
        let keys = Arc::new(Keys {
            read,
            time,
            rows: rows.collect(),
        });
        *self.known() = Some(Arc::clone(&keys));
        Ok(keys)
    }

    fn known(&self) -> std::sync::MutexGuard<'_, Option<Arc<Keys>>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes by this process.
    pub(crate) fn changes(&self) -> watch::Receiver<()> {
        self.changed.subscribe()
    }

    /// Whether a use of the key is to be noted now; it then counts as noted.
    pub(crate) fn is_news(&self, keys: &Keys, row: &KeyRow) -> bool {
        let every = NOTE_EVERY.as_secs_f64();
        if row.used_time.is_some_and(|used| keys.now() - used < every) {
            return false;
        }
        let mut noted = self.noted.lock().unwrap_or_else(PoisonError::into_inner);
        let known = noted.get(&row.id);
        if known.is_some_and(|at| at.elapsed() < NOTE_EVERY) {
            return false;
        }
        // Notes that are old say nothing any more.
        noted.retain(|_, at| at.elapsed() < NOTE_EVERY);
        noted.insert(row.id.clone(), Instant::now());
        true
    }
}

/// A new key: 244 random bits of the system.
pub(crate) fn new_secret() -> String {
    format!("{PREFIX}{}", random())
}

/// 244 random bits in 64 hexadecimal digits.
pub(crate) fn random() -> String {
    use uuid::Uuid;
    let (one, two) = (Uuid::new_v4().simple(), Uuid::new_v4().simple());
    format!("{one}{two}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_new_key_is_another_and_has_the_form_of_keys() {
        let (one, two) = (new_secret(), new_secret());
        assert!(yoto_proto::key::is_key(&one) && yoto_proto::key::is_key(&two));
        assert_ne!(one, two);
    }

    #[test]
    fn a_key_ends_with_its_time_or_its_revocation() {
        let row = |sha256: &str, expire_time, revoked| KeyRow {
            id: sha256.to_owned(),
            tenant: "default".to_owned(),
            sha256: sha256.to_owned(),
            scopes: Vec::new(),
            expire_time,
            used_time: None,
            revoked,
            calls_per_second: None,
            session: false,
        };
        let rows = [
            row("good", Some(1000.0), false),
            row("expired", Some(99.9), false),
            row("revoked", None, true),
        ];
        let keys = Keys {
            read: Instant::now(),
            time: 100.0,
            rows: rows.into_iter().map(|it| (it.sha256.clone(), it)).collect(),
        };
        let refusal = |sha256| match keys.find(sha256) {
            Err(RequestError::Refused { reason, .. }) => Some(reason),
            _ => None,
        };
        assert_eq!(refusal("good"), None);
        assert_eq!(refusal("expired"), Some(ErrorReason::KeyExpired));
        assert_eq!(refusal("revoked"), Some(ErrorReason::KeyRevoked));
        assert_eq!(refusal("other"), Some(ErrorReason::KeyUnknown));
    }
}
