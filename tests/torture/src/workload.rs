//! What clients ask of the service meanwhile: people, models, short trainings, pictures, measurements,
//! exports, cancels and deletions.

use super::calls::{Calls, is_transient};
use super::history::{Event, History};
use super::proxy::Proxy;
use anyhow::{Context, Result, bail, ensure};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tonic::Code;
use yoto_client::{ClientError, UploadFile, YotoClient};
use yoto_proto::protocols::HELD_OUT;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    CreateJobRequest, Distillation, EvaluateSpec, ExportForm, ExportSpec, Job, JobKind,
    JobPriority, JobSpec, Orbit, RenderSpec, TrainSpec, capture, job, job_spec,
};
use yoto_synthetic::SyntheticPerson;
use yoto_tests::people::write_capture;
use yoto_tests::upload::files;

/// Frames of a capture, and their edge in pixels.
const FRAMES: usize = 12;
const SIZE: u32 = 32;
/// Number of open jobs from which on the load adds no more.
const OPEN: usize = 4;
/// Longest life of a job.
const PATIENCE: Duration = Duration::from_secs(150);

/// A person in the service, and a model of it that was trained.
#[derive(Debug, Clone)]
pub(crate) struct Avatar {
    /// `subjects/{id}`.
    pub subject: String,
    /// `models/{id}`.
    pub model: String,
}

/// A client that keeps the service busy.
pub(crate) struct Workload {
    calls: Calls,
    /// Uploads go through a proxy that may cut them.
    proxy: Proxy,
    history: Arc<History>,
    /// The files of each synthetic person.
    captures: Vec<Vec<UploadFile>>,
    /// Jobs that were asked for, with their requests.
    asked: Mutex<Vec<(CreateJobRequest, String)>>,
}

impl Workload {
    /// A load whose people are made in `folder`.
    ///
    /// # Errors
    /// When their pictures can't be written.
    pub(crate) fn new(
        calls: Calls,
        proxy: Proxy,
        history: Arc<History>,
        folder: &Path,
    ) -> Result<Self> {
        let mut captures = Vec::new();
        for (number, person) in SyntheticPerson::cast(2, 7).iter().enumerate() {
            let dir = folder.join(format!("person-{number}"));
            write_capture(person, FRAMES, SIZE, &dir)?;
            captures.push(files(&dir)?);
        }
        Ok(Self {
            calls,
            proxy,
            history,
            captures,
            asked: Mutex::default(),
        })
    }

    /// The jobs that were asked for, with their requests.
    pub(crate) fn asked(&self) -> Vec<(CreateJobRequest, String)> {
        let asked = self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        asked.clone()
    }

    /// Bytes of an upload.
    pub(crate) fn upload_bytes(&self) -> u64 {
        let files = self.captures.iter().flatten();
        let bytes = files.map(|file| match &file.source {
            yoto_client::FileSource::Memory(bytes) => bytes.len() as u64,
            yoto_client::FileSource::Disk(_) => 0,
        });
        bytes.sum::<u64>() / self.captures.len().max(1) as u64
    }

    /// Uploads a person and waits until it can be trained; again while the connection breaks.
    ///
    /// # Errors
    /// When the service refuses it.
    pub(crate) async fn person(&self, number: usize) -> Result<String> {
        let name = format!("person {}", uuid::Uuid::new_v4().simple());
        let subject = self.calls.create_subject(&name).await?;
        let files = &self.captures[number % self.captures.len()];
        let began = Instant::now();
        let uploaded = loop {
            let address = format!("http://{}", self.proxy.address());
            let failure = match YotoClient::connect(&address).await {
                Ok(client) => match client.upload_capture(&subject, files.clone(), |_| {}).await {
                    Ok(uploaded) => break uploaded,
                    Err(failure) => failure,
                },
                Err(failure) => failure,
            };
            let again = match &failure {
                ClientError::Connect { .. } => true,
                ClientError::Refused(refusal) => is_transient(refusal.code()),
                _ => false,
            };
            if !again || began.elapsed() > PATIENCE {
                return Err(failure).context("uploading");
            }
            tokio::time::sleep(Duration::from_millis(200)).await;
        };
        let (capture, job) = (uploaded.name, uploaded.ingest_job);
        self.history.record(Event::Uploaded {
            capture: capture.clone(),
        })?;
        self.history.record(Event::Acknowledged {
            job: job.clone(),
            request: String::new(),
        })?;
        let ended = self.wait(&job).await?;
        let state = self.calls.capture(&capture).await?.state();
        ensure!(
            state == capture::State::Ready,
            "{capture} is {} after {ended:?}",
            state.as_str_name()
        );
        Ok(subject)
    }

    /// Asks for a job, which the service acknowledges under the request's id; `None` if it refuses.
    ///
    /// # Errors
    /// When there is no definite answer.
    pub(crate) async fn ask(&self, kind: job_spec::Kind, urgent: bool) -> Result<Option<String>> {
        let request_id = uuid::Uuid::new_v4().to_string();
        let priority = match urgent {
            true => JobPriority::Urgent,
            false => JobPriority::Normal,
        };
        let request = CreateJobRequest {
            spec: Some(JobSpec { kind: Some(kind) }),
            request_id: request_id.clone(),
            priority: priority.into(),
            owner: request_id.clone(),
            validate_only: false,
        };
        let job = match self.calls.create_job(&request).await {
            Ok(job) => job.name,
            Err(status) if is_transient(status.code()) => {
                bail!("creating a job: {status}")
            }
            Err(status) => {
                tracing::warn!(%status, "a job was refused");
                return Ok(None);
            }
        };
        self.history.record(Event::Acknowledged {
            job: job.clone(),
            request: request_id,
        })?;
        let mut asked = self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        asked.push((request, job.clone()));
        Ok(Some(job))
    }

