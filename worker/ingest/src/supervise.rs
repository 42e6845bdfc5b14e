//! The parent's side of the child: start it, read its reply, report the outcome.

use super::child::ARGUMENT;
use super::failure::{IngestError, machine};
use super::order::{Order, Outcome, Progress, ReplyLine};
use super::settings::IngestSettings;
use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};
use yoto_proto::pose_track::violation;

/// Interval between calls of `watch`.
const LOOK: Duration = Duration::from_millis(100);
/// Longest line of a child, bytes.
const MAX_LINE: u64 = 1 << 20;
/// Lines of a child that wait to be read: one that prints without end waits, instead of filling memory.
const LINES: usize = 256;
/// Variables of the environment that a child gets, those that a program needs to run: others may hold credentials.
const ENVIRONMENT: [&str; 6] = [
    "PATH",
    "LD_LIBRARY_PATH",
    "HOME",
    "TMPDIR",
    "LANG",
    "YOTO_CPU",
];
/// Bytes kept of its standard error.
const COMPLAINTS: usize = 8 << 10;

/// Runs a child for `order`, and calls `watch` meanwhile. If the child exceeds a limit or crashes, the outcome rejects the
/// upload, with the reason and the file and frame.
///
/// # Errors
/// If the child can't be started or is killed from outside, or `watch` fails.
pub(super) fn run<E>(
    settings: &IngestSettings,
    order: &Order,
    watch: &mut dyn FnMut(Option<&Progress>) -> Result<(), E>,
) -> Result<Outcome, IngestError<E>> {
    let program = match &settings.program {
        Some(program) => program.clone(),
        None => std::env::current_exe()
            .map_err(|error| machine("finding this program to start it again", &error))?,
    };
    let file = order.folder.join("order.json");
    let written = serde_json::to_vec(order)
        .map_err(std::io::Error::from)
        .and_then(|json| std::fs::write(&file, json));
    written.map_err(|error| machine("writing the child's order", &error))?;
    let child = Command::new(&program)
        .arg(ARGUMENT)
        .arg(&file)
        .args([settings.memory_bytes, settings.seconds].map(|limit| limit.to_string()))
        .current_dir(&order.folder)
        .env_clear()
        .envs(
            ENVIRONMENT
                .iter()
                .filter_map(|name| Some((name, std::env::var_os(name)?))),
        )
        // Allocators reserve much address space in advance, which counts towards the limit: glibc for
        // each thread's arena, mimalloc (this figure is in KiB) for each of its own.
        .env("MALLOC_ARENA_MAX", "1")
        .env("MIMALLOC_ARENA_RESERVE", "65536")
        .env("RUST_BACKTRACE", "0")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .process_group(0)
        .spawn()
        .map_err(|error| machine(&format!("starting {}", program.display()), &error))?;
    let mut running = Running::new(child);
    let deadline = Instant::now() + Duration::from_secs(settings.seconds);
    let mut progress = Progress::default();
    let mut outcome = None;
    let mut late = false;
    loop {
        let mut moved = None;
        match running.lines.recv_timeout(LOOK) {
            Ok(ReplyLine::At(now)) => {
                progress = now;
                moved = Some(&progress);
            }
            Ok(ReplyLine::End(end)) => outcome = Some(end),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        // The child is killed when `running` is dropped.
        watch(moved).map_err(IngestError::Stopped)?;
        if Instant::now() >= deadline {
            late = true;
            running.kill();
            break;
        }
    }
    let (status, complaints) = running.wait()?;
    if outcome.is_none() {
        // A stop of this process may have stopped its child first.
        watch(None).map_err(IngestError::Stopped)?;
    }
    match outcome {
        Some(outcome) if !late => Ok(outcome),
        _ => {
            let ended = Ended {
                status,
                late,
                complaints: &complaints,
                seconds: settings.seconds,
                memory: settings.memory_bytes,
                file_bytes: settings.limits.unpacked_bytes,
            };
            tracing::warn!(
                ?status,
                late,
                ?progress,
                complaints,
                "the child that reads an upload crashed"
            );
            match ended.reason() {
                Reason::Upload(code, message) => {
                    let fault = violation(code, &progress.file, progress.frame, "", message);
                    Ok(Outcome::Rejected(vec![fault.into()]))
                }
                Reason::Outside(signal) => Err(IngestError::Killed(format!(
                    "the process that read the upload was ended from outside ({signal}), most \
                     likely since this machine had no memory left"
                ))),
            }
        }
    }
}

/// The end of a child without a reported outcome.
struct Ended<'a> {
    status: ExitStatus,
    late: bool,
    complaints: &'a str,
    seconds: u64,
    memory: u64,
    file_bytes: u64,
}

