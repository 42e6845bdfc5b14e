//! Callers who take all that they can get, at a listener that asks for keys, beside another tenant whose calls must not be slower.

use super::Breaker;
use crate::calls::{Calls, is_transient};
use crate::fault::Fault;
use anyhow::{Context, Result, bail, ensure};
use std::net::SocketAddr;
use std::time::{Duration, Instant};
use tokio::net::TcpStream;
use tonic::Status;
use tonic::transport::{Channel, Endpoint};
use yoto_proto::key::{Connection, Key, connection};
use yoto_proto::v1::job_service_client::JobServiceClient;
use yoto_proto::v1::key_service_client::KeyServiceClient;
use yoto_proto::v1::object_service_client::ObjectServiceClient;
use yoto_proto::v1::subject_service_client::SubjectServiceClient;
use yoto_proto::v1::{
    CreateKeyRequest, DownloadObjectRequest, ListObjectsRequest, ListSubjectsRequest, Scope,
    WatchJobsRequest,
};

/// Connections of strangers: more than the service has places for.
const STRANGERS: usize = 400;
/// Channels of a greedy key: each has at most 1,024 calls.
const CHANNELS: usize = 4;
/// Most calls until one is refused.
const MOST: usize = 4096;
/// Calls of the other tenant that are timed.
const CALLS: usize = 200;
/// How many times as long as before the attack a call of the other tenant may take, at p99.
const SLOWER: f64 = 4.0;
/// Times below this are noise of a busy machine.
const NOISE: Duration = Duration::from_millis(25);

/// Keys of two tenants, and one of the tenant whose jobs run.
pub(crate) struct Keys {
    greedy: Key,
    other: Key,
    own: Key,
}

impl Keys {
    /// Makes them.
    ///
    /// # Errors
    /// When the service refuses.
    pub(crate) async fn make(calls: &Calls) -> Result<Self> {
        let make = async |tenant: &str| {
            let request = CreateKeyRequest {
                display_name: tenant.to_owned(),
                tenant: tenant.to_owned(),
                scopes: vec![Scope::Read.into()],
                ..CreateKeyRequest::default()
            };
            let made = KeyServiceClient::new(calls.channel())
                .create_key(request)
                .await;
            let made = made.context("a key")?.into_inner();
            made.secret.parse::<Key>().context("a key")
        };
        Ok(Self {
            greedy: make("greedy").await?,
            other: make("other").await?,
            own: make("default").await?,
        })
    }
}

async fn at(door: SocketAddr) -> Result<Channel> {
    let endpoint = Endpoint::from_shared(format!("http://{door}"))?;
    Ok(endpoint.connect().await?)
}

