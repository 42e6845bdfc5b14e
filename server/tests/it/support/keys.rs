//! Keys, and listeners that ask for them.

use super::Service;
use tonic::transport::Channel;
use yoto_proto::key::{Connection, Key, connection};
use yoto_proto::v1::key_service_client::KeyServiceClient;
use yoto_proto::v1::{CreateKeyRequest, RevokeKeyRequest, Scope};
use yoto_server::{Admission, in_memory};

/// All scopes.
pub(crate) const SCOPES: [Scope; 4] = [Scope::Read, Scope::Write, Scope::Operate, Scope::Work];

/// A key that was made.
pub(crate) struct Made {
    /// Its resource name.
    pub name: String,
    /// The key.
    pub secret: Key,
    /// Its text.
    pub text: String,
}

impl Service {
    pub(crate) fn keys(&self) -> KeyServiceClient<Channel> {
        KeyServiceClient::new(self.connector.channel())
    }

    /// Makes a key as the operator of the service.
    pub(crate) async fn key(&self, tenant: &str, scopes: &[Scope]) -> Made {
        let request = CreateKeyRequest {
            display_name: format!("of {tenant}"),
            scopes: scopes.iter().map(|it| i32::from(*it)).collect(),
            tenant: tenant.into(),
            ..CreateKeyRequest::default()
        };
        let made = self.keys().create_key(request).await.expect("is made");
        let made = made.into_inner();
        Made {
            name: made.key.expect("has a key").name,
            secret: made.secret.parse().expect("a key"),
            text: made.secret,
        }
    }

    pub(crate) async fn revoke(&self, name: &str) {
        let request = RevokeKeyRequest { name: name.into() };
        self.keys().revoke_key(request).await.expect("is revoked");
    }

    /// A connection to a listener that admits those.
    pub(crate) fn door(&self, admission: Admission) -> Channel {
        let (connector, incoming) = in_memory();
        let serving = self
            .coordinator
            .serve_to(admission, incoming, std::future::pending());
        tokio::spawn(serving);
        connector.channel()
    }

    /// Calls with `key` to a listener that admits nobody without one.
    pub(crate) fn with_key(&self, key: &Made) -> Connection {
        connection(self.door(Admission::Nobody), Some(key.secret.clone()))
    }
}
