//! The version of a resource, so that a deletion or a change can be limited to the state that its caller has seen.

use crate::StoreError;
use prost::Message;
use yoto_proto::sha256_hex;
use yoto_proto::v1::ErrorReason;

/// Characters of a version, of 4 bits each.
const LENGTH: usize = 16;

/// The version of `message`, whose own field for it is empty.
pub fn of(message: &impl Message) -> String {
    let mut etag = sha256_hex(&message.encode_to_vec());
    etag.truncate(LENGTH);
    etag
}

/// Refuses if `name` has another version than `asked`; an empty `asked` accepts any.
///
/// # Errors
/// ETAG_MISMATCH.
pub fn check(name: &str, asked: &str, found: &str) -> Result<(), StoreError> {
    if asked.is_empty() || asked == found {
        return Ok(());
    }
    Err(StoreError::Rule {
        reason: ErrorReason::EtagMismatch,
        message: format!("{name} has changed since it was read; nothing was changed"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::Subject;

    #[test]
    fn every_change_gives_another_version() {
        let mut subject = Subject::default();
        let before = of(&subject);
        assert_eq!(before, of(&subject));
        subject.captures.push("captures/a".into());
        assert_ne!(before, of(&subject));
        assert!(check("subjects/a", &before, &of(&subject)).is_err());
        assert!(check("subjects/a", "", &before).is_ok());
        assert!(check("subjects/a", &before, &before).is_ok());
    }
}
