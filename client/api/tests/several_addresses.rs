//! A service with two addresses, one of which goes away: calls go on at the other one, and a watch after what it has seen.

use std::net::SocketAddr;
use std::path::Path;
use tokio::io::copy_bidirectional;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::{JoinHandle, JoinSet};
use yoto_client::{FileSource, UploadFile, YotoClient};
use yoto_proto::v1::job;
use yoto_server::{Coordinator, ServerConfig, ServerError};

/// A way to the service. Its abort closes it with all its connections.
async fn way(to: SocketAddr) -> (SocketAddr, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
    let address = listener.local_addr().expect("has an address");
    let carry = async move {
        let mut carried = JoinSet::new();
        while let Ok((mut client, _)) = listener.accept().await {
            carried.spawn(async move {
                let mut server = TcpStream::connect(to).await.expect("is there");
                // A broken connection is what the test is about.
                let _ = copy_bidirectional(&mut client, &mut server).await;
            });
        }
    };
    (address, tokio::spawn(carry))
}

/// A service that runs.
struct Running {
    address: SocketAddr,
    /// A client with this address alone.
    direct: YotoClient,
    serving: JoinHandle<Result<(), ServerError>>,
    /// Its tasks end with it.
    _coordinator: Coordinator,
}

/// Starts a service on `folder`.
async fn serve(folder: &Path) -> Running {
    let mut config = ServerConfig::new(folder);
    config.storage.min_free_bytes = 0;
    let coordinator = Coordinator::open(config).await.expect("opens");
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
    let address = listener.local_addr().expect("has an address");
    let incoming = yoto_server::tcp(listener);
    let serving = tokio::spawn(coordinator.serve(incoming, std::future::pending()));
    let direct = YotoClient::connect(&address.to_string()).await;
    Running {
        address,
        direct: direct.expect("connects"),
        serving,
        _coordinator: coordinator,
    }
}

#[tokio::test]
async fn a_client_goes_on_at_the_address_that_is_left() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let running = serve(folder.path()).await;
    let (service, direct) = (running.address, &running.direct);

    let (first, first_way) = way(service).await;
    let (second, second_way) = way(service).await;
    let both = format!("http://{first},{second}");
    let client = YotoClient::connect(&both).await.expect("connects");
    let subject = client.create_subject("Ada", "").await.expect("creates");
    let poses = UploadFile {
        path: "poses.json".into(),
        source: FileSource::Memory(b"{}".to_vec()),
    };
    let uploaded = client.upload_capture(&subject.name, vec![poses], |_| {});
    let ingest = uploaded.await.expect("uploads").ingest_job;
    let mut watch = client.watch_job(&ingest);
    let seen = watch.next().await.expect("answers").expect("is open");
    assert_eq!(seen.state(), job::State::Queued);

    // Whichever of them the client uses, it has to change once.
    first_way.abort();
    client.get_job(&ingest).await.expect("goes on");
    let (third, third_way) = way(service).await;
    let others = YotoClient::connect(&format!("{first},{second},{third}")).await;
    second_way.abort();
    let listed = others.expect("two answer").list_subjects().await;
    assert_eq!(listed.expect("the third answers").len(), 1);
    third_way.abort();

    let none = YotoClient::connect(&both).await.expect_err("both are gone");
    assert!(none.to_string().contains(&both), "{none}");
    direct.cancel_job(&ingest).await.expect("cancels");
    running.serving.abort();
}

#[tokio::test]
async fn a_watch_goes_on_after_what_it_has_seen() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let running = serve(folder.path()).await;
    let (service, direct) = (running.address, &running.direct);
    let subject = direct.create_subject("Ada", "").await.expect("creates");

    // The first connection goes to either of them.
    for gone in 0..2 {
        let mut ways = [way(service).await, way(service).await];
        let both = format!("{},{}", ways[0].0, ways[1].0);
        let client = YotoClient::connect(&both).await.expect("connects");
        let poses = UploadFile {
            path: "poses.json".into(),
            source: FileSource::Memory(b"{}".to_vec()),
        };
        let uploaded = direct.upload_capture(&subject.name, vec![poses], |_| {});
        let ingest = uploaded.await.expect("uploads").ingest_job;
        let mut watch = client.watch_job(&ingest);
        let seen = watch.next().await.expect("answers").expect("is open");
        ways[gone].1.abort();
        direct.cancel_job(&ingest).await.expect("cancels");
        let ended = watch.next().await.expect("goes on").expect("a change");
        assert_eq!(ended.state(), job::State::Cancelled);
        assert!(ended.sequence > seen.sequence, "nothing is told twice");
        assert!(watch.next().await.expect("has ended").is_none());
        for (_, way) in &mut ways {
            way.abort();
        }
    }
    running.serving.abort();
}
