//! The processes of the service: started, killed, stopped, and started again when they have ended.

mod coordinators;

use super::outside::Outside;
use super::parts::Controls;
use super::proxy::{Gate, Proxy, Target};
use super::records::Records;
use anyhow::{Context, Result};
use coordinators::Seat;
use nix::sys::signal::{self, Signal};
use nix::unistd::Pid;
use std::fs::OpenOptions;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Coordinators and their workers in a folder.
#[derive(Debug)]
pub(crate) struct Fleet {
    program: PathBuf,
    folder: PathBuf,
    lease_seconds: f64,
    seed: u64,
    controls: Controls,
    outside: Outside,
    seats: Vec<Seat>,
    inside: Mutex<Inside>,
}

#[derive(Debug, Default)]
struct Inside {
    /// The process in each seat; none while it is down.
    coordinators: Vec<Option<Child>>,
    /// Whether nobody starts it again.
    held_down: Vec<bool>,
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
    /// Its proxies to the coordinators, which its replacement takes over; none: the worker is not replaced.
    proxies: Vec<Proxy>,
}

impl Fleet {
    /// A fleet without processes, in `folder`, with `coordinators` to come.
    ///
    /// # Errors
    /// When a folder can't be made, or no port is free.
    pub(crate) async fn new(
        folder: &Path,
        outside: Outside,
        coordinators: usize,
        lease_seconds: f64,
        seed: u64,
    ) -> Result<Self> {
        let controls = Controls::of(folder.join("controls"));
        std::fs::create_dir_all(controls.folder())?;
        let mut seats = Vec::new();
        for _ in 0..coordinators {
            seats.push(Seat::new(&outside).await?);
        }
        Ok(Self {
            program: std::env::current_exe()?,
            folder: folder.to_owned(),
            lease_seconds,
            seed,
            controls,
            outside,
            inside: Mutex::new(Inside {
                coordinators: seats.iter().map(|_| None).collect(),
                held_down: vec![false; seats.len()],
                ..Inside::default()
            }),
            seats,
        })
    }

    /// What goes wrong in the processes.
    pub(crate) fn controls(&self) -> &Controls {
        &self.controls
    }

    /// What the processes share.
    pub(crate) fn outside(&self) -> &Outside {
        &self.outside
    }

    /// The service's records.
    pub(crate) fn records(&self) -> Records {
        match self.outside.database_url() {
            Some(url) => Records::Postgres(url),
            None => Records::Sqlite(self.outside.data(0).join("yoto.db")),
        }
    }

    /// Folder of all data and logs.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Length of a lease.
    pub(crate) fn lease(&self) -> Duration {
        Duration::from_secs_f64(self.lease_seconds)
    }

    fn inside(&self) -> MutexGuard<'_, Inside> {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts a worker that is replaced when it ends. It reaches each coordinator through its own proxy, which
    /// can be blocked.
    ///
    /// # Errors
    /// When the process can't be started.
    pub(crate) async fn start_lasting(&self) -> Result<String> {
        let mut proxies = Vec::new();
        for address in self.addresses() {
            proxies.push(Proxy::start(vec![Target::Port(address)]).await?);
        }
        self.start_worker(proxies, None)
    }

    /// Starts a worker that can't write files above `largest_file` bytes. Nothing replaces it.
    ///
    /// # Errors
    /// When the process can't be started.
    pub(crate) fn start_full(&self, largest_file: u64) -> Result<String> {
        self.start_worker(Vec::new(), Some(largest_file))
    }

    /// Starts a worker and returns its display name.
    fn start_worker(&self, proxies: Vec<Proxy>, largest_file: Option<u64>) -> Result<String> {
        let mut inside = self.inside();
        inside.started += 1;
        let name = format!("worker-{}", inside.started);
        let service = match proxies.is_empty() {
            true => self.addresses(),
            false => proxies.iter().map(Proxy::address).collect(),
        };
        let service: Vec<String> = service.iter().map(SocketAddr::to_string).collect();
        let mut arguments = vec![
            "worker".to_owned(),
            format!("--service={}", service.join(",")),
            format!("--objects={}", self.outside.objects_url()?),
            format!("--name={name}"),
            format!("--controls={}", self.controls.folder().display()),
        ];
        arguments.extend(largest_file.map(|bytes| format!("--largest-file={bytes}")));
        let child = self.start(&name, &arguments)?;
        inside.workers.push(Member {
            name: name.clone(),
            child,
            proxies,
        });
        Ok(name)
    }

    /// Starts a service in one process, which belongs to the caller.
    ///
    /// # Errors
    /// When the process can't be started.
    pub(crate) fn start_embedded(&self, port: u16) -> Result<Child> {
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
            .envs(self.outside.environment())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()
            .with_context(|| format!("starting {} {arguments:?}", self.program.display()))
    }

    /// Starts what has ended again. Returns when a coordinator was found to have ended.
    ///
    /// # Errors
    /// When a process can't be started.
    pub(crate) fn tend(&self) -> Result<Option<Instant>> {
        let ended = self.tend_coordinators()?;
        let mut proxies = Vec::new();
        {
            let mut inside = self.inside();
            let mut alive = Vec::new();
            for mut member in std::mem::take(&mut inside.workers) {
                match member.child.try_wait()? {
                    None => alive.push(member),
                    Some(status) => {
                        // A killed one has no code.
                        inside.gave_up += u64::from(status.code().is_some_and(|code| code != 0));
                        proxies.push(member.proxies);
                    }
                }
            }
            inside.workers = alive;
        }
        for proxies in proxies.into_iter().filter(|it| !it.is_empty()) {
            self.start_worker(proxies, None)?;
        }
        Ok(ended)
    }

    /// Number of workers that have ended by themselves, with an error.
    pub(crate) fn gave_up(&self) -> u64 {
        self.inside().gave_up
    }

    /// The proxies of the worker with this display name, one to each coordinator; empty without the worker.
    pub(crate) fn proxies(&self, name: &str) -> Vec<Proxy> {
        let inside = self.inside();
        let member = inside.workers.iter().find(|it| it.name == name);
        member.map(|it| it.proxies.clone()).unwrap_or_default()
    }

    /// Holds back what the worker with this display name sends and gets, or lets it pass. Returns whether there is one.
    pub(crate) fn hold(&self, name: &str, held: bool) -> bool {
        let proxies = self.proxies(name);
        let gate = if held { Gate::Held } else { Gate::Open };
        for proxy in &proxies {
            proxy.set(gate);
        }
        !proxies.is_empty()
    }

    /// Sends a signal to the worker with this display name; whether there is one.
    ///
    /// # Errors
    /// When the signal can't be sent.
    pub(crate) fn signal_worker(&self, name: &str, signal: Signal) -> Result<bool> {
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
}

impl Drop for Fleet {
    fn drop(&mut self) {
        let mut inside = self.inside();
        let Inside {
            coordinators,
            workers,
            ..
        } = &mut *inside;
        let workers = workers.iter_mut().map(|member| &mut member.child);
        for child in workers.chain(coordinators.iter_mut().flatten()) {
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
pub(crate) fn free_port() -> Result<u16> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
    Ok(listener.local_addr()?.port())
}