    /// Waits for the end of a job.
    ///
    /// # Errors
    /// When it does not end.
    pub(crate) async fn wait(&self, job: &str) -> Result<Job> {
        let began = Instant::now();
        loop {
            let now = self.calls.job(job).await?;
            if is_ended(now.state()) {
                return Ok(now);
            }
            ensure!(
                began.elapsed() < PATIENCE,
                "{job} does not end: {}, {:?}, {:?}",
                now.state().as_str_name(),
                now.waiting,
                now.attempts
            );
            tokio::time::sleep(Duration::from_millis(200)).await;
        }
    }

    /// Makes a person and a model of it, trained for a few steps.
    ///
    /// # Errors
    /// When that fails.
    pub(crate) async fn avatar(&self) -> Result<Avatar> {
        let subject = self.person(0).await?;
        let name = format!("model {}", uuid::Uuid::new_v4().simple());
        let model = self
            .calls
            .create_model(&name, std::slice::from_ref(&subject))
            .await?;
        let job = self.ask(train(&model, 20), false).await?;
        let ended = self.wait(&job.context("a training")?).await?;
        ensure!(
            ended.state() == job::State::Succeeded,
            "the first training: {:?}",
            ended.error
        );
        Ok(Avatar { subject, model })
    }

    /// Asks for something whenever few jobs are open, until `done`.
    ///
    /// # Errors
    /// When the service gives no definite answer, or loses a person.
    pub(crate) async fn run(
        &self,
        avatar: &Avatar,
        seed: u64,
        done: &dyn Fn() -> bool,
    ) -> Result<()> {
        let mut chance = ChaCha8Rng::seed_from_u64(seed);
        while !done() {
            let open = [job::State::Queued, job::State::Running];
            let open = self.calls.list_jobs(&open).await?;
            if open.len() < OPEN {
                self.one(avatar, &mut chance, &open).await?;
            }
            tokio::time::sleep(Duration::from_millis(chance.random_range(50..400))).await;
        }
        Ok(())
    }

    async fn one(&self, avatar: &Avatar, chance: &mut ChaCha8Rng, open: &[Job]) -> Result<()> {
        match chance.random_range(0..13) {
            0..4 => {
                let steps = chance.random_range(10..60);
                self.ask(train(&avatar.model, steps), false).await?;
            }
            4..8 => {
                let views = chance.random_range(1..6);
                self.ask(render(avatar, views), false).await?;
            }
            8 => {
                self.ask(evaluate(avatar), false).await?;
            }
            9 => {
                // Others wait for theirs.
                let mut own = open.iter().filter(|job| job.model == avatar.model);
                if let Some(job) = own.next() {
                    self.cancel(&job.name).await?;
                }
            }
            10 => self.delete_one(avatar).await?,
            11 => {
                self.ask(export(avatar), false).await?;
            }
            _ => {
                self.person(1).await?;
            }
        }
        Ok(())
    }

    async fn cancel(&self, job: &str) -> Result<()> {
        self.history.record(Event::Cancelled {
            job: job.to_owned(),
        })?;
        match self.calls.cancel_job(job).await {
            // It may have ended meanwhile.
            Err(status) if is_transient(status.code()) => Err(status).context("cancelling"),
            _ => Ok(()),
        }
    }

    /// Deletes the first render of the avatar that has ended.
    async fn delete_one(&self, avatar: &Avatar) -> Result<()> {
        for (_, job) in self.asked() {
            match self.calls.job(&job).await {
                Ok(now)
                    if is_ended(now.state())
                        && now.kind() == JobKind::Render
                        && now.model == avatar.model =>
                {
                    // Before the call: the observer must not miss the job first.
                    let name = job.clone();
                    self.history.record(Event::Deleted { name })?;
                    return self.calls.delete_job(&job).await.context("deleting");
                }
                Err(status) if status.code() != Code::NotFound => {
                    return Err(status).context("reading a job");
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// Whether a job in this state stays in it.
pub(crate) fn is_ended(state: job::State) -> bool {
    matches!(
        state,
        job::State::Succeeded | job::State::Failed | job::State::Cancelled
    )
}

/// A training with many checkpoints.
pub(crate) fn train(model: &str, steps: u64) -> job_spec::Kind {
    job_spec::Kind::Train(TrainSpec {
        model: model.to_owned(),
        steps,
        seed: 1,
        image_size: SIZE,
        checkpoint_seconds: 0.7,
        ..TrainSpec::default()
    })
}

/// An orbit around a person.
pub(crate) fn render(avatar: &Avatar, views: u32) -> job_spec::Kind {
    job_spec::Kind::Render(RenderSpec {
        model: avatar.model.clone(),
        subject: avatar.subject.clone(),
        what: Some(What::Orbit(Orbit {
            frame: 0,
            views,
            size: SIZE,
        })),
        ..RenderSpec::default()
    })
}

fn evaluate(avatar: &Avatar) -> job_spec::Kind {
    job_spec::Kind::Evaluate(EvaluateSpec {
        model: avatar.model.clone(),
        subjects: vec![avatar.subject.clone()],
        protocol: HELD_OUT.to_owned(),
        image_size: SIZE,
        ..EvaluateSpec::default()
    })
}

/// An export as splats of a person with a field, which trains the splats.
fn export(avatar: &Avatar) -> job_spec::Kind {
    job_spec::Kind::Export(ExportSpec {
        model: avatar.model.clone(),
        subject: avatar.subject.clone(),
        form: ExportForm::SplatsSpz.into(),
        distillation: Some(Distillation {
            seconds: 2.0,
            size: SIZE,
            ..Distillation::default()
        }),
        ..ExportSpec::default()
    })
}
