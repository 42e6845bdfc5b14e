//! The addresses of a service: several coordinators share one database, and each of them answers every call.
//!
//! A channel has one connection, to one coordinator. When the connection is lost, the next one goes to the next address
//! that answers. Calls that can be repeated are repeated there, and watches go on after what they have seen.

use super::ClientError;
use super::tls::{self, Tls};
use hyper_util::rt::TokioIo;
use std::hash::{BuildHasher, RandomState};
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::net::{TcpStream, lookup_host};
use tokio::time::timeout;
use tokio_rustls::client::TlsStream;
use tokio_util::either::Either;
use tonic::codegen::http::Uri;
use tonic::transport::{Channel, Endpoint};

/// Longest wait for one address to accept a connection.
const ACCEPT: Duration = Duration::from_secs(3);
/// Interval of pings to the only address, and longest wait for their answers: they detect a lost peer (a sleeping laptop, a
/// dropped NAT entry). An upload over a slow line may delay an answer.
const PINGS: (Duration, Duration) = (Duration::from_secs(20), Duration::from_secs(10));
/// Interval and wait of pings to one of several addresses. With the wait for another address, both stay below a lease
/// of 20 seconds.
const PINGS_OF_SEVERAL: (Duration, Duration) = (Duration::from_secs(4), Duration::from_secs(8));
/// The ports of addresses that name none.
const HTTP_PORT: u16 = 80;
const HTTPS_PORT: u16 = 443;

/// A connection, with or without encryption.
pub(super) type Wire = Either<TcpStream, Box<TlsStream<TcpStream>>>;

/// Where the coordinators of a service listen.
#[derive(Debug, Clone)]
pub struct Addresses {
    /// As they were given.
    text: String,
    /// Host and port of each.
    hosts: Vec<(String, u16)>,
    first: Uri,
    /// For `https://`.
    tls: Option<Tls>,
}

impl Addresses {
    /// Parses one address, such as `http://127.0.0.1:50051`, `localhost:50051` or `https://yoto.example`, or several of one
    /// scheme with commas between them. A name may stand for several machines. Addresses with `https://` are trusted if
    /// the system trusts their authorities.
    ///
    /// # Errors
    /// When an address is not one of HTTP, the schemes differ, or the list is empty.
    pub fn parse(text: &str) -> Result<Self, ClientError> {
        let mut hosts = Vec::new();
        let (mut first, mut schemes) = (None, None);
        for address in text.split(',').map(str::trim).filter(|it| !it.is_empty()) {
            let uri = uri(address)?;
            let encrypted = uri.scheme_str() == Some("https");
            if *schemes.get_or_insert(encrypted) != encrypted {
                let message =
                    format!("{text}: either all addresses begin with https://, or none does");
                return Err(ClientError::Name(message));
            }
            let host = uri.host().unwrap_or_default();
            // The brackets of IPv6 belong to the URL.
            let host = host.trim_start_matches('[').trim_end_matches(']');
            let port = if encrypted { HTTPS_PORT } else { HTTP_PORT };
            hosts.push((host.to_owned(), uri.port_u16().unwrap_or(port)));
            first.get_or_insert(uri);
        }
        let first = first.ok_or_else(|| ClientError::Name("the service has no address".into()))?;
        Ok(Self {
            text: text.to_owned(),
            hosts,
            first,
            tls: match schemes {
                Some(true) => Some(Tls::new(None, None)?),
                _ => None,
            },
        })
    }

    /// The same addresses. The client trusts certificates of the authorities in the file `ca`, and shows the
    /// certificate in the file `own`, with its key.
    ///
    /// # Errors
    /// When the addresses are not encrypted, or a file can't be used.
    pub fn with_certificates(
        self,
        ca: Option<&Path>,
        own: Option<&Path>,
    ) -> Result<Self, ClientError> {
        if ca.is_none() && own.is_none() {
            return Ok(self);
        }
        if self.tls.is_none() {
            let message = format!(
                "{}: certificates need an address that begins with https://",
                self.text
            );
            return Err(ClientError::Name(message));
        }
        Ok(Self {
            tls: Some(Tls::new(ca, own)?),
            ..self
        })
    }

