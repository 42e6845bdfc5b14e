//! Which callers the address of `yoto serve` admits, and how it is encrypted.

use anyhow::ensure;
use clap::Args;
use clap::builder::BoolishValueParser;
use std::net::SocketAddr;
use std::path::PathBuf;
use yoto_server::{Admission, TlsFiles};

/// Encryption and keys.
#[derive(Debug, Args)]
pub(crate) struct Exposure {
    /// Certificate of the service in PEM, followed by intermediate certificates: connections are encrypted. A new
    /// file is used without a restart.
    #[arg(long, env = "YOTO_TLS_CERT", value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// Private key of --tls-cert, in PEM.
    #[arg(long, env = "YOTO_TLS_KEY", value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Authorities of clients, in PEM: a client needs a certificate signed by one of them, besides its key.
    #[arg(
        long,
        env = "YOTO_TLS_CLIENT_CA",
        value_name = "FILE",
        requires = "tls_cert"
    )]
    tls_client_ca: Option<PathBuf>,
    /// A balancer or proxy in front of this address encrypts: listen without TLS, and ask every caller for a key.
    #[arg(long, env = "YOTO_BEHIND_TLS", value_parser = BoolishValueParser::new())]
    behind_tls: bool,
    /// Listen beyond this machine without TLS and, as long as the service has no key, without keys: anyone who can
    /// reach the address can read and change everything.
    #[arg(long, env = "YOTO_INSECURE", value_parser = BoolishValueParser::new())]
    insecure: bool,
}

impl Exposure {
    /// The files of a listener with TLS.
    pub(crate) fn tls(&self) -> Option<TlsFiles> {
        let (certificate, key) = self.tls_cert.clone().zip(self.tls_key.clone())?;
        Some(TlsFiles {
            certificate,
            key,
            client_authorities: self.tls_client_ca.clone(),
        })
    }

    /// Whether a proxy stands before the address, so that all connections have the proxy's.
    pub(crate) fn behind_proxy(&self) -> bool {
        self.behind_tls
    }

    /// Callers whom the address admits without a key.
    ///
    /// # Errors
    /// When it can be reached from other machines, and nothing guards it.
    pub(crate) fn admission(&self, listen: SocketAddr) -> anyhow::Result<Admission> {
        let on_loopback = listen.ip().is_loopback();
        ensure!(
            on_loopback || self.insecure || self.behind_tls || self.tls_cert.is_some(),
            "{listen} can be reached from other machines, and what is sent would not be encrypted: name a certificate \
             (--tls-cert, --tls-key), say that a proxy encrypts (--behind-tls), listen at 127.0.0.1, or add --insecure \
             if the network is trusted"
        );
        Ok(match (self.insecure, self.behind_tls) {
            (true, false) => Admission::Anyone,
            (false, false) if on_loopback => Admission::Machine,
            _ => Admission::Nobody,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Command {
        #[command(flatten)]
        exposure: Exposure,
    }

    fn admitted(listen: &str, options: &[&str]) -> Option<Admission> {
        let words = std::iter::once("serve").chain(options.iter().copied());
        let command = Command::try_parse_from(words).ok()?;
        let listen = listen.parse().expect("an address");
        command.exposure.admission(listen).ok()
    }

    #[test]
    fn only_loopback_needs_neither_tls_nor_keys() {
        let tls = ["--tls-cert", "c", "--tls-key", "k"];
        for own in ["127.0.0.1:1", "[::1]:1"] {
            assert_eq!(admitted(own, &[]), Some(Admission::Machine));
            assert_eq!(admitted(own, &tls), Some(Admission::Machine));
            assert_eq!(admitted(own, &["--behind-tls"]), Some(Admission::Nobody));
        }
        for open in ["0.0.0.0:1", "[::]:1", "10.0.0.1:1"] {
            assert_eq!(admitted(open, &[]), None);
            assert_eq!(admitted(open, &tls), Some(Admission::Nobody));
            assert_eq!(admitted(open, &["--behind-tls"]), Some(Admission::Nobody));
            assert_eq!(admitted(open, &["--insecure"]), Some(Admission::Anyone));
            // The stricter one counts.
            let both = ["--insecure", "--behind-tls"];
            assert_eq!(admitted(open, &both), Some(Admission::Nobody));
        }
    }

    #[test]
    fn a_certificate_has_its_key() {
        assert_eq!(admitted("127.0.0.1:1", &["--tls-cert", "c"]), None);
        assert_eq!(admitted("127.0.0.1:1", &["--tls-client-ca", "c"]), None);
    }
}
