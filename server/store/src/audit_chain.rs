//! The chain of hashes: SHA-256 of the hash before and of all fields, each with its length before it. Names stand for their SHA-256:
//! an erasure takes the names out of an entry, and the chain stays whole.

use crate::AuditEntry;
use sha2::{Digest, Sha256};
use thiserror::Error;
use yoto_proto::{hex, sha256_hex};

/// What the first entry has as the hash before it.
pub const BEFORE_THE_FIRST: &str = "";

/// The end of a chain. Kept elsewhere, it shows later whether entries up to there were changed or removed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Head {
    /// Number of the last entry; 0 for an empty chain.
    pub number: u64,
    /// Its hash.
    pub hash: String,
}

impl Default for Head {
    fn default() -> Self {
        Self {
            number: 0,
            hash: BEFORE_THE_FIRST.to_owned(),
        }
    }
}

/// The first fault of a chain.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Broken {
    /// Entries are missing, or were numbered anew.
    #[error("entry {expected} is missing: the next one has the number {found}")]
    Missing {
        /// The number that should follow.
        expected: u64,
        /// The number that does.
        found: u64,
    },
    /// The entry, or one before it, is not what was written.
    #[error("entry {0} was changed, or the one before it")]
    Changed(u64),
}

/// The hash of an entry after one with the hash `before`.
pub fn hash(before: &str, entry: &AuditEntry) -> String {
    let number = entry.number.to_be_bytes();
    let time = entry.time.to_bits().to_be_bytes();
    let began = entry.began.unwrap_or_default().to_be_bytes();
    let fields: [&[u8]; 9] = [
        before.as_bytes(),
        &number,
        &time,
        entry.tenant.as_bytes(),
        entry.key.as_bytes(),
        entry.call.as_bytes(),
        entry.names_sha256.as_bytes(),
        &began,
        entry.outcome.as_bytes(),
    ];
    let mut sum = Sha256::new();
    for field in fields {
        sum.update((field.len() as u64).to_be_bytes());
        sum.update(field);
    }
    hex(&sum.finalize())
}

impl Head {
    /// The head after `entry`.
    ///
    /// # Errors
    /// When the entry does not follow.
    pub fn then(&self, entry: &AuditEntry) -> Result<Self, Broken> {
        if entry.number != self.number + 1 {
            return Err(Broken::Missing {
                expected: self.number + 1,
                found: entry.number,
            });
        }
        let names =
            entry.names.is_empty() || sha256_hex(entry.names.as_bytes()) == entry.names_sha256;
        if !names || hash(&self.hash, entry) != entry.hash {
            return Err(Broken::Changed(entry.number));
        }
        Ok(Self {
            number: entry.number,
            hash: entry.hash.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(length: u64) -> Vec<AuditEntry> {
        let mut before = BEFORE_THE_FIRST.to_owned();
        let next = |number| {
            let mut entry = AuditEntry {
                number,
                time: 1e9 + number as f64 / 3.0,
                tenant: "lab".into(),
                key: "0123".into(),
                call: "/yoto.v1.JobService/CancelJob".into(),
                names: "jobs/1".into(),
                names_sha256: sha256_hex(b"jobs/1"),
                began: (number % 2 == 0).then(|| number - 1),
                outcome: if number % 2 == 0 { "OK" } else { "" }.into(),
                hash: String::new(),
            };
            entry.hash = hash(&before, &entry);
            before.clone_from(&entry.hash);
            entry
        };
        (1..=length).map(next).collect()
    }

    fn walked(entries: &[AuditEntry]) -> Result<Head, Broken> {
        let mut head = Head::default();
        for entry in entries {
            head = head.then(entry)?;
        }
        Ok(head)
    }

    #[test]
    fn a_chain_is_whole() {
        let entries = chain(5);
        let head = walked(&entries).expect("whole");
        assert_eq!((head.number, &head.hash), (5, &entries[4].hash));
        assert_eq!(walked(&[]), Ok(Head::default()));
    }

    #[test]
    fn a_change_of_any_field_is_found() {
        let changes: [fn(&mut AuditEntry); 8] = [
            |it| it.time += 1e-3,
            |it| it.tenant.push('x'),
            |it| it.key.clear(),
            |it| it.call = it.call.replace("Cancel", "Delete"),
            |it| it.names = "jobs/2".into(),
            |it| it.names_sha256 = sha256_hex(b"jobs/2"),
            |it| it.began = Some(1),
            |it| it.outcome = "OK".into(),
        ];
        for change in changes {
            let mut entries = chain(5);
            change(&mut entries[2]);
            assert_eq!(walked(&entries), Err(Broken::Changed(3)));
        }
    }

    #[test]
    fn an_entry_with_a_hash_that_fits_again_breaks_the_next_one() {
        let mut entries = chain(5);
        entries[2].outcome = "OK".into();
        let before = entries[1].hash.clone();
        entries[2].hash = hash(&before, &entries[2]);
        assert_eq!(walked(&entries), Err(Broken::Changed(4)));
    }

    #[test]
    fn names_can_be_taken_out() {
        let mut entries = chain(5);
        entries[2].names.clear();
        assert_eq!(walked(&entries).map(|it| it.number), Ok(5));
    }

    #[test]
    fn text_that_moves_from_one_field_to_the_next_is_found() {
        let mut entries = chain(3);
        entries[1].tenant = "la".into();
        entries[1].key = "b0123".into();
        assert_eq!(walked(&entries), Err(Broken::Changed(2)));
    }

    #[test]
    fn a_missing_entry_is_found() {
        let mut entries = chain(4);
        entries.remove(1);
        let missing = Broken::Missing {
            expected: 2,
            found: 3,
        };
        assert_eq!(walked(&entries), Err(missing));
    }
}
