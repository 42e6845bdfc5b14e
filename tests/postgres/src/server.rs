//! The server's process.

use std::io::Write;
use std::os::unix::fs::{MetadataExt, chown};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// The server's superuser.
pub(crate) const USER: &str = "postgres";
/// System users as whom the server runs if this process runs as root, which PostgreSQL refuses.
const UNPRIVILEGED: [&str; 2] = ["postgres", "nobody"];
/// Where Debian's packages have the programs, below a folder per version.
const DEBIAN: &str = "/usr/lib/postgresql";
/// Longest time for a start.
const PATIENCE: Duration = Duration::from_secs(120);

/// Runs the server until the pipe from this process is closed, also by a kill of it, and removes its folder. Lines from the pipe
/// end the server as a crash does, and start it again. `$0`: folder of the programs, `$1`: folder of the server, the rest: the
/// server's options.
const RUN: &str = r#"
programs=$0 folder=$1
shift
start() {
    "$programs/postgres" -D "$folder/data" -k "$folder" "$@" >>"$folder/log" 2>&1 </dev/null &
    server=$!
}
crash() {
    [ -z "$server" ] && return
    # Signals wait while it is stopped.
    kill -QUIT $server
    kill -CONT $server
    wait $server
    server=
}
start "$@"
while read -r order; do
    case $order in
    crash) crash ;;
    start) start "$@" ;;
    esac
done
crash
rm -rf "$folder"
"#;

/// Options of every server.
const OPTIONS: [&str; 6] = [
    "-c",
    "listen_addresses=",
    "-c",
    "max_connections=300",
    "-c",
    "shared_buffers=64MB",
];
/// Options without durability: nothing of a test outlives a crash of the machine.
const UNSYNCED: [&str; 6] = [
    "-c",
    "fsync=off",
    "-c",
    "synchronous_commit=off",
    "-c",
    "full_page_writes=off",
];

/// Whether commits survive a crash of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Durability {
    /// They need not.
    None,
    /// As PostgreSQL does it by default.
    Full,
}

/// A running server.
#[derive(Debug)]
pub(crate) struct Server {
    programs: PathBuf,
    folder: PathBuf,
    /// The shell around the server, which holds the other end of the pipe.
    shell: Child,
}

/// The folder of the programs `initdb` and `postgres`.
pub(crate) fn programs() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let mut folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    if let Ok(versions) = std::fs::read_dir(DEBIAN) {
        let mut versions: Vec<(u32, PathBuf)> = versions
            .flatten()
            .filter_map(|it| {
                Some((
                    it.file_name().to_str()?.parse().ok()?,
                    it.path().join("bin"),
                ))
            })
            .collect();
        versions.sort();
        folders.extend(versions.into_iter().rev().map(|(_, bin)| bin));
    }
    let has = |folder: &PathBuf| {
        let programs = ["initdb", "postgres", "psql", "createdb", "dropdb"];
        programs.iter().all(|it| folder.join(it).is_file())
    };
    folders.into_iter().find(has)
}

impl Server {
    /// Starts a server with the programs of a folder.
    ///
    /// # Panics
    /// When it does not start, with what it says.
    pub(crate) fn start(programs: PathBuf, durability: Durability) -> Self {
        let folder = tempfile::Builder::new().prefix("yoto-postgres-").tempdir();
        // The shell removes it.
        let folder = folder.expect("a temporary folder").keep();
        let user = unprivileged(&folder);
        if let Some((user, group)) = user {
            chown(&folder, Some(user), Some(group)).expect("gives the folder away");
        }
        let mut init = Command::new(programs.join("initdb"));
        init.args([
            "--auth=trust",
            "--no-sync",
            "--encoding=UTF8",
            "--no-locale",
        ])
        .arg(format!("--username={USER}"))
        .arg("--pgdata")
        .arg(folder.join("data"));
        let made = become_user(&mut init, user)
            .output()
            .expect("initdb starts");
        let said = String::from_utf8_lossy(&made.stderr);
        assert!(made.status.success(), "initdb: {said}");
        let mut shell = Command::new("sh");
        shell
            .args(["-c", RUN])
            .arg(&programs)
            .arg(&folder)
            .args(OPTIONS);
        if durability == Durability::None {
            shell.args(UNSYNCED);
        }
        // Apart from the signals of a terminal: the pipe alone ends it. It keeps no pipe of the tests' output open.
        shell
            .process_group(0)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        let shell = become_user(&mut shell, user).spawn().expect("sh starts");
        let server = Self {
            programs,
            folder,
            shell,
        };
        server.wait();
        server
    }

