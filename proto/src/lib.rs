//! The contract between client, coordinator and workers.
//!
//! [`v1`] is generated from `yoto/v1/*.proto`, what users call, and [`worker::v1`] from `yoto/worker/v1/*.proto`, what only
//! workers call. The rest is what both sides must
//! agree on and messages can't express: limits, resource names, object keys, the pose track with its
//! checks, the media plan, the joints of SMPL by name, the checkpoint manifest, the people of a render, the
//! files of an export, the checks of orders and their levels, the reasons of refusals, the keys of callers, failures that justify another attempt, pauses between attempts, text that is safe to
//! print, the names of tiers, variants and evaluation protocols, and the figures of the paper that reports show.
//!
//! The feature `grpc`, on by default, adds the clients and servers of the calls, [`key`], [`reasons`] and [`retry`].

pub mod alias;
pub mod backoff;
pub mod checks;
pub mod correction;
pub mod exports;
pub mod frame_steps;
pub mod hex;
mod job_state;
#[cfg(feature = "grpc")]
pub mod key;
pub mod keys;
pub mod limits;
pub mod manifest;
pub mod media_plan;
pub mod names;
pub mod orders;
pub mod pose_track;
pub mod progress;
pub mod protocols;
pub mod published;
#[cfg(feature = "grpc")]
pub mod reasons;
pub mod render_needs;
#[cfg(feature = "grpc")]
pub mod retry;
mod signed;
pub mod smpl;
pub mod text;
pub mod tiers;

/// Messages, clients and servers of package `yoto.v1`.
#[allow(missing_docs, clippy::all, clippy::unwrap_used)]
pub mod v1 {
    include!(concat!(env!("OUT_DIR"), "/yoto.v1.rs"));
}

/// What only workers call.
pub mod worker {
    /// Messages, clients and servers of package `yoto.worker.v1`.
    #[allow(missing_docs, clippy::all, clippy::unwrap_used)]
    pub mod v1 {
        include!(concat!(env!("OUT_DIR"), "/yoto.worker.v1.rs"));
    }
}

/// The compiled descriptors of `yoto.v1` and `yoto.worker.v1`, for gRPC reflection.
pub const DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/yoto_descriptor.bin"));

/// SHA-256 of `bytes` in lower-case hex, as every [`v1::ObjectRef`] carries it.
pub fn sha256_hex(bytes: &[u8]) -> String {
    use sha2::Digest;
    hex(&sha2::Sha256::digest(bytes))
}

/// CRC-32C of `bytes`, as every chunk of an upload carries it.
pub fn crc32c(bytes: &[u8]) -> u32 {
    crc32c::crc32c(bytes)
}

/// Lower-case hex of `bytes`; [`hex::decode`] reads it.
pub fn hex(bytes: &[u8]) -> String {
    hex::encode(bytes)
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_crc_is_the_one_of_castagnoli() {
        // The check value of RFC 3720, B.4, and of every catalogue of CRCs.
        assert_eq!(super::crc32c(b"123456789"), 0xe306_9283);
        assert_eq!(super::crc32c(&[0; 32]), 0x8a91_36aa);
    }
}
