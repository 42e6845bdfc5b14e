//! What a client can do to the others of a coordinator: its memory and the latency of `GetJob` under calls that ask for
//! much. Each attack has a coordinator of its own.

use super::fake::{Lessee, Scene};
use super::measure::Latencies;
use super::mib;
use super::served::Served;
use anyhow::{Context, Result};
use bytes::Bytes;
use futures::future::join_all;
use futures::{StreamExt, stream};
use http_body::Frame;
use http_body_util::StreamBody;
use std::future::{Future, poll_fn};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tonic::body::Body;
use tonic::codegen::Service;
use tonic::codegen::http::{Request, header};
use tonic::transport::Channel;
use tonic::{Code, Status};
use yoto_proto::limits::MESSAGE_BYTES;
use yoto_proto::v1::job_service_client::JobServiceClient;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    Between, BodyPose, Camera, GetJobRequest, JobKind, Orbit, Progress, View, ViewList,
    WatchJobRequest,
};
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_proto::worker::v1::{HeartbeatRequest, TakeRangeRequest};

/// Time between two reads of the memory, and between two calls of `GetJob`.
const EVERY: Duration = Duration::from_millis(20);
/// Time for which a coordinator is watched after an attack has ended.
const AFTER: Duration = Duration::from_secs(5);
/// Bytes before each message: the compression flag and the length.
const HEADER_BYTES: usize = 5;
/// The path of `CreateUpload`.
const CREATE_UPLOAD: &str = "/yoto.v1.UploadService/CreateUpload";

/// Runs all attacks, and prints a row for each.
///
/// # Errors
/// When a coordinator does not start, or does not answer `GetJob`.
pub async fn run() -> Result<()> {
    println!("MiB before, at most, after; GetJob beside it; what the attacker was answered");
    let stage = Stage::start().await?;
    let announced = announced(MESSAGE_BYTES);
    let streams = stage.streams(4096, &announced, false, Duration::from_secs(10));
    stage
        .measured("4,096 streams that announce 16 MiB", streams)
        .await?;
    let stage = Stage::start().await?;
    let message = entries();
    let many = stage.streams(4, &message, true, Duration::from_secs(10));
    stage
        .measured("4 messages of 8,388,608 empty entries", many)
        .await?;
    let stage = Stage::start().await?;
    stage
        .measured("1,000,000 pictures", stage.pictures())
        .await?;
    let stage = Stage::start().await?;
    stage
        .measured("TakeRange of 4,294,967,295", stage.range())
        .await?;
    let stage = Stage::start().await?;
    stage
        .measured("40 watchers of a job of 4.7 MB", stage.watchers())
        .await?;
    Ok(())
}

/// A coordinator with a running render.
struct Stage {
    served: Served,
    scene: Scene,
    lessee: Lessee,
}

impl Stage {
    async fn start() -> Result<Self> {
        let served = Served::start(false)?;
        let scene = Scene::make(served.connect().await?, &served.data()).await?;
        scene.queue_render().await?;
        let worker = scene.register(JobKind::Render).await?;
        let lessee = scene.lease(&worker).await?;
        Ok(Self {
            served,
            scene,
            lessee,
        })
    }

    /// Runs `attack` beside calls of `GetJob` on another connection.
    async fn measured(
        &self,
        name: &str,
        attack: impl Future<Output = Result<String>>,
    ) -> Result<()> {
        let before = self.served.resident_bytes()?;
        let (most, ended) = (AtomicU64::new(before), AtomicBool::new(false));
        let gets = Latencies::new("GetJob");
        let mut jobs = JobServiceClient::new(self.served.connect().await?);
        let get = async {
            while !ended.load(Ordering::Relaxed) {
                let name = self.lessee.claim.job.clone();
                gets.time(jobs.get_job(GetJobRequest { name })).await?;
                tokio::time::sleep(EVERY).await;
            }
            Ok::<_, anyhow::Error>(())
        };
        let watch = async {
            while !ended.load(Ordering::Relaxed) {
                most.fetch_max(self.served.resident_bytes()?, Ordering::Relaxed);
                tokio::time::sleep(EVERY).await;
            }
            Ok::<_, anyhow::Error>(())
        };
        let attack = async {
            let told = attack.await;
            tokio::time::sleep(AFTER).await;
            ended.store(true, Ordering::Relaxed);
            told
        };
        let ((), (), told) = tokio::try_join!(get, watch, attack)?;
        let after = self.served.resident_bytes()?;
        let most = most.into_inner();
        println!(
            "{:>7.0} {:>7.0} {:>7.0} | {gets} | {name}: {told}",
            mib(before),
            mib(most),
            mib(after)
        );
        Ok(())
    }

