//! Checksums in the contract.

/// Whether `text` is a SHA-256 in the contract's form.
pub fn is_sha256(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'))
}