/// The 99th percentile of the times of calls of the other tenant, on a new connection.
async fn others(door: SocketAddr, key: &Key) -> Result<Duration> {
    let connection = connection(at(door).await?, Some(key.clone()));
    let mut subjects = SubjectServiceClient::new(connection);
    let mut times = Vec::with_capacity(CALLS);
    for _ in 0..CALLS {
        let began = Instant::now();
        match subjects.list_subjects(ListSubjectsRequest::default()).await {
            Ok(_) => times.push(began.elapsed()),
            // Some answers are lost by themselves.
            Err(status) => ensure!(
                !is_refused(&status)?,
                "another tenant is refused: {status:?}"
            ),
        }
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
    times.sort_unstable();
    let at = times.len() * 99 / 100;
    times
        .get(at)
        .copied()
        .context("no call of another tenant is answered")
}

/// Whether the call was refused because its caller has its share, and not by a lost answer.
///
/// # Errors
/// When it was refused otherwise.
fn is_refused(status: &Status) -> Result<bool> {
    match is_transient(status.code()) {
        true => Ok(status.message().contains("the rest is for others")),
        false => bail!("another refusal: {status:?}"),
    }
}

impl Breaker {
    /// Times calls of another tenant before and during an attack, whose hold on the service ends with what it returns.
    async fn beside<T>(
        &self,
        fault: Fault,
        attack: impl AsyncFnOnce(SocketAddr) -> Result<T>,
    ) -> Result<()> {
        let door = self.fleet.door();
        let quiet = others(door, &self.keys.other).await?;
        let held = attack(door).await?;
        let beside = others(door, &self.keys.other).await?;
        drop(held);
        let [quiet_ms, beside_ms] = [quiet, beside].map(|it| it.as_secs_f64() * 1e3);
        eprintln!(
            "          p99 of another tenant: {quiet_ms:.1} ms before, {beside_ms:.1} ms beside"
        );
        ensure!(
            beside < quiet.max(NOISE).mul_f64(SLOWER),
            "another tenant waits for {beside_ms:.1} ms, and for {quiet_ms:.1} ms without the attack"
        );
        self.broken(fault)
    }

    /// Opens connections and says nothing.
    pub(super) async fn strangers(&mut self) -> Result<()> {
        let attack = async |door: SocketAddr| {
            let mut silent = Vec::new();
            for _ in 0..STRANGERS {
                silent.push(TcpStream::connect(door).await?);
            }
            Ok(silent)
        };
        self.beside(Fault::Strangers, attack).await
    }

    /// Watches jobs until that is refused.
    pub(super) async fn greedy_tenant(&mut self) -> Result<()> {
        let key = &self.keys.greedy;
        let attack = async |door: SocketAddr| {
            let clients = clients(door, key).await?;
            let mut open = Vec::new();
            for number in 0..MOST {
                let mut jobs = JobServiceClient::new(clients[number % CHANNELS].clone());
                match jobs.watch_jobs(WatchJobsRequest::default()).await {
                    Ok(stream) => open.push(stream),
                    Err(status) if is_refused(&status)? => return Ok(open),
                    Err(_) => {}
                }
            }
            bail!("{MOST} watches of one key are open")
        };
        self.beside(Fault::GreedyTenant, attack).await
    }

    /// Begins downloads until that is refused, and reads none of them.
    pub(super) async fn slow_readers(&mut self) -> Result<()> {
        let (key, file) = (&self.keys.own, self.largest_file().await?);
        let attack = async |door: SocketAddr| {
            let clients = clients(door, key).await?;
            let mut open = Vec::new();
            for number in 0..MOST {
                let mut objects = ObjectServiceClient::new(clients[number % CHANNELS].clone());
                let request = DownloadObjectRequest {
                    name: file.clone(),
                    ..DownloadObjectRequest::default()
                };
                match objects.download_object(request).await {
                    Ok(stream) => open.push(stream),
                    Err(status) if is_refused(&status)? => return Ok(open),
                    Err(_) => {}
                }
            }
            bail!("{MOST} downloads of one key are open")
        };
        self.beside(Fault::SlowReaders, attack).await
    }

    /// The largest file of the newest checkpoint of somebody.
    async fn largest_file(&self) -> Result<String> {
        for victim in &self.victims {
            let Some(newest) = self
                .calls
                .checkpoints(&victim.model)
                .await?
                .into_iter()
                .next()
            else {
                continue;
            };
            let request = ListObjectsRequest {
                parent: newest.name,
                ..ListObjectsRequest::default()
            };
            let mut objects = ObjectServiceClient::new(self.calls.channel());
            let listed = objects.list_objects(request).await?.into_inner().objects;
            let largest = listed.into_iter().max_by_key(|it| it.bytes);
            return Ok(largest.context("a file")?.name);
        }
        bail!("nobody has a checkpoint")
    }
}

async fn clients(door: SocketAddr, key: &Key) -> Result<Vec<Connection>> {
    let mut clients = Vec::new();
    for _ in 0..CHANNELS {
        clients.push(connection(at(door).await?, Some(key.clone())));
    }
    Ok(clients)
}
