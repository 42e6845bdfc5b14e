//! A server for S3 in the process of a test: `s3s` speaks the protocol and checks signatures, `s3s-fs` keeps the objects
//! in a temporary folder. Nothing needs to be installed.
//!
//! It can fail as servers and networks do ([`S3Fault`]), refuse operations ([`Server::deny`]) or all requests as those of a
//! wrong clock ([`Setup::no_skew`]), and have a certificate that nobody knows ([`Setup::tls`]).

mod fault;
mod server;

pub use fault::S3Fault;
pub use server::{Server, Setup};

/// The bucket that each server has.
pub const BUCKET: &str = "yoto-test";
/// The certificate of the authority that signed a server's own one ([`Setup::tls`]), made by `certificate/make.sh`.
pub const AUTHORITY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/certificate/authority.pem");