    /// The first one, without a slash at its end.
    pub fn first(&self) -> String {
        self.first.to_string().trim_end_matches('/').to_owned()
    }

    /// Whether what is sent can be read on its way: without TLS, beyond this machine.
    pub fn are_open(&self) -> bool {
        let own = |host: &str| {
            let address = host.parse::<IpAddr>().is_ok_and(|it| it.is_loopback());
            address || host.eq_ignore_ascii_case("localhost")
        };
        self.tls.is_none() && !self.hosts.iter().all(|(host, _)| own(host))
    }

    /// Whether what is sent is encrypted.
    pub fn are_encrypted(&self) -> bool {
        self.tls.is_some()
    }

    /// A channel that connects at its first call.
    pub fn connect_lazy(&self) -> Channel {
        let (endpoint, dialer) = self.parts();
        endpoint.connect_with_connector_lazy(tower::service_fn(move |_| dialer.clone().dial()))
    }

    /// A channel that is connected.
    ///
    /// # Errors
    /// When no address answers.
    pub async fn connect(&self) -> Result<Channel, ClientError> {
        let (endpoint, dialer) = self.parts();
        let connector = tower::service_fn(move |_| dialer.clone().dial());
        let connected = endpoint.connect_with_connector(connector).await;
        connected.map_err(|source| match tls::fault(&source) {
            Some(fault) => ClientError::Tls(fault.to_string()),
            None => ClientError::Connect {
                server: self.text.clone(),
                source,
            },
        })
    }

    fn parts(&self) -> (Endpoint, Dialer) {
        let (every, patience) = match self.hosts.len() {
            1 => PINGS,
            _ => PINGS_OF_SEVERAL,
        };
        let endpoint = Endpoint::from(self.first.clone())
            .http2_keep_alive_interval(every)
            .keep_alive_timeout(patience)
            .keep_alive_while_idle(true);
        (endpoint, Dialer::new(self.hosts.clone(), self.tls.clone()))
    }
}

/// One address as a URL; without a scheme, it is one of HTTP.
fn uri(address: &str) -> Result<Uri, ClientError> {
    let url = match address.split_once("://") {
        Some(("http" | "https", _)) => address.to_owned(),
        Some(_) => {
            return Err(ClientError::Name(format!(
                "{address}: a service speaks HTTP (http:// or https://)"
            )));
        }
        None => format!("http://{address}"),
    };
    let uri = url.parse::<Uri>();
    let uri = uri.map_err(|error| ClientError::Name(format!("{address}: {error}")))?;
    match uri.host() {
        None | Some("") => Err(ClientError::Name(format!("{address} names no host"))),
        Some(_) => Ok(uri),
    }
}

/// Connects to the addresses in turn.
#[derive(Debug, Clone)]
struct Dialer {
    hosts: Vec<(String, u16)>,
    /// The host to begin with: each client chooses one by chance, so that they spread over the coordinators.
    begin: usize,
    /// Where the last connection went.
    last: Arc<Mutex<Option<SocketAddr>>>,
    tls: Option<Tls>,
}

impl Dialer {
    fn new(hosts: Vec<(String, u16)>, tls: Option<Tls>) -> Self {
        // The standard library's hash maps get their keys from the system's random numbers.
        let chance = RandomState::new().hash_one(()) as usize;
        Self {
            begin: chance % hosts.len().max(1),
            hosts,
            last: Arc::default(),
            tls,
        }
    }

