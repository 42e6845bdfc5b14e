//! Coordinators: each has a seat, whose port and folder are the same for all processes that take it.

use super::{Fleet, free_port, send};
use crate::outside::Outside;
use crate::proxy::{Gate, Proxy, Target};
use anyhow::{Context, Result, bail};
use nix::sys::signal::Signal;
use std::net::{Ipv4Addr, SocketAddr};
use std::time::{Duration, Instant};

/// What all processes of a coordinator have.
#[derive(Debug)]
pub(super) struct Seat {
    port: u16,
    /// The port at which callers are asked for keys.
    door: u16,
    /// Its way to the database, with PostgreSQL.
    database: Option<Proxy>,
}

impl Seat {
    pub(super) async fn new(outside: &Outside) -> Result<Self> {
        let database = match &outside.database {
            Some(database) => {
                let socket = Target::Socket(database.socket());
                Some(Proxy::start(vec![socket]).await?)
            }
            None => None,
        };
        Ok(Self {
            port: free_port()?,
            door: free_port()?,
            database,
        })
    }

    fn address(&self) -> SocketAddr {
        SocketAddr::from((Ipv4Addr::LOCALHOST, self.port))
    }
}

impl Fleet {
    /// Addresses of all coordinators, each the same for all of its processes.
    pub(crate) fn addresses(&self) -> Vec<SocketAddr> {
        self.seats.iter().map(Seat::address).collect()
    }

    /// The address of the first coordinator at which callers are asked for keys.
    pub(crate) fn door(&self) -> SocketAddr {
        let port = self.seats.first().map_or(0, |it| it.door);
        SocketAddr::from((Ipv4Addr::LOCALHOST, port))
    }

    /// Starts all coordinators.
    ///
    /// # Errors
    /// When a process can't be started.
    pub(crate) fn start_coordinators(&self) -> Result<()> {
        (0..self.seats.len()).try_for_each(|number| self.start_coordinator(number))
    }

    fn start_coordinator(&self, number: usize) -> Result<()> {
        let mut inside = self.inside();
        inside.started += 1;
        let seat = self.seats.get(number).context("no such coordinator")?;
        let data = self.outside.data(number);
        std::fs::create_dir_all(&data)?;
        let mut arguments = vec![
            "coordinator".to_owned(),
            format!("--number={number}"),
            format!("--data={}", data.display()),
            format!("--port={}", seat.port),
            format!("--door={}", seat.door),
            format!("--lease-seconds={}", self.lease_seconds),
            format!("--controls={}", self.controls.folder().display()),
            format!("--seed={}", self.seed.wrapping_add(inside.started)),
            format!("--objects={}", self.outside.objects_url()?),
        ];
        if let (Some(proxy), Some(database)) = (&seat.database, &self.outside.database) {
            let (address, name) = (proxy.address(), database.name());
            arguments.push(format!(
                "--database=postgres://postgres@{address}/{name}?sslmode=disable"
            ));
        }
        let log = match number {
            0 => "coordinator".to_owned(),
            more => format!("coordinator-{more}"),
        };
        let child = self.start(&log, &arguments)?;
        if let Some(place) = inside.coordinators.get_mut(number) {
            *place = Some(child);
        }
        Ok(())
    }

    /// Starts coordinators that have ended, unless they are held down. Returns when one was found to have ended.
    pub(super) fn tend_coordinators(&self) -> Result<Option<Instant>> {
        let (mut ended, mut down) = (None, Vec::new());
        {
            let mut inside = self.inside();
            let inside = &mut *inside;
            for (number, place) in inside.coordinators.iter_mut().enumerate() {
                if let Some(child) = place
                    && child.try_wait()?.is_some()
                {
                    *place = None;
                    ended = Some(Instant::now());
                }
                if place.is_none() && !inside.held_down.get(number).is_some_and(|held| *held) {
                    down.push(number);
                }
            }
        }
        for number in down {
            self.start_coordinator(number)?;
        }
        Ok(ended)
    }

    /// Kills a coordinator (SIGKILL). With `held`, nobody starts it again until [`Self::let_start`].
    ///
    /// # Errors
    /// When it does not run.
    pub(crate) fn kill_coordinator(&self, number: usize, held: bool) -> Result<()> {
        let mut inside = self.inside();
        if let Some(down) = inside.held_down.get_mut(number) {
            *down = held;
        }
        let child = inside.coordinators.get_mut(number).and_then(Option::as_mut);
        let child = child.context("this coordinator does not run")?;
        child.kill().context("killing the coordinator")
    }

    /// Lets a coordinator start again.
    pub(crate) fn let_start(&self, number: usize) {
        if let Some(down) = self.inside().held_down.get_mut(number) {
            *down = false;
        }
    }

    /// Opens or closes a coordinator's way to the database.
    ///
    /// # Errors
    /// When it has none.
    pub(crate) fn set_way_to_database(&self, number: usize, gate: Gate) -> Result<()> {
        let seat = self.seats.get(number).and_then(|it| it.database.as_ref());
        seat.context("no way to a database")?.set(gate);
        Ok(())
    }

    /// Asks all coordinators to end (SIGTERM), and waits.
    ///
    /// # Errors
    /// When one does not end within `limit`.
    pub(crate) async fn end_coordinators(&self, limit: Duration) -> Result<()> {
        let taken: Vec<_> = {
            let mut inside = self.inside();
            let all = inside.coordinators.iter_mut();
            all.filter_map(Option::take).collect()
        };
        let began = Instant::now();
        for child in &taken {
            send(child, Signal::SIGTERM)?;
        }
        let mut late = 0;
        for mut child in taken {
            while child.try_wait()?.is_none() {
                if began.elapsed() > limit {
                    late += 1;
                    child.kill()?;
                    child.wait()?;
                    break;
                }
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        }
        match late {
            0 => Ok(()),
            _ => bail!(
                "{late} coordinators did not end within {} s",
                limit.as_secs()
            ),
        }
    }
}
