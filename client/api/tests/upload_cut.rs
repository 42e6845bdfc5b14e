//! An upload over a connection that is cut again and again, to a service that restarts meanwhile.
//!
//! The service refuses a byte that was committed before, as it refuses one that leaves a gap. The client asks again only a
//! few times in all, so an upload that ends well has continued where it was.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::HashMap;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use yoto_client::{FileSource, UploadFile, YotoClient};
use yoto_proto::orders::LEVEL;
use yoto_proto::v1::upload_service_client::UploadServiceClient;
use yoto_proto::v1::{GetUploadRequest, JobKind, WorkerDevice, capture};
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_proto::worker::v1::{InputFile, LeaseJobRequest, RegisterWorkerRequest};
use yoto_server::{Coordinator, ServerConfig};

/// Number of connections that are cut.
const CUTS: usize = 200;
/// Number of cuts after which the service restarts.
const RESTART_AFTER: usize = 100;
/// One in this many cuts is a reset: bytes on their way are lost with the connection. After the others, what
/// was carried arrives.
const RESETS: usize = 10;
/// Time in which what was carried arrives.
const ARRIVAL: Duration = Duration::from_millis(10);
/// Longest run of bytes that a cut connection carries, from the client.
const LONGEST: u64 = 128 << 10;
/// Bytes that are committed at once: several of them pass before a cut, or none.
const PART_BYTES: u64 = 32 << 10;
/// Bytes of the largest file: more than all cut connections carry.
const VIDEO_BYTES: usize = (CUTS as u64 * LONGEST * 3 / 5) as usize;

/// A service on a folder.
struct Service {
    coordinator: Coordinator,
    address: SocketAddr,
    stop: oneshot::Sender<()>,
    serving: JoinHandle<()>,
}

impl Service {
    async fn start(folder: &Path) -> Self {
        let mut config = ServerConfig::new(folder);
        config.shutdown_grace = Duration::from_millis(50);
        config.upload.part_bytes = PART_BYTES;
        let coordinator = Coordinator::open(config).await.expect("opens");
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
        let address = listener.local_addr().expect("has an address");
        let (stop, stopped) = oneshot::channel();
        let incoming = yoto_server::tcp(listener);
        let serving = coordinator.serve(incoming, async {
            // Without a sender it stops as well.
            let _ = stopped.await;
        });
        let serving = tokio::spawn(async move { serving.await.expect("serves") });
        Self {
            coordinator,
            address,
            stop,
            serving,
        }
    }

    async fn stop(self) {
        drop(self.stop);
        self.serving.await.expect("no panic");
        self.coordinator.close().await;
    }

    async fn client(&self) -> YotoClient {
        let server = format!("http://{}", self.address);
        YotoClient::connect(&server).await.expect("connects")
    }
}

/// A way to the service that breaks.
#[derive(Clone)]
struct Proxy {
    service: Arc<Mutex<SocketAddr>>,
    cuts: Arc<AtomicUsize>,
}

impl Proxy {
    /// Forwards connections, of which it cuts the first [`CUTS`] at random places. Returns its address.
    async fn start(&self, seed: u64) -> SocketAddr {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
        let address = listener.local_addr().expect("has an address");
        let proxy = self.clone();
        tokio::spawn(async move {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            while let Ok((client, _)) = listener.accept().await {
                let target = *proxy.service.lock().expect("no panic");
                // While the service restarts, nothing is there to be cut.
                let Ok(server) = TcpStream::connect(target).await else {
                    continue;
                };
                let is_cut = proxy.cuts.load(Ordering::SeqCst) < CUTS;
                let carried = match is_cut {
                    true => random.random_range(0..LONGEST),
                    false => u64::MAX,
                };
                tokio::spawn(proxy.clone().carry(client, server, carried));
            }
        });
        address
    }

    /// Forwards in both directions until the client has sent `carried` bytes, then drops both ends.
    async fn carry(self, client: TcpStream, server: TcpStream, carried: u64) {
        let (from_client, mut to_client) = client.into_split();
        let (mut from_server, mut to_server) = server.into_split();
        let mut limited = from_client.take(carried);
        tokio::select! {
            _ = tokio::io::copy(&mut limited, &mut to_server) => {}
            _ = tokio::io::copy(&mut from_server, &mut to_client) => {}
        }
        if limited.limit() == 0 {
            let number = self.cuts.fetch_add(1, Ordering::SeqCst);
            if !number.is_multiple_of(RESETS) {
                // The service reads to the end, and closes its own. HTTP/2 drops a call whose first bytes
                // arrive together with the end of its connection.
                tokio::time::sleep(ARRIVAL).await;
                let _ = to_server.shutdown().await;
                let _ = tokio::io::copy(&mut from_server, &mut tokio::io::sink()).await;
            }
        }
    }
}