/// Why a child ended.
#[derive(Debug)]
enum Reason {
    /// The upload is at fault; code and message for its owner.
    Upload(&'static str, String),
    /// The child was killed from outside.
    Outside(Signal),
}

impl Ended<'_> {
    fn reason(&self) -> Reason {
        let signal = self
            .status
            .signal()
            .and_then(|it| Signal::try_from(it).ok());
        // Messages of Rust's runtime, and of a library's `expect`.
        let out_of_memory = ["memory allocation of", "TryReserveError"]
            .iter()
            .any(|words| self.complaints.contains(words));
        let (code, message) = match signal {
            _ if self.late || signal == Some(Signal::SIGXCPU) => (
                "TIME_LIMIT",
                format!("reading it took more than {} seconds", self.seconds),
            ),
            _ if out_of_memory => (
                "MEMORY_LIMIT",
                format!(
                    "reading it took more than {} MiB of memory",
                    self.memory >> 20
                ),
            ),
            Some(Signal::SIGXFSZ) => (
                "DISK_LIMIT",
                format!(
                    "reading it wrote a file of more than {} MiB",
                    self.file_bytes >> 20
                ),
            ),
            Some(
                signal @ (Signal::SIGKILL
                | Signal::SIGTERM
                | Signal::SIGINT
                | Signal::SIGHUP
                | Signal::SIGQUIT),
            ) => return Reason::Outside(signal),
            _ => {
                let how = signal.map_or_else(
                    || self.status.to_string(),
                    |signal| signal.as_str().to_owned(),
                );
                // The line above a panic's message names this project's sources.
                let ours = |line: &&str| line.starts_with("thread '") || line.starts_with("note:");
                let mut lines = self.complaints.lines();
                let said = lines.find(|line| !line.trim().is_empty() && !ours(line));
                let said = said.map(|line| format!(": {line}")).unwrap_or_default();
                (
                    "DECODER_CRASHED",
                    format!("the decoder crashed on it ({how}){said}"),
                )
            }
        };
        Reason::Upload(code, message)
    }
}

/// A started child with threads that read its output; killed when dropped.
struct Running {
    child: Child,
    lines: Receiver<ReplyLine>,
    complaints: Option<std::thread::JoinHandle<String>>,
}

impl Running {
    fn new(mut child: Child) -> Self {
        let (send, lines) = sync_channel(LINES);
        if let Some(stdout) = child.stdout.take() {
            std::thread::spawn(move || {
                let mut stdout = BufReader::new(stdout);
                loop {
                    let mut line = Vec::new();
                    let read = (&mut stdout).take(MAX_LINE).read_until(b'\n', &mut line);
                    // An invalid line ends the exchange: the child can't be trusted any more.
                    let Ok(line) = serde_json::from_slice(&line) else {
                        return;
                    };
                    if !read.is_ok_and(|count| count > 0) || send.send(line).is_err() {
                        return;
                    }
                }
            });
        }
        let complaints = child.stderr.take().map(|mut stderr| {
            std::thread::spawn(move || {
                let (mut kept, mut buffer) = (Vec::new(), [0; 4096]);
                // Read to the end, so that the child never waits for a reader.
                while let Ok(count @ 1..) = stderr.read(&mut buffer) {
                    let room = COMPLAINTS.saturating_sub(kept.len()).min(count);
                    kept.extend_from_slice(&buffer[..room]);
                }
                String::from_utf8_lossy(&kept).into_owned()
            })
        });
        Self {
            child,
            lines,
            complaints,
        }
    }

