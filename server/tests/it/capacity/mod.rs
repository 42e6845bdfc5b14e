//! A caller who takes all that it can get of something holds up nobody else.

mod audit;
mod calls;
mod connections;
mod deliveries;
mod downloads;

use crate::support::{Made, Service, listen_as};
use std::net::SocketAddr;
use tonic::Status;
use tonic::transport::{Channel, Endpoint};
use yoto_proto::key::{Connection, connection};
use yoto_proto::v1::ListSubjectsRequest;
use yoto_proto::v1::subject_service_client::SubjectServiceClient;
use yoto_server::Admission;

/// The address of a listener that admits nobody without a key.
async fn door(service: &Service) -> SocketAddr {
    listen_as(service, Admission::Nobody).await.0
}

async fn channel(address: SocketAddr) -> Channel {
    let endpoint = Endpoint::from_shared(format!("http://{address}")).expect("an address");
    endpoint.connect().await.expect("connects")
}

/// A connection of its own with this key.
async fn with_key(address: SocketAddr, key: &Made) -> Connection {
    connection(channel(address).await, Some(key.secret.clone()))
}

async fn lists(connection: &Connection) -> Result<(), Status> {
    let mut subjects = SubjectServiceClient::new(connection.clone());
    let listed = subjects.list_subjects(ListSubjectsRequest::default()).await;
    listed.map(drop)
}