    /// Opens `count` calls of `CreateUpload` on one connection, each of which sends `message` and ends, or stays open.
    async fn streams(
        &self,
        count: usize,
        message: &Bytes,
        ends: bool,
        time: Duration,
    ) -> Result<String> {
        let channel = self.served.connect().await?;
        let call = || {
            let (mut channel, message) = (channel.clone(), message.clone());
            async move {
                let sent = stream::once(async { Ok::<_, Status>(Frame::data(message)) });
                let body = match ends {
                    true => Body::new(StreamBody::new(sent)),
                    false => Body::new(StreamBody::new(sent.chain(stream::pending()))),
                };
                let request = Request::post(CREATE_UPLOAD)
                    .header(header::CONTENT_TYPE, "application/grpc")
                    .header(header::TE, "trailers")
                    .body(body)?;
                let answer = async {
                    poll_fn(|context| channel.poll_ready(context)).await?;
                    channel.call(request).await
                };
                let answer = tokio::time::timeout(time, answer);
                Ok::<_, anyhow::Error>(match answer.await {
                    Err(_) => "none".to_owned(),
                    Ok(Err(error)) => format!("{error}"),
                    Ok(Ok(answer)) => match Status::from_header_map(answer.headers()) {
                        Some(status) => format!("{:?}", status.code()),
                        None => "accepted".to_owned(),
                    },
                })
            }
        };
        let answers: Vec<String> = join_all((0..count).map(|_| call()))
            .await
            .into_iter()
            .collect::<Result<_>>()?;
        let mut counts = std::collections::BTreeMap::<&str, usize>::new();
        for answer in &answers {
            *counts.entry(answer).or_default() += 1;
        }
        let told = counts
            .iter()
            .map(|(answer, count)| format!("{count} {answer}"));
        Ok(told.collect::<Vec<_>>().join(", "))
    }

    /// Orders a render of 10,000 views times 100 mixtures.
    async fn pictures(&self) -> Result<String> {
        let mut spec = self.scene.render(What::Orbit(Orbit {
            frame: 0,
            views: 10_000,
            size: 16,
        }));
        spec.between = Some(Between {
            subject: spec.subject.clone(),
            shares: (0..100).map(|it| it as f32 / 100.0).collect(),
        });
        Ok(match self.scene.queue(spec).await {
            Ok(_) => "accepted".to_owned(),
            Err(error) => format!("{error:#}"),
        })
    }

    /// Commits files, and asks for a range of as many pictures as fit into the field.
    async fn range(&self) -> Result<String> {
        for number in 0..4 {
            self.scene.commit_file(&self.lessee, number).await?;
        }
        let began = Instant::now();
        let request = TakeRangeRequest {
            claim: Some(self.lessee.claim.clone()),
            pictures: u32::MAX,
            ..TakeRangeRequest::default()
        };
        let mut workers = WorkerServiceClient::new(self.served.connect().await?);
        let taken = workers.take_range(request).await;
        let told = taken.map_or_else(|it| it.code(), |_| Code::Ok);
        Ok(format!(
            "{told:?} after {:.0} ms",
            began.elapsed().as_secs_f64() * 1e3
        ))
    }

    /// Watches a running job with a long order, and never reads, while its worker reports.
    async fn watchers(&self) -> Result<String> {
        let views = vec![view(); 9000];
        self.scene
            .queue(self.scene.render(What::Views(ViewList { views })))
            .await?;
        let worker = self.scene.register(JobKind::Render).await?;
        let lessee = self.scene.lease(&worker).await?;
        let mut watches = Vec::new();
        for _ in 0..40 {
            let mut jobs = JobServiceClient::new(self.served.connect().await?);
            let request = WatchJobRequest {
                name: lessee.claim.job.clone(),
                after_sequence: 0,
            };
            watches.push(jobs.watch_job(request).await?);
        }
        self.beat(&lessee, Duration::from_secs(20)).await?;
        Ok(format!("{} open", watches.len()))
    }

    /// Reports on a job twice per second for `time`.
    async fn beat(&self, lessee: &Lessee, time: Duration) -> Result<()> {
        let channel: Channel = self.served.connect().await?;
        let mut workers = WorkerServiceClient::new(channel);
        let until = Instant::now() + time;
        let mut step = 0;
        while Instant::now() < until {
            step += 1;
            let request = HeartbeatRequest {
                claim: Some(lessee.claim.clone()),
                progress: Some(Progress {
                    step,
                    ..Progress::default()
                }),
            };
            workers.heartbeat(request).await.context("a heartbeat")?;
            tokio::time::sleep(Duration::from_millis(500)).await;
        }
        Ok(())
    }
}

/// The beginning of a message of `bytes` bytes.
fn announced(bytes: usize) -> Bytes {
    let mut header = vec![0];
    header.extend((bytes as u32).to_be_bytes());
    Bytes::from(header)
}

/// The longest message, of empty entries of `CreateUploadRequest.files`.
fn entries() -> Bytes {
    let mut message = Vec::with_capacity(MESSAGE_BYTES + HEADER_BYTES);
    message.extend(announced(MESSAGE_BYTES));
    message.extend([0x12, 0].repeat(MESSAGE_BYTES / 2));
    Bytes::from(message)
}

/// A pose of 24 joints and a camera.
fn view() -> View {
    let intrinsics = vec![500.0, 0.0, 32.0, 0.0, 500.0, 32.0, 0.0, 0.0, 1.0];
    let extrinsics = (0..16).map(|at| if at % 5 == 0 { 1.0 } else { 0.0 });
    View {
        pose: Some(BodyPose {
            rotations: vec![0.125; 72],
            translation: vec![0.0; 3],
        }),
        camera: Some(Camera {
            width: 64,
            height: 64,
            intrinsics,
            extrinsics: extrinsics.collect(),
        }),
    }
}