    /// Kills the child and its own children.
    fn kill(&mut self) {
        if let Ok(group) = i32::try_from(self.child.id()) {
            // It may have ended already.
            let _ = killpg(Pid::from_raw(group), Signal::SIGKILL);
        }
    }

    fn wait<E>(&mut self) -> Result<(ExitStatus, String), IngestError<E>> {
        let status = self.child.wait();
        // Its own children may still run and hold its ends of the pipes.
        self.kill();
        let complaints = self.complaints.take().and_then(|it| it.join().ok());
        let status = status.map_err(|error| machine("waiting for the child", &error))?;
        Ok((status, complaints.unwrap_or_default()))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if self.complaints.is_some() {
            self.kill();
            let _ = self.child.wait();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason(raw: i32, late: bool, complaints: &str) -> (&'static str, String) {
        let ended = Ended {
            status: ExitStatus::from_raw(raw),
            late,
            complaints,
            seconds: 9,
            memory: 64 << 20,
            file_bytes: 3 << 20,
        };
        match ended.reason() {
            Reason::Upload(code, message) => (code, message),
            Reason::Outside(signal) => ("outside", signal.to_string()),
        }
    }

    #[test]
    fn a_child_gets_no_other_variables() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().expect("a folder");
        let program = folder.path().join("program");
        std::fs::write(&program, "#!/bin/sh\nenv > variables\n").expect("writes");
        let runs = std::fs::Permissions::from_mode(0o700);
        std::fs::set_permissions(&program, runs).expect("is a program");
        let settings = IngestSettings {
            program: Some(program),
            ..IngestSettings::default()
        };
        let order = Order::new(folder.path(), &settings.limits);
        let outcome = run(&settings, &order, &mut |_| Ok::<_, ()>(()));
        assert!(outcome.is_ok(), "it ended without an outcome: {outcome:?}");
        let variables = std::fs::read_to_string(folder.path().join("variables"));
        let variables = variables.expect("is written");
        assert!(variables.contains("MALLOC_ARENA_MAX=1"), "{variables}");
        // Cargo sets some for tests.
        assert!(std::env::var_os("CARGO_PKG_NAME").is_some());
        assert!(!variables.contains("CARGO"), "{variables}");
    }

    #[test]
    fn each_end_has_its_code_and_words() {
        assert_eq!(reason(9, true, "").0, "TIME_LIMIT");
        assert_eq!(reason(Signal::SIGXCPU as i32, false, "").0, "TIME_LIMIT");
        let (code, message) = reason(6, false, "memory allocation of 99 bytes failed");
        assert!(
            code == "MEMORY_LIMIT" && message.contains("64 MiB"),
            "{message}"
        );
        for signal in [Signal::SIGKILL, Signal::SIGTERM, Signal::SIGINT] {
            assert_eq!(
                reason(signal as i32, false, ""),
                ("outside", signal.to_string())
            );
        }
        let (code, message) = reason(Signal::SIGXFSZ as i32, false, "");
        assert!(
            code == "DISK_LIMIT" && message.contains("3 MiB"),
            "{message}"
        );
        let (code, message) = reason(11, false, "");
        assert!(
            code == "DECODER_CRASHED" && message.contains("SIGSEGV"),
            "{message}"
        );
        let panic = "\nthread 'main' panicked at x.rs:3:\nindex out of bounds\nnote: run";
        let (code, message) = reason(101 << 8, false, panic);
        assert!(
            code == "DECODER_CRASHED" && message.ends_with(": index out of bounds"),
            "{message}"
        );
        let panic = "thread 'main' panicked at x.rs:3:\nroom: TryReserveError { kind: AllocError";
        assert_eq!(reason(101 << 8, false, panic).0, "MEMORY_LIMIT");
    }
}
