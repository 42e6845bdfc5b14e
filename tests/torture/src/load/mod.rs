//! A coordinator in a process of its own under the load of a cluster: a thousand polling workers, a
//! hundred running jobs, a queue of twenty thousand, and five hundred watchers of one of them.
//!
//! The workers are only calls: nothing is computed.

pub mod attacks;
mod fake;
mod measure;
mod served;

use anyhow::{Context, Result};
use fake::{Lessee, Scene};
use futures::future::try_join_all;
use measure::Latencies;
use served::Served;
use std::time::{Duration, Instant};
use tonic::transport::Channel;
use yoto_proto::v1::job_service_client::JobServiceClient;
use yoto_proto::v1::{
    GetJobRequest, JobKind, ListJobsRequest, PauseJobsRequest, Progress, WatchJobRequest,
};
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_proto::worker::v1::{HeartbeatRequest, LeaseJobRequest};

/// Sizes of the load.
#[derive(Debug)]
pub struct Plan {
    /// Workers that ask for jobs, each every `poll`.
    pub workers: usize,
    /// Time between two requests of a worker.
    pub poll: Duration,
    /// Jobs that run and report, each every `beat`.
    pub running: usize,
    /// Time between two reports on a job.
    pub beat: Duration,
    /// Jobs in the queue.
    pub queued: usize,
    /// Watchers of one running job.
    pub watchers: usize,
    /// Duration of each measurement.
    pub time: Duration,
    /// Whether the rows are in PostgreSQL.
    pub postgres: bool,
}

impl Default for Plan {
    fn default() -> Self {
        Self {
            workers: 1000,
            poll: Duration::from_secs(2),
            running: 100,
            beat: Duration::from_millis(500),
            queued: 20_000,
            watchers: 500,
            time: Duration::from_secs(20),
            postgres: false,
        }
    }
}

/// A service under load.
pub struct Load {
    plan: Plan,
    served: Served,
    channel: Channel,
    scene: Scene,
}

impl Load {
    /// Starts a coordinator without a worker in a folder of its own.
    ///
    /// # Errors
    /// When it does not start.
    pub async fn start(plan: Plan) -> Result<Self> {
        let served = Served::start(plan.postgres)?;
        let channel = served.connect().await?;
        println!(
            "{:>9.1} MiB resident when idle",
            mib(served.resident_bytes()?)
        );
        let scene = Scene::make(channel.clone(), &served.data()).await?;
        Ok(Self {
            plan,
            served,
            channel,
            scene,
        })
    }

    /// Fills the queue, and has some of its jobs run.
    ///
    /// # Errors
    /// When a call fails.
    pub async fn run(self) -> Result<()> {
        let began = Instant::now();
        for part in 0..self.plan.queued.div_ceil(100) {
            let left = self.plan.queued - 100 * part;
            try_join_all((0..left.min(100)).map(|_| self.scene.queue_render())).await?;
        }
        let rate = self.plan.queued as f64 / began.elapsed().as_secs_f64();
        println!(
            "{rate:>9.0} jobs queued per second, {} in all",
            self.plan.queued
        );
        let mut lessees = Vec::new();
        let leasing = Latencies::new("lease of a job");
        for _ in 0..self.plan.running {
            let worker = self.scene.register(JobKind::Render).await?;
            lessees.push(leasing.time(self.scene.lease(&worker)).await?);
        }
        println!("{leasing}");
        let pause = PauseJobsRequest {
            kind: JobKind::Render.into(),
            reason: "a measurement".into(),
        };
        JobServiceClient::new(self.channel.clone())
            .pause_jobs(pause)
            .await?;
        self.polled(&lessees).await?;
        self.listed().await?;
        self.watched(&lessees).await?;
        for trains in [false, true] {
            self.saturated(&lessees, trains).await?;
        }
        println!(
            "{:>9.1} MiB resident in the end",
            mib(self.served.resident_bytes()?)
        );
        Ok(())
    }

