//! Options that several commands have.

pub(crate) mod capture;
pub(crate) mod correction;
pub(crate) mod frame_range;
pub(crate) mod media;
pub(crate) mod motion;
mod parse;
pub(crate) mod person;
pub(crate) mod span;
pub(crate) mod train;
pub(crate) mod version;

pub(crate) use parse::*;

#[cfg(feature = "embedded")]
use anyhow::Context;
#[cfg(feature = "embedded")]
use clap::builder::BoolishValueParser;
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use yoto_client::{Addresses, ClientError, DEFAULT_SERVER, QueueOptions, YotoClient};
#[cfg(feature = "embedded")]
use yoto_import::FfmpegArg;
use yoto_import::{Levels, MattingModel};
#[cfg(feature = "embedded")]
use yoto_ingest::IngestSettings;
use yoto_proto::key::Key;
use yoto_proto::v1::{JobKind, JobPriority};

/// The service of a client command.
#[derive(Debug, Args)]
pub(crate) struct Server {
    /// Address of the service, or the addresses of its coordinators, separated by commas.
    #[arg(
        long,
        visible_alias = "service",
        env = "YOTO_SERVER",
        default_value = DEFAULT_SERVER,
        value_name = "URL"
    )]
    pub server: String,
    /// File with the key, if the service asks for one. Without this option, the key is read from the variable
    /// YOTO_KEY.
    #[arg(long, env = "YOTO_KEY_FILE", value_name = "FILE")]
    pub key_file: Option<PathBuf>,
    /// Certificate of the authority that signs for an https:// service, in PEM [default: the authorities that the
    /// system trusts].
    #[arg(long, env = "YOTO_CA", value_name = "FILE")]
    pub ca: Option<PathBuf>,
    /// Certificate and private key of this client, in PEM, where the service asks for one (`--tls-client-ca`).
    #[arg(long, env = "YOTO_CLIENT_CERT", value_name = "FILE")]
    pub client_cert: Option<PathBuf>,
}

impl Server {
    pub(crate) async fn connect(&self) -> Result<YotoClient, ClientError> {
        let (addresses, key) = (self.addresses()?, self.key()?);
        if key.is_some() && addresses.are_open() {
            tell!(
                "the key can be read on its way to {}: use https://",
                self.server
            );
        }
        YotoClient::connect_to(&addresses, key).await
    }

    /// Where the service is.
    pub(crate) fn addresses(&self) -> Result<Addresses, ClientError> {
        let addresses = Addresses::parse(&self.server)?;
        addresses.with_certificates(self.ca.as_deref(), self.client_cert.as_deref())
    }

    /// The caller's key, from the file or the variable [`KEY`]. No option takes a key, because others can see the
    /// arguments of a process.
    pub(crate) fn key(&self) -> Result<Option<Key>, ClientError> {
        let (place, text) = match &self.key_file {
            Some(path) => {
                let text = std::fs::read_to_string(path);
                let text = text.map_err(ClientError::file("reading the key in", path))?;
                (path.display().to_string(), text)
            }
            None => match std::env::var(KEY) {
                // Recipes pass an empty variable on where there is no key.
                Ok(text) if !text.trim().is_empty() => (KEY.to_owned(), text),
                _ => return Ok(None),
            },
        };
        let key = text.trim().parse();
        key.map(Some)
            .map_err(|source| ClientError::Key { place, source })
    }
}

/// The variable with the caller's key.
const KEY: &str = "YOTO_KEY";

/// Why an operator stops something.
#[derive(Debug, Args)]
pub(crate) struct Reason {
    /// Reason; `yoto status` shows it.
    #[arg(
        long,
        default_value = "",
        hide_default_value = true,
        value_name = "TEXT"
    )]
    pub reason: String,
}

/// Place of a new job in the queue.
#[derive(Debug, Args)]
pub(crate) struct QueueArgs {
    /// Jobs of a higher priority are started first.
    #[arg(long, value_enum, default_value = "normal", value_name = "PRIORITY")]
    priority: PriorityName,
    /// Name of the person or project that the job runs for; among jobs of the same priority, the owner with
    /// the fewest running jobs comes first.
    #[arg(
        long,
        default_value = "",
        hide_default_value = true,
        value_name = "NAME"
    )]
    owner: String,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum PriorityName {
    Low,
    Normal,
    High,
    Urgent,
}

