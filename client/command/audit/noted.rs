//! An entry of the audit log that somebody has noted.

use std::str::FromStr;
use yoto_server::AuditHead;

/// `NUMBER:HASH`.
#[derive(Debug, Clone)]
pub(super) struct Noted(pub(super) AuditHead);

impl FromStr for Noted {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not NUMBER:HASH, as `yoto audit verify` prints it");
        let (number, hash) = text.split_once(':').ok_or_else(wrong)?;
        let number: u64 = number.parse().map_err(|_| wrong())?;
        let digits = hash.bytes().all(|it| it.is_ascii_hexdigit());
        let length = if number == 0 { 0 } else { 64 };
        if !digits || hash.len() != length {
            return Err(wrong());
        }
        let hash = hash.to_ascii_lowercase();
        Ok(Self(AuditHead { number, hash }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_noted_entry_is_a_number_and_a_hash() {
        let hash = "0123456789ABCDEF".repeat(4);
        let read: Noted = format!("12:{hash}").parse().expect("good");
        assert_eq!(
            (read.0.number, read.0.hash),
            (12, hash.to_ascii_lowercase())
        );
        assert!("0:".parse::<Noted>().is_ok());
        for bad in [
            "",
            "12",
            "12:",
            ":12",
            "x:00",
            &format!("12:{hash}0"),
            &format!("0:{hash}"),
        ] {
            assert!(bad.parse::<Noted>().is_err(), "{bad}");
        }
    }
}