    /// All workers poll, all running jobs report.
    async fn polled(&self, lessees: &[Lessee]) -> Result<()> {
        let polls = Latencies::new("request for a job without success");
        let beats = Latencies::new("heartbeat");
        let figures = Latencies::new("heartbeat with figures of a training");
        let gets = Latencies::new("GetJob");
        let until = Instant::now() + self.plan.time;
        let mut workers = Vec::new();
        for _ in 0..self.plan.workers {
            workers.push(self.scene.register(JobKind::Render).await?);
        }
        let poll = |number: usize, worker: String| {
            let (channel, polls) = (self.channel.clone(), &polls);
            async move {
                tokio::time::sleep(
                    self.plan
                        .poll
                        .mul_f64(number as f64 / self.plan.workers as f64),
                )
                .await;
                while Instant::now() < until {
                    let request = LeaseJobRequest {
                        worker: worker.clone(),
                        request_id: format!("{number} {:?}", Instant::now()),
                        help: true,
                    };
                    let mut client = WorkerServiceClient::new(channel.clone());
                    polls.time(client.lease_job(request)).await?;
                    tokio::time::sleep(self.plan.poll).await;
                }
                Ok::<_, anyhow::Error>(())
            }
        };
        let polling = workers
            .into_iter()
            .enumerate()
            .map(|(number, worker)| poll(number, worker));
        let beating = lessees.iter().enumerate().map(|(number, it)| {
            let trains = number % 2 == 0;
            let latencies = if trains { &figures } else { &beats };
            self.beat(it, latencies, trains, self.plan.beat, until)
        });
        let getting = lessees.iter().map(|it| self.get(it, &gets, until));
        tokio::try_join!(
            try_join_all(polling),
            try_join_all(beating),
            try_join_all(getting)
        )?;
        print!("{polls}\n{beats}\n{figures}\n{gets}\n");
        Ok(())
    }

    /// All running jobs report without a pause: how many reports per second there can be.
    async fn saturated(&self, lessees: &[Lessee], trains: bool) -> Result<()> {
        let beats = Latencies::new(match trains {
            false => "heartbeat without a pause",
            true => "heartbeat with figures without a pause",
        });
        let until = Instant::now() + self.plan.time / 2;
        let beating = lessees
            .iter()
            .map(|it| self.beat(it, &beats, trains, Duration::ZERO, until));
        try_join_all(beating).await?;
        let rate = beats.count() as f64 / (self.plan.time / 2).as_secs_f64();
        println!("{beats}\n{rate:>9.0} of them per second");
        Ok(())
    }

    /// Reports on a job `every` so often, with figures as one that `trains`.
    async fn beat(
        &self,
        lessee: &Lessee,
        beats: &Latencies,
        trains: bool,
        every: Duration,
        until: Instant,
    ) -> Result<()> {
        let mut client = WorkerServiceClient::new(self.channel.clone());
        let mut step = 0;
        while Instant::now() < until {
            step += 1;
            let request = HeartbeatRequest {
                claim: Some(lessee.claim.clone()),
                progress: Some(Progress {
                    step,
                    loss: trains.then_some(0.1),
                    ..Progress::default()
                }),
            };
            beats.time(client.heartbeat(request)).await?;
            tokio::time::sleep(every).await;
        }
        Ok(())
    }

    async fn get(&self, lessee: &Lessee, gets: &Latencies, until: Instant) -> Result<()> {
        let mut client = JobServiceClient::new(self.channel.clone());
        while Instant::now() < until {
            let request = GetJobRequest {
                name: lessee.claim.job.clone(),
            };
            gets.time(client.get_job(request)).await?;
            tokio::time::sleep(Duration::from_secs(1)).await;
        }
        Ok(())
    }

    /// Pages of the list, one after another.
    async fn listed(&self) -> Result<()> {
        let lists = Latencies::new("page of 100 of the list");
        let mut client = JobServiceClient::new(self.channel.clone());
        let mut page_token = String::new();
        for _ in 0..50 {
            let request = ListJobsRequest {
                page_size: 100,
                page_token,
                ..ListJobsRequest::default()
            };
            page_token = lists
                .time(client.list_jobs(request))
                .await?
                .into_inner()
                .next_page_token;
        }
        println!("{lists}");
        Ok(())
    }

    /// Many watch one job while all report.
    async fn watched(&self, lessees: &[Lessee]) -> Result<()> {
        let beats = Latencies::new("heartbeat beside 500 watchers");
        let until = Instant::now() + self.plan.time;
        let first = lessees.first().context("a running job")?;
        let watch = || {
            let mut client = JobServiceClient::new(self.channel.clone());
            let request = WatchJobRequest {
                name: first.claim.job.clone(),
                after_sequence: 0,
            };
            async move {
                let mut states = client.watch_job(request).await?.into_inner();
                let mut seen = 0_usize;
                while let Ok(next) = tokio::time::timeout_at(until.into(), states.message()).await {
                    next?.context("the job goes on")?;
                    seen += 1;
                }
                Ok::<_, anyhow::Error>(seen)
            }
        };
        let watching = try_join_all((0..self.plan.watchers).map(|_| watch()));
        let beating = try_join_all(
            lessees
                .iter()
                .map(|it| self.beat(it, &beats, false, self.plan.beat, until)),
        );
        let (seen, _) = tokio::try_join!(watching, beating)?;
        println!("{beats}");
        let fewest = seen.iter().min().copied().unwrap_or_default();
        let made = beats.count() / lessees.len();
        println!(
            "{fewest:>9} states at least seen by each of {} watchers, of {made}",
            seen.len()
        );
        Ok(())
    }
}

fn mib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}
