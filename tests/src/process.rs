//! Real `yoto` processes, killed at the end of the test, even if it fails.

use anyhow::{Context, bail, ensure};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// Time limit of waits. Generous, since machines are shared and tests do not measure speed.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A running process with its standard error.
pub struct Process {
    child: Child,
    lines: mpsc::Receiver<String>,
    seen: Vec<String>,
}

impl Process {
    /// Starts `program` with `arguments`.
    ///
    /// # Errors
    /// When it can't be started.
    pub fn start(program: &str, arguments: &[&str]) -> anyhow::Result<Self> {
        let mut child = Command::new(program)
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .with_context(|| format!("starting {program} {arguments:?}"))?;
        let stderr = child.stderr.take().context("its standard error")?;
        let (send, lines) = mpsc::channel();
        std::thread::spawn(move || {
            for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                // The test may have stopped listening.
                let _ = send.send(line);
            }
        });
        Ok(Self {
            child,
            lines,
            seen: Vec::new(),
        })
    }

    /// Its process id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits for its end.
    ///
    /// # Errors
    /// When it does not end in time.
    pub fn wait(&mut self) -> anyhow::Result<ExitStatus> {
        let began = Instant::now();
        while began.elapsed() < PATIENCE {
            if let Some(status) = self.child.try_wait()? {
                return Ok(status);
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        bail!("it does not end: {:?}", self.seen)
    }

    /// Waits for a line that contains `needle`, and returns it.
    ///
    /// # Errors
    /// When the process ends or stays silent first; with all of its output.
    pub fn line_with(&mut self, needle: &str) -> anyhow::Result<String> {
        if let Some(line) = self.seen.iter().find(|line| line.contains(needle)) {
            return Ok(line.clone());
        }
        let deadline = Instant::now() + PATIENCE;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let Ok(line) = self.lines.recv_timeout(left) else {
                bail!("no line with '{needle}' among:\n{}", self.seen.join("\n"));
            };
            self.seen.push(line.clone());
            if line.contains(needle) {
                return Ok(line);
            }
        }
    }

    /// Kills it at once, as a crash or the system would (SIGKILL).
    ///
    /// # Errors
    /// When it can't be.
    pub fn kill(&mut self) -> anyhow::Result<()> {
        self.child.kill().context("killing")?;
        self.child.wait().context("waiting for its end")?;
        Ok(())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended already; then there is nothing to do.
        let _ = self.kill();
    }
}

/// Runs `program` to its end.
///
/// # Errors
/// When it can't be started.
pub fn output(program: &str, arguments: &[&str]) -> anyhow::Result<Output> {
    Command::new(program)
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("running {program} {arguments:?}"))
}

/// A way to run a program with arguments: [`succeed`] or [`fail`].
pub type Run = fn(&str, &[&str]) -> anyhow::Result<String>;

/// Runs `program`, which must succeed; returns its output.
///
/// # Errors
/// When it fails, with its output.
pub fn succeed(program: &str, arguments: &[&str]) -> anyhow::Result<String> {
    let output = output(program, arguments)?;
    let said = String::from_utf8_lossy(&output.stderr);
    ensure!(
        output.status.success(),
        "{arguments:?}: {}\n{said}",
        output.status
    );
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Runs `program`, which must fail; returns its standard error.
///
/// # Errors
/// When it succeeds.
pub fn fail(program: &str, arguments: &[&str]) -> anyhow::Result<String> {
    let output = output(program, arguments)?;
    ensure!(!output.status.success(), "{arguments:?} succeeded");
    Ok(String::from_utf8_lossy(&output.stderr).into_owned())
}

/// A coordinator on a free port, with or without its own worker.
pub struct Service {
    /// The process.
    pub process: Process,
    /// `http://127.0.0.1:…`.
    pub address: String,
    /// `file:///…`.
    pub objects: String,
    /// Folder for files of its workers: a worker that is killed leaves some.
    scratch: String,
}

impl Service {
    /// Starts `yoto serve` on `data`.
    ///
    /// # Errors
    /// When it does not start.
    pub fn start(yoto: &str, data: &Path, with_worker: bool) -> anyhow::Result<Self> {
        let options: &[&str] = if with_worker { &[] } else { &["--no-worker"] };
        Self::start_with(yoto, data, options)
    }

    /// Starts `yoto serve` on `data` with these `options`.
    ///
    /// # Errors
    /// When it does not start.
    pub fn start_with(yoto: &str, data: &Path, options: &[&str]) -> anyhow::Result<Self> {
        let data = data.to_str().context("a plain path")?;
        let mut arguments = vec!["serve", "--data", data, "--listen", "127.0.0.1:0"];
        arguments.extend(options);
        let mut process = Process::start(yoto, &arguments)?;
        let after = |line: String, word: &str| {
            let rest = line.split_once(word).map(|(_, rest)| rest.to_owned());
            rest.and_then(|rest| rest.split_whitespace().next().map(str::to_owned))
                .context("its address")
        };
        let address = after(process.line_with("serves http://")?, "serves ")?;
        let objects = after(process.line_with("objects at ")?, "objects at ")?;
        Ok(Self {
            process,
            address,
            objects,
            scratch: format!("{data}/scratch-of-workers"),
        })
    }

    /// Runs the words of `line` by `run`, which is [`succeed`] or [`fail`], as a command of `yoto` to this service.
    ///
    /// # Errors
    /// As `run`.
    pub fn ask(&self, yoto: &str, line: &str, run: Run) -> anyhow::Result<String> {
        let mut arguments: Vec<&str> = line.split(' ').collect();
        arguments.extend(["--server", &self.address]);
        run(yoto, &arguments)
    }

    /// Starts a worker process for it.
    ///
    /// # Errors
    /// When it can't be started.
    pub fn worker(&self, yoto: &str, name: &str) -> anyhow::Result<Process> {
        Process::start(
            yoto,
            &[
                "worker",
                "--server",
                &self.address,
                "--objects",
                &self.objects,
                "--name",
                name,
                "--scratch",
                &self.scratch,
            ],
        )
    }
}