    /// The folder with its socket.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// The socket that it listens on.
    pub(crate) fn socket(&self) -> PathBuf {
        self.folder.join(".s.PGSQL.5432")
    }

    /// A program that connects to it.
    pub(crate) fn client(&self, program: &str) -> Command {
        let mut command = Command::new(self.programs.join(program));
        command
            .arg("--host")
            .arg(&self.folder)
            .args(["--username", USER])
            .stdin(Stdio::null());
        command
    }

    /// Ends it at once, as a crash does. A server that ends refuses statements a while before nobody listens.
    pub(crate) fn crash(&self) {
        self.order("crash");
        while UnixStream::connect(self.socket()).is_ok() {
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Starts it again after [`Self::crash`].
    pub(crate) fn restart(&self) {
        self.order("start");
        self.wait();
    }

    /// Sends a signal to each of its processes.
    pub(crate) fn signal(&self, name: &str) {
        let file = self.folder.join("data/postmaster.pid");
        let text = std::fs::read_to_string(file).expect("it runs");
        let first = text.lines().next().expect("has a process").to_owned();
        // In this order, so that a stopped server starts no others.
        for processes in [vec![first.clone()], children(&first)] {
            // One of them may have ended by itself.
            let sent = Command::new("kill").arg(name).args(processes).output();
            sent.expect("kill starts");
        }
    }

    fn order(&self, order: &str) {
        let mut pipe = self.shell.stdin.as_ref().expect("a pipe");
        writeln!(pipe, "{order}").expect("the shell reads");
    }

    fn answers(&self) -> bool {
        let mut ask = self.client("psql");
        ask.args(["--dbname", "postgres", "--command", "SELECT 1"]);
        ask.output().expect("psql starts").status.success()
    }

    fn wait(&self) {
        let began = Instant::now();
        while !self.answers() {
            let log = std::fs::read_to_string(self.folder.join("log")).unwrap_or_default();
            assert!(
                began.elapsed() < PATIENCE,
                "PostgreSQL does not start: {log}"
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// The processes whose parent is `parent`.
fn children(parent: &str) -> Vec<String> {
    let entries = std::fs::read_dir("/proc").expect("the system's processes");
    let names = entries.flatten().map(|it| it.file_name());
    let ids = names.filter_map(|it| it.into_string().ok());
    ids.filter(|id| {
        let stat = std::fs::read_to_string(format!("/proc/{id}/stat"));
        // Its name, in brackets, may have anything in it; state and parent follow.
        let parent_of = stat.ok().and_then(|it| {
            let (_, after) = it.rsplit_once(')')?;
            Some(after.split_whitespace().nth(1)?.to_owned())
        });
        parent_of.as_deref() == Some(parent)
    })
    .collect()
}

/// User and group of the server if this process, which owns `folder`, runs as root.
fn unprivileged(folder: &Path) -> Option<(u32, u32)> {
    let own = std::fs::metadata(folder).expect("its folder").uid();
    if own != 0 {
        return None;
    }
    let users = std::fs::read_to_string("/etc/passwd").expect("the system's users");
    let found = UNPRIVILEGED.iter().find_map(|name| {
        let line = users
            .lines()
            .find(|line| line.split(':').next() == Some(*name))?;
        let mut fields = line.split(':').skip(2);
        Some((fields.next()?.parse().ok()?, fields.next()?.parse().ok()?))
    });
    Some(found.expect("a user 'postgres' or 'nobody'"))
}

fn become_user(command: &mut Command, user: Option<(u32, u32)>) -> &mut Command {
    match user {
        // A folder of root's may be closed to it.
        Some((user, group)) => command.uid(user).gid(group).current_dir("/"),
        None => command,
    }
}
