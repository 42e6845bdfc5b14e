//! Where connections come from: TCP, TLS over it, and this process itself.

mod in_memory;
mod tcp;
mod tls;

use std::net::IpAddr;

pub(crate) use in_memory::InProcess;
pub use in_memory::{InMemoryConnector, InMemoryIncoming, in_memory};
pub use tcp::tcp;
pub use tls::{Certificates, Encrypted, TlsError, TlsFiles, tls};

/// The address at the other end of a connection.
#[derive(Debug, Clone, Copy)]
pub struct Peer(pub(crate) IpAddr);
