//! TLS of a listener: certificates from files, which may be replaced while the service runs, and the handshakes of new
//! connections. The provider is ring, as for the database and the object store.

mod certificates;
mod connections;

pub use certificates::{Certificates, TlsError, TlsFiles};
pub use connections::{Encrypted, tls};
