//! A coordinator without a worker, in a process and a folder of its own.

use super::measure::resident_bytes;
use anyhow::{Context, Result, ensure};
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use tonic::transport::{Channel, Endpoint};
use yoto_test_postgres::Database;
use yoto_tests::process::Process;

/// It ends when this is dropped.
pub(super) struct Served {
    server: Process,
    address: String,
    folder: TempDir,
    _database: Option<Database>,
}

impl Served {
    /// Starts `yoto-under-test`, which is beside this program, with SQLite or `postgres`.
    ///
    /// # Errors
    /// When it does not start.
    pub(super) fn start(postgres: bool) -> Result<Self> {
        let program = std::env::current_exe()?.with_file_name("yoto-under-test");
        let program = program.to_str().context("a path in UTF-8")?;
        ensure!(
            Path::new(program).exists(),
            "{program} is missing: cargo build -p yoto-tests --bins"
        );
        let folder = tempfile::tempdir()?;
        let data = folder.path().to_str().context("a path in UTF-8")?;
        let mut arguments = vec![
            "serve",
            "--no-worker",
            "--data",
            data,
            "--listen",
            "127.0.0.1:0",
        ];
        let database = match postgres {
            true => Some(Database::create_durable().context("no PostgreSQL")?),
            false => None,
        };
        let url = database.as_ref().map(Database::url);
        if let Some(url) = &url {
            arguments.extend(["--database", url]);
        }
        let mut server = Process::start(program, &arguments)?;
        let line = server.line_with("http://")?;
        let address = line
            .split_whitespace()
            .find(|word| word.starts_with("http://"));
        let address = address.context("an address")?.to_owned();
        Ok(Self {
            server,
            address,
            folder,
            _database: database,
        })
    }

    /// A new connection.
    ///
    /// # Errors
    /// When it is refused.
    pub(super) async fn connect(&self) -> Result<Channel> {
        let endpoint = Endpoint::from_shared(self.address.clone())?;
        Ok(endpoint.connect().await?)
    }

    /// The data folder.
    pub(super) fn data(&self) -> PathBuf {
        self.folder.path().to_owned()
    }

    /// Memory of its process that is in RAM.
    ///
    /// # Errors
    /// When the process has ended, or the system is not Linux.
    pub(super) fn resident_bytes(&self) -> Result<u64> {
        resident_bytes(self.server.id())
    }
}
