//! The processes of the service: started, killed, stopped, and started again when they have ended.

use super::parts::Controls;
use super::proxy::Proxy;
use super::records::Records;
use anyhow::{Context, Result};
use nix::sys::signal::{self, Signal};
use nix::unistd::Pid;
use std::fs::OpenOptions;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A coordinator and its workers in a folder.
#[derive(Debug)]
pub struct Fleet {
    program: PathBuf,
    folder: PathBuf,
    port: u16,
    lease_seconds: f64,
    seed: u64,
    controls: Controls,
    inside: Mutex<Inside>,
}

#[derive(Debug, Default)]
struct Inside {
    coordinator: Option<Child>,
    workers: Vec<Member>,
    started: u64,
    /// Workers that have ended by themselves, with an error.
    gave_up: u64,
}

/// A worker process.
#[derive(Debug)]
struct Member {
    name: String,
    child: Child,
    /// Its proxy to the coordinator, which its replacement takes over; `None`: the worker is not replaced.
    proxy: Option<Proxy>,
}

impl Fleet {
    /// A fleet without processes, in `folder`.
    ///
    /// # Errors
    /// When a folder can't be made, or no port is free.
    pub fn new(folder: &Path, lease_seconds: f64, seed: u64) -> Result<Self> {
        let controls = Controls::of(folder.join("controls"));
        std::fs::create_dir_all(controls.folder())?;
        Ok(Self {
            program: std::env::current_exe()?,
            folder: folder.to_owned(),
            port: free_port()?,
            lease_seconds,
            seed,
            controls,
            inside: Mutex::default(),
        })
    }

    /// What goes wrong in the processes.
    pub fn controls(&self) -> &Controls {
        &self.controls
    }

    /// The coordinator's records.
    pub fn records(&self) -> Records {
        Records {
            database: self.folder.join("data/yoto.db"),
        }
    }

    /// Folder of all data and logs.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Address of the coordinator, the same for each of its processes.
    pub fn address(&self) -> SocketAddr {
        SocketAddr::from((Ipv4Addr::LOCALHOST, self.port))
    }

    /// Folder of the objects.
    pub fn objects(&self) -> PathBuf {
        self.folder.join("data/objects")
    }

    /// Length of a lease.
    pub fn lease(&self) -> Duration {
        Duration::from_secs_f64(self.lease_seconds)
    }

    fn inside(&self) -> MutexGuard<'_, Inside> {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts the coordinator.
    ///
    /// # Errors
    /// When the process can't be started.
    pub fn start_coordinator(&self) -> Result<()> {
        let mut inside = self.inside();
        inside.started += 1;
        let arguments = [
            "coordinator".to_owned(),
            format!("--data={}", self.folder.join("data").display()),
            format!("--port={}", self.port),
            format!("--lease-seconds={}", self.lease_seconds),
            format!("--controls={}", self.controls.folder().display()),
            format!("--seed={}", self.seed.wrapping_add(inside.started)),
        ];
        inside.coordinator = Some(self.start("coordinator", &arguments)?);
        Ok(())
    }

    /// Starts a worker that is replaced when it ends. It reaches the coordinator through its own proxy, which
    /// can be blocked.
    ///
    /// # Errors
    /// When the process can't be started.
    pub async fn start_lasting(&self) -> Result<String> {
        let proxy = Proxy::start(self.address()).await?;
        self.start_worker(Some(proxy), None)
    }

    /// Starts a worker that can't write files above `largest_file` bytes. Nothing replaces it.
    ///
    /// # Errors
    /// When the process can't be started.
    pub fn start_full(&self, largest_file: u64) -> Result<String> {
        self.start_worker(None, Some(largest_file))
    }

    /// Starts a worker and returns its display name.
    fn start_worker(&self, proxy: Option<Proxy>, largest_file: Option<u64>) -> Result<String> {
        let mut inside = self.inside();
        inside.started += 1;
        let name = format!("worker-{}", inside.started);
        let server = proxy.as_ref().map_or(self.address(), Proxy::address);
        let mut arguments = vec![
            "worker".to_owned(),
            format!("--server=http://{server}"),
            format!("--objects={}", self.objects().display()),
            format!("--name={name}"),
            format!("--controls={}", self.controls.folder().display()),
        ];
        arguments.extend(largest_file.map(|bytes| format!("--largest-file={bytes}")));
        let child = self.start(&name, &arguments)?;
        inside.workers.push(Member {
            name: name.clone(),
            child,
            proxy,
        });
        Ok(name)
    }

