//! Databases of a private PostgreSQL: one server per process in a temporary folder, which listens on no network and ends
//! with the process, and one database per test.
//!
//! The programs are those of the system: the first on the `PATH`, or the newest of Debian's packages. A machine without them
//! skips the tests, unless [`REQUIRED`] says that it must have them.

mod server;

use server::{Durability, Server};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// The variable that makes it an error if PostgreSQL is missing, with the value 1.
pub const REQUIRED: &str = "YOTO_REQUIRE_POSTGRES";

/// An empty database, dropped with this value.
#[derive(Debug)]
pub struct Database {
    server: &'static Server,
    name: String,
}

impl Database {
    /// Makes a database; `None`, and a line that says so, on a machine without PostgreSQL.
    ///
    /// # Panics
    /// When PostgreSQL does not start, or is missing although [`REQUIRED`] is 1.
    pub fn create() -> Option<Self> {
        Some(Self::on(running()?))
    }

    /// A database on a server of its own that syncs each commit to the disk, for measurements and crashes. It ends
    /// with the process.
    ///
    /// # Panics
    /// As [`Self::create`].
    pub fn create_durable() -> Option<Self> {
        let server = Server::start(programs()?, Durability::Full);
        Some(Self::on(Box::leak(Box::new(server))))
    }

    fn on(server: &'static Server) -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let name = format!("test{}", NUMBER.fetch_add(1, Ordering::Relaxed));
        let made = server.client("createdb").arg(&name).output();
        let made = made.expect("createdb starts");
        let said = String::from_utf8_lossy(&made.stderr);
        assert!(made.status.success(), "createdb: {said}");
        Self { server, name }
    }

    /// Its address, for a user who may do everything.
    pub fn url(&self) -> String {
        let folder = self.server.folder().display();
        format!(
            "postgres://{}@localhost/{}?host={folder}",
            server::USER,
            self.name
        )
    }

    /// Its name on the server.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Runs statements as the server's superuser, each in a transaction of its own, and returns what they select.
    ///
    /// # Panics
    /// When one fails.
    pub fn run(&self, statements: &str) -> String {
        let mut psql = self.server.client("psql");
        psql.args(["--no-psqlrc", "--quiet", "--tuples-only", "--no-align"])
            .args([
                "--set=ON_ERROR_STOP=1",
                "--dbname",
                &self.name,
                "--command",
                statements,
            ]);
        let ran = psql.output().expect("psql starts");
        let said = String::from_utf8_lossy(&ran.stderr);
        assert!(ran.status.success(), "{statements}: {said}");
        String::from_utf8_lossy(&ran.stdout).trim().to_owned()
    }

    /// Its server's socket, for a proxy.
    pub fn socket(&self) -> PathBuf {
        self.server.socket()
    }

    /// Stops every process of its server (SIGSTOP), or has them go on. For a server of its own.
    ///
    /// # Panics
    /// When the server does not run.
    pub fn stop(&self, stopped: bool) {
        self.server.signal(if stopped { "-STOP" } else { "-CONT" });
    }

    /// Ends its server as a crash does, with all connections. For a server of its own.
    ///
    /// # Panics
    /// When that fails.
    pub fn crash(&self) {
        self.server.crash();
    }

    /// Starts its server again after [`Self::crash`].
    ///
    /// # Panics
    /// When it does not start.
    pub fn restart(&self) {
        self.server.restart();
    }

    /// Ends all connections to it, as a restart of the server does.
    ///
    /// # Panics
    /// When that fails.
    pub fn cut(&self) {
        self.run(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity
             WHERE datname = current_database() AND pid <> pg_backend_pid()",
        );
    }
}

impl Drop for Database {
    fn drop(&mut self) {
        let mut drop: Command = self.server.client("dropdb");
        drop.args(["--force", "--if-exists", &self.name]);
        // It may come after the server's end.
        drop.stdout(Stdio::null()).stderr(Stdio::null());
        // Hundreds of databases would fill a disk. Nobody waits for it, and the server's folder goes with the process.
        std::thread::spawn(move || drop.status());
    }
}

/// Whether this machine has PostgreSQL. If not, a line says so.
///
/// # Panics
/// When PostgreSQL does not start, or is missing although [`REQUIRED`] is 1.
pub fn is_there() -> bool {
    running().is_some()
}

/// The folder of the server's programs.
fn programs() -> Option<PathBuf> {
    let programs = server::programs();
    if programs.is_none() && std::env::var_os(REQUIRED).is_some_and(|it| it == "1") {
        panic!("PostgreSQL is missing, and {REQUIRED} is 1: apt-get install postgresql");
    }
    programs
}

/// The server of this process.
fn running() -> Option<&'static Server> {
    static RUNNING: OnceLock<Option<Server>> = OnceLock::new();
    let running = RUNNING.get_or_init(|| {
        let programs = programs();
        programs.map(|it| Server::start(it, Durability::None))
    });
    if running.is_none() {
        eprintln!("skipped: no PostgreSQL");
    }
    running.as_ref()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_database_is_empty_and_takes_statements() {
        let Some(database) = Database::create() else {
            return;
        };
        database.run("CREATE TABLE t (a BIGINT); INSERT INTO t VALUES (1), (2)");
        assert_eq!(database.run("SELECT sum(a) FROM t"), "3");
        let Some(other) = Database::create() else {
            return;
        };
        assert_eq!(
            other.run("SELECT count(*) FROM pg_tables WHERE tablename = 't'"),
            "0"
        );
    }

    #[test]
    fn a_server_crashes_and_stops_and_keeps_what_was_committed() {
        let Some(database) = Database::create_durable() else {
            eprintln!("skipped: no PostgreSQL");
            return;
        };
        database.run("CREATE TABLE t (a BIGINT); INSERT INTO t VALUES (1)");
        database.crash();
        let connected = || std::os::unix::net::UnixStream::connect(database.socket());
        connected().expect_err("nobody listens");
        database.restart();
        database.stop(true);
        let process = std::fs::read_to_string(database.server.folder().join("data/postmaster.pid"));
        let process = process
            .expect("runs")
            .lines()
            .next()
            .expect("has a process")
            .to_owned();
        let is_stopped = || {
            let state = std::fs::read_to_string(format!("/proc/{process}/stat")).expect("runs");
            state.contains(") T ")
        };
        while !is_stopped() {}
        database.stop(false);
        assert_eq!(database.run("SELECT a FROM t"), "1");
    }
}
