//! Checksums in the contract.

use yoto_proto::hex;

/// The bytes of a SHA-256 in the contract's form.
pub(crate) fn sha256(text: &str) -> Option<[u8; 32]> {
    hex::decode_array(text)
}

/// Whether `text` is a SHA-256 in the contract's form.
pub(crate) fn is_sha256(text: &str) -> bool {
    sha256(text).is_some()
}