    /// Starts a service in one process, which belongs to the caller.
    ///
    /// # Errors
    /// When the process can't be started.
    pub fn start_embedded(&self, port: u16) -> Result<Child> {
        let arguments = [
            "embedded".to_owned(),
            format!("--data={}", self.folder.join("embedded").display()),
            format!("--port={port}"),
        ];
        self.start("embedded", &arguments)
    }

    /// Starts this program as one of its parts; it writes its log to a file in the folder.
    fn start(&self, log: &str, arguments: &[String]) -> Result<Child> {
        let path = self.folder.join(format!("{log}.log"));
        let log = OpenOptions::new().append(true).create(true).open(&path);
        let log = log.with_context(|| path.display().to_string())?;
        Command::new(&self.program)
            .arg("part")
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()
            .with_context(|| format!("starting {} {arguments:?}", self.program.display()))
    }

    /// Starts what has ended again. Returns when the coordinator was found to have ended.
    ///
    /// # Errors
    /// When a process can't be started.
    pub fn tend(&self) -> Result<Option<Instant>> {
        let (mut ended, mut proxies) = (None, Vec::new());
        {
            let mut inside = self.inside();
            if let Some(child) = &mut inside.coordinator
                && child.try_wait()?.is_some()
            {
                ended = Some(Instant::now());
            }
            let mut alive = Vec::new();
            for mut member in std::mem::take(&mut inside.workers) {
                match member.child.try_wait()? {
                    None => alive.push(member),
                    Some(status) => {
                        // A killed one has no code.
                        inside.gave_up += u64::from(status.code().is_some_and(|code| code != 0));
                        proxies.extend(member.proxy);
                    }
                }
            }
            inside.workers = alive;
        }
        if ended.is_some() {
            self.start_coordinator()?;
        }
        for proxy in proxies {
            self.start_worker(Some(proxy), None)?;
        }
        Ok(ended)
    }

    /// Number of workers that have ended by themselves, with an error.
    pub fn gave_up(&self) -> u64 {
        self.inside().gave_up
    }

    /// Blocks or unblocks the proxy of the worker with this display name. Returns whether it has one.
    pub fn hold(&self, name: &str, held: bool) -> bool {
        let inside = self.inside();
        let member = inside.workers.iter().find(|it| it.name == name);
        let proxy = member.and_then(|it| it.proxy.as_ref());
        proxy.map(|proxy| proxy.hold(held)).is_some()
    }

    /// Kills the coordinator (SIGKILL).
    ///
    /// # Errors
    /// When the signal can't be sent.
    pub fn kill_coordinator(&self) -> Result<()> {
        let mut inside = self.inside();
        let child = inside.coordinator.as_mut().context("no coordinator")?;
        child.kill().context("killing the coordinator")
    }

    /// Sends a signal to the worker with this display name; whether there is one.
    ///
    /// # Errors
    /// When the signal can't be sent.
    pub fn signal_worker(&self, name: &str, signal: Signal) -> Result<bool> {
        let mut inside = self.inside();
        let Some(member) = inside.workers.iter_mut().find(|it| it.name == name) else {
            return Ok(false);
        };
        if member.child.try_wait()?.is_some() {
            return Ok(false);
        }
        send(&member.child, signal)?;
        Ok(true)
    }

    /// Asks the coordinator to end (SIGTERM), and waits; how long it took.
    ///
    /// # Errors
    /// When it does not end within `limit`.
    pub async fn end_coordinator(&self, limit: Duration) -> Result<Duration> {
        let taken = self.inside().coordinator.take();
        let mut child = taken.context("no coordinator")?;
        let began = Instant::now();
        send(&child, Signal::SIGTERM)?;
        while began.elapsed() < limit {
            if child.try_wait()?.is_some() {
                return Ok(began.elapsed());
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        child.kill()?;
        child.wait()?;
        anyhow::bail!("the coordinator did not end within {} s", limit.as_secs())
    }
}

impl Drop for Fleet {
    fn drop(&mut self) {
        let mut inside = self.inside();
        let Inside {
            coordinator,
            workers,
            ..
        } = &mut *inside;
        let workers = workers.iter_mut().map(|member| &mut member.child);
        for child in workers.chain(coordinator) {
            // It may have ended already.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

fn send(child: &Child, signal: Signal) -> Result<()> {
    let id = Pid::from_raw(child.id().try_into()?);
    signal::kill(id, signal).with_context(|| format!("sending {signal}"))
}

/// A free port.
///
/// # Errors
/// When there is none.
pub fn free_port() -> Result<u16> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
    Ok(listener.local_addr()?.port())
}