    /// A connection to the first address that accepts one, from the address after the last one on.
    async fn dial(self) -> io::Result<TokioIo<Wire>> {
        let mut faults = Vec::new();
        let found = self.look_up(&mut faults).await;
        let last = *self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let begin = found.iter().position(|(it, _)| Some(*it) == last);
        let begin = begin.map_or(0, |last| last + 1);
        for step in 0..found.len() {
            let (address, host) = found[(begin + step) % found.len()];
            match timeout(ACCEPT, TcpStream::connect(address)).await {
                Ok(Ok(connection)) => {
                    connection.set_nodelay(true)?;
                    *self.last.lock().unwrap_or_else(PoisonError::into_inner) = Some(address);
                    let wire = match &self.tls {
                        None => Ok(Ok(Either::Left(connection))),
                        Some(tls) => {
                            let encrypted = tls.clone().connect(host, connection);
                            let encrypted = timeout(ACCEPT, encrypted).await;
                            encrypted.map(|it| it.map(|it| Either::Right(Box::new(it))))
                        }
                    };
                    match wire {
                        Ok(Ok(wire)) => {
                            tracing::debug!(%address, "connected");
                            return Ok(TokioIo::new(wire));
                        }
                        // A wrong certificate is one at all addresses.
                        Ok(Err(error)) if tls::fault(&error).is_some() => return Err(error),
                        Ok(Err(error)) => faults.push(format!("{address}: {error}")),
                        Err(_) => faults.push(format!("{address} does not answer in TLS")),
                    }
                }
                Ok(Err(error)) => faults.push(format!("{address}: {error}")),
                Err(_) => faults.push(format!("{address} does not answer")),
            }
        }
        Err(io::Error::other(faults.join("; ")))
    }

    /// The addresses of all hosts, looked up anew since machines come and go.
    async fn look_up(&self, faults: &mut Vec<String>) -> Vec<(SocketAddr, &str)> {
        let mut found: Vec<(SocketAddr, &str)> = Vec::new();
        for step in 0..self.hosts.len() {
            let (host, port) = &self.hosts[(self.begin + step) % self.hosts.len()];
            match lookup_host((host.as_str(), *port)).await {
                Ok(addresses) => {
                    for address in addresses {
                        if !found.iter().any(|(it, _)| *it == address) {
                            found.push((address, host.as_str()));
                        }
                    }
                }
                Err(error) => faults.push(format!("{host}: {error}")),
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::net::TcpListener;

    #[test]
    fn addresses_are_hosts_with_ports() {
        let parsed = Addresses::parse("http://a:1, [::1]:2,c.example").expect("good");
        let expected = [("a", 1), ("::1", 2), ("c.example", 80)];
        let expected = expected.map(|(host, port)| (host.to_owned(), port));
        assert_eq!(parsed.hosts, expected);
        for bad in [
            "",
            " , ",
            "ftp://a:1",
            "http://a:1,https://b:1",
            "http://",
            "a:1,http://:2",
            "a b:1",
        ] {
            assert!(Addresses::parse(bad).is_err(), "{bad}");
        }
    }

    #[tokio::test]
    async fn each_connection_goes_to_the_next_address_that_accepts_it() {
        let mut listeners = Vec::new();
        for _ in 0..3 {
            listeners.push(TcpListener::bind("127.0.0.1:0").await.expect("binds"));
        }
        let ports: Vec<u16> = (listeners.iter())
            .map(|it| it.local_addr().expect("has an address").port())
            .collect();
        // Nothing listens at the second one any more.
        drop(listeners.remove(1));
        let hosts = ports.iter().map(|port| ("127.0.0.1".to_owned(), *port));
        let dialer = Dialer {
            begin: 0,
            ..Dialer::new(hosts.collect(), None)
        };
        let mut seen = Vec::new();
        for _ in 0..3 {
            let connection = dialer.clone().dial().await.expect("one answers");
            let Either::Left(connection) = connection.into_inner() else {
                panic!("is encrypted");
            };
            seen.push(connection.peer_addr().expect("is connected").port());
        }
        assert_eq!(seen, [ports[0], ports[2], ports[0]]);
    }

    #[tokio::test]
    async fn all_faults_are_told() {
        let free = TcpListener::bind("127.0.0.1:0").await.expect("binds");
        let port = free.local_addr().expect("has an address").port();
        drop(free);
        let hosts = vec![("127.0.0.1".to_owned(), port), ("no such host".into(), 1)];
        let error = Dialer::new(hosts, None)
            .dial()
            .await
            .expect_err("none answers");
        let told = error.to_string();
        let port = port.to_string();
        assert!(
            told.contains(&port) && told.contains("no such host"),
            "{told}"
        );
    }
}