impl QueueArgs {
    /// A connection that gives new jobs this priority and owner.
    pub(crate) fn apply(&self, client: YotoClient) -> YotoClient {
        client.with_queue_options(QueueOptions {
            priority: match self.priority {
                PriorityName::Low => JobPriority::Low,
                PriorityName::Normal => JobPriority::Normal,
                PriorityName::High => JobPriority::High,
                PriorityName::Urgent => JobPriority::Urgent,
            },
            owner: self.owner.clone(),
        })
    }
}

/// A kind of jobs.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum KindName {
    Ingest,
    Train,
    Render,
    Evaluate,
    Export,
}

impl From<KindName> for JobKind {
    fn from(name: KindName) -> Self {
        match name {
            KindName::Ingest => Self::Ingest,
            KindName::Train => Self::Train,
            KindName::Render => Self::Render,
            KindName::Evaluate => Self::Evaluate,
            KindName::Export => Self::Export,
        }
    }
}

/// A network of the user that makes the masks of a clip.
#[derive(Debug, Args)]
pub(crate) struct MattingArgs {
    /// Make the masks of a clip with this network in ONNX: MODNet, U²-Net, IS-Net, BiRefNet, RVM or a similar one.
    #[arg(long, value_name = "FILE", conflicts_with = "masks")]
    matting_model: Option<PathBuf>,
    /// Levels of the pictures on which the matting model was trained [default: unit for RVM; for a clip alone, the
    /// levels whose masks agree best with the pose model's].
    #[arg(long, value_enum, value_name = "LEVELS", requires = "matting_model")]
    matting_levels: Option<Levels>,
}

impl MattingArgs {
    /// The model, if one was named.
    pub(crate) fn model(&self) -> Option<MattingModel> {
        let path = self.matting_model.clone();
        path.map(|path| MattingModel {
            path,
            levels: self.matting_levels,
        })
    }
}

/// Limits of the process that reads one upload.
#[cfg(feature = "embedded")]
#[derive(Debug, Clone, Args)]
pub(crate) struct IngestArgs {
    /// Memory for reading one upload, MiB.
    #[arg(
        long,
        env = "YOTO_INGEST_MEMORY_MIB",
        value_name = "MIB",
        default_value_t = 4096
    )]
    ingest_memory_mib: u64,
    /// Time for reading one upload, seconds.
    #[arg(
        long,
        env = "YOTO_INGEST_SECONDS",
        value_name = "SECONDS",
        default_value_t = 3600
    )]
    ingest_seconds: u64,
    #[command(flatten)]
    ffmpeg: FfmpegArg,
    /// The pose model, which finds people in films without poses: a file, or the folder that deploy/models/get.sh filled. Without it,
    /// such films are refused.
    #[arg(long, value_name = "PATH", env = "YOTO_POSE_MODEL")]
    pose_model: Option<PathBuf>,
    /// Refuse to start where the kernel can't confine the process that reads uploads: it needs Landlock and seccomp.
    #[arg(long, env = "YOTO_REQUIRE_CONFINEMENT", value_parser = BoolishValueParser::new())]
    require_confinement: bool,
}

#[cfg(feature = "embedded")]
impl IngestArgs {
    /// The limits as settings of a worker.
    ///
    /// # Errors
    /// When the pose model can't be used.
    pub(crate) fn settings(&self) -> anyhow::Result<IngestSettings> {
        let pose_model = self.pose_model.as_deref().map(|path| {
            // The process that reads an upload runs in another folder.
            let path = std::path::absolute(path).with_context(|| path.display().to_string())?;
            yoto_import::check_pose_model(&path).context("opening the pose model")?;
            anyhow::Ok(path)
        });
        Ok(IngestSettings {
            pose_model: pose_model.transpose()?,
            memory_bytes: self.ingest_memory_mib.saturating_mul(1 << 20),
            seconds: self.ingest_seconds,
            ffmpeg: self.ffmpeg.program().map(Into::into),
            require_confinement: self.require_confinement,
            ..IngestSettings::default()
        })
    }
}