fn noise(seed: u64, bytes: usize) -> Vec<u8> {
    let mut noise = vec![0; bytes];
    ChaCha8Rng::seed_from_u64(seed).fill(&mut noise[..]);
    noise
}

fn files() -> Vec<UploadFile> {
    let file = |path: &str, bytes: Vec<u8>| UploadFile {
        path: path.into(),
        source: FileSource::Memory(bytes),
    };
    let mut files = vec![
        file("video.mp4", noise(1, VIDEO_BYTES)),
        file("empty", Vec::new()),
    ];
    for number in 0..40 {
        let bytes = noise(number, 50 * number as usize * number as usize);
        files.push(file(&format!("masks/{number:06}.png"), bytes));
    }
    files.push(file("poses.json", b"{}".to_vec()));
    files
}

/// Asks for what was committed until the upload is finished, and checks that it never falls.
async fn observe(address: Arc<Mutex<SocketAddr>>, name: String) -> u64 {
    let mut last = 0;
    loop {
        let target = *address.lock().expect("no panic");
        let connected = UploadServiceClient::connect(format!("http://{target}")).await;
        if let Ok(mut service) = connected {
            let request = || GetUploadRequest {
                name: name.clone(),
                stop_writer: false,
            };
            while let Ok(upload) = service.get_upload(request()).await {
                let upload = upload.into_inner();
                let now = upload.committed_bytes;
                assert!(now >= last, "{last} bytes were acknowledged, now {now}");
                last = now;
                if now == upload.bytes {
                    return last;
                }
                tokio::time::sleep(Duration::from_millis(5)).await;
            }
        }
        // The service restarts.
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_upload_survives_200_cuts_and_a_restart_and_continues_where_it_was() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut service = Service::start(folder.path()).await;
    let direct = service.client().await;
    let subject = direct
        .create_subject("Ada", "")
        .await
        .expect("creates")
        .name;
    let address = Arc::new(Mutex::new(service.address));
    let proxy = Proxy {
        service: Arc::clone(&address),
        cuts: Arc::default(),
    };
    let way = proxy.start(7).await;
    let addresses = yoto_client::Addresses::parse(&way.to_string()).expect("is an address");
    let client = YotoClient::new(addresses.connect_lazy());
    let total: u64 = files().iter().map(bytes).sum();
    let upload = tokio::spawn({
        let subject = subject.clone();
        async move {
            let mut told = 0;
            let uploaded = client
                .upload_capture(&subject, files(), |more| told += more)
                .await;
            (uploaded, told)
        }
    });

    let opened = opened(&direct, &subject).await;
    let observed = tokio::spawn(observe(Arc::clone(&address), opened));
    while proxy.cuts.load(Ordering::SeqCst) < RESTART_AFTER {
        assert!(!upload.is_finished(), "the upload has failed");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    service.stop().await;
    service = Service::start(folder.path()).await;
    *address.lock().expect("no panic") = service.address;

    let (uploaded, told) = upload.await.expect("no panic");
    let capture = uploaded.expect("is uploaded");
    assert_eq!(capture.state(), capture::State::Ingesting);
    assert_eq!(told, total);
    assert_eq!(
        observed.await.expect("nothing acknowledged was lost"),
        total
    );
    assert_eq!(proxy.cuts.load(Ordering::SeqCst), CUTS);
    let known = service.client().await.get_subject(&subject).await;
    assert_eq!(known.expect("is there").captures.len(), 1, "one upload");
    let stored = stored(&service, folder.path()).await;
    for file in files() {
        let FileSource::Memory(sent) = file.source else {
            panic!("all files are in memory")
        };
        assert!(stored[&file.path] == sent, "{} differs", file.path);
    }
    service.stop().await;
}

fn bytes(file: &UploadFile) -> u64 {
    match &file.source {
        FileSource::Memory(bytes) => bytes.len() as u64,
        FileSource::Disk(_) => 0,
    }
}

/// Starts a proxy to `service` that forwards `bytes` bytes from a client, then stalls. Returns its address.
async fn stuck_after(bytes: u64, service: SocketAddr) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
    let address = listener.local_addr().expect("has an address");
    tokio::spawn(async move {
        let (client, _) = listener.accept().await.expect("accepts");
        let server = TcpStream::connect(service).await.expect("connects");
        let (from_client, mut to_client) = client.into_split();
        let (mut from_server, mut to_server) = server.into_split();
        let mut limited = from_client.take(bytes);
        let forth = async {
            let _ = tokio::io::copy(&mut limited, &mut to_server).await;
            std::future::pending::<()>().await;
        };
        let back = tokio::io::copy(&mut from_server, &mut to_client);
        let _ = tokio::join!(forth, back);
    });
    address
}

/// Starts a service and an upload of a new subject, whose process ends after a part. Returns the service, a client, and
/// the names of the subject and the upload.
async fn half_uploaded(folder: &Path) -> (Service, YotoClient, String, String) {
    let service = Service::start(folder).await;
    let direct = service.client().await;
    let subject = direct
        .create_subject("Ada", "")
        .await
        .expect("creates")
        .name;
    let way = stuck_after(VIDEO_BYTES as u64 / 2, service.address).await;
    // A runtime of its own ends with everything in it, as a process would.
    let process = tokio::runtime::Runtime::new().expect("starts");
    let first = process.spawn({
        let (subject, server) = (subject.clone(), format!("http://{way}"));
        async move {
            let client = YotoClient::connect(&server).await.expect("connects");
            client.upload_capture(&subject, files(), |_| {}).await
        }
    });
    let upload = opened(&direct, &subject).await;
    while committed(&service, &upload, false).await <= VIDEO_BYTES as u64 / 4 {
        assert!(!first.is_finished(), "the upload has failed");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    process.shutdown_background();
    (service, direct, subject, upload)
}

/// The content of each file of the only upload, put together from the objects of its ingest job.
async fn stored(service: &Service, folder: &Path) -> HashMap<String, Vec<u8>> {
    let server = format!("http://{}", service.address);
    let workers = WorkerServiceClient::connect(server).await;
    let mut workers = workers.expect("connects");
    let request = RegisterWorkerRequest {
        display_name: "reader".into(),
        device: Some(WorkerDevice::default()),
        kinds: vec![JobKind::Ingest.into()],
        order_level: LEVEL,
        ..RegisterWorkerRequest::default()
    };
    let registered = workers.register_worker(request).await.expect("registers");
    let request = LeaseJobRequest {
        worker: registered.into_inner().worker,
        ..LeaseJobRequest::default()
    };
    let lease = workers.lease_job(request).await.expect("answers");
    let lease = lease.into_inner().lease.expect("the job waits");
    let inputs = lease.inputs.expect("has inputs");
    let read = |key: &str| std::fs::read(folder.join("objects").join(key)).expect("is stored");
    let parts: Vec<Vec<u8>> = inputs.parts.iter().map(|part| read(&part.key)).collect();
    let whole = |file: InputFile| {
        let pieces = file.pieces.iter().map(|piece| {
            let start = piece.start as usize;
            &parts[piece.part as usize][start..start + piece.bytes as usize]
        });
        (file.path, pieces.collect::<Vec<_>>().concat())
    };
    inputs.files.into_iter().map(whole).collect()
}

/// Committed bytes of an upload; with `stop_writer`, after its writer has ended.
async fn committed(service: &Service, upload: &str, stop_writer: bool) -> u64 {
    let server = format!("http://{}", service.address);
    let uploads = UploadServiceClient::connect(server).await;
    let request = GetUploadRequest {
        name: upload.to_owned(),
        stop_writer,
    };
    let known = uploads.expect("connects").get_upload(request).await;
    known.expect("is there").into_inner().committed_bytes
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn bytes_that_the_disk_has_lost_are_sent_again() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (service, direct, subject, upload) = half_uploaded(folder.path()).await;
    committed(&service, &upload, true).await;
    let parts = folder.path().join("objects").join(&upload).join("parts");
    let mut parts = std::fs::read_dir(parts).expect("has parts");
    let part = parts.next().expect("has one").expect("can be seen").path();
    let part = std::fs::File::options().write(true).open(part);
    part.and_then(|it| it.set_len(1000))
        .expect("the disk loses bytes");
    let uploaded = direct.upload_capture(&subject, files(), |_| {}).await;
    let capture = uploaded.expect("is uploaded");
    assert_ne!(capture.state(), capture::State::Uploading);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn another_process_goes_on_with_the_upload_of_one_that_has_ended() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (service, direct, subject, _) = half_uploaded(folder.path()).await;
    let mut told = Vec::new();
    let uploaded = direct
        .upload_capture(&subject, files(), |more| told.push(more))
        .await;
    let capture = uploaded.expect("is uploaded");
    assert!(
        told[0] > VIDEO_BYTES as u64 / 4,
        "{} bytes were there",
        told[0]
    );
    assert_eq!(
        told.iter().sum::<u64>(),
        files().iter().map(bytes).sum::<u64>()
    );
    let known = direct.get_subject(&subject).await.expect("is there");
    assert_eq!(known.captures, std::slice::from_ref(&capture.name));
    // The same files once more are a capture of their own.
    let again = direct.upload_capture(&subject, files(), |_| {}).await;
    assert_ne!(again.expect("is uploaded").name, capture.name);
    service.stop().await;
}

/// The upload of the subject, once it is opened.
async fn opened(client: &YotoClient, subject: &str) -> String {
    loop {
        let known = client.get_subject(subject).await.expect("is there");
        if let Some(capture) = known.captures.first() {
            return capture.replace("captures/", "uploads/");
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}
