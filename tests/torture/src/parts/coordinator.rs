//! A coordinator whose calls arrive several times or stay unanswered, which misses hints of others, whose clock jumps,
//! whose disk fills, and which ends at chosen moments.

use super::controls::Controls;
use super::{CoordinatorArgs, asked_to_stop, disk};
use crate::fault::Fault;
use anyhow::{Context, Result};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::net::Ipv4Addr;
use std::ops::RangeInclusive;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::net::TcpListener;
use yoto_server::clock::{Clock, SystemClock};
use yoto_server::faults::{Delivery, Faults, Moment};
use yoto_server::{Admission, Coordinator, ServerConfig};

/// Time from garbage to its removal: what is still in use must not be garbage.
const GRACE: Duration = Duration::from_secs(6);
/// Interval between checks of the database.
const HEALTH: Duration = Duration::from_millis(200);
/// Share of the calls that arrive more than once.
const REPEATED: f64 = 0.1;
/// Share of the calls that are followed by a late copy.
const LATE: f64 = 0.05;
/// Times after which it does, milliseconds.
const LATE_BY: RangeInclusive<u64> = 50..=4000;
/// Calls that are not copied late: no worker would know of a job leased by the copy, and the job would count as
/// lost with its worker.
const NEVER_LATE: [&str; 2] = ["LeaseJob", "RegisterWorker"];
/// Share of the calls whose answer is lost.
const LOST: f64 = 0.05;
/// Share of the messages with hints of other coordinators that are lost.
const UNHEARD: f64 = 0.3;

/// Serves until SIGTERM.
pub(super) async fn run(settings: CoordinatorArgs) -> Result<()> {
    let CoordinatorArgs {
        number,
        data,
        port,
        door,
        lease_seconds,
        controls,
        seed,
        database,
        objects,
    } = settings;
    let controls = Controls::of(controls);
    let mut config = ServerConfig::new(data);
    config.lease_seconds = lease_seconds;
    config.objects = Some(objects);
    config.reap_interval = Duration::from_millis(100);
    config.storage.min_free_bytes = 0;
    config.storage.grace = GRACE;
    config.storage.collect_interval = Duration::from_secs(1);
    config.health_interval = HEALTH;
    let disk_controls = controls.clone();
    config.clock = Arc::new(JumpingClock {
        controls: controls.clone(),
        number,
        replaced: database.is_some(),
    });
    config.database = database;
    config.faults = Some(Arc::new(Disturbed {
        controls,
        chance: Mutex::new(ChaCha8Rng::seed_from_u64(seed)),
    }));
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).await;
    let listener = listener.with_context(|| format!("port {port}"))?;
    let door = TcpListener::bind((Ipv4Addr::LOCALHOST, door)).await;
    let door = door.context("the port at which callers are asked for keys")?;
    let coordinator = Coordinator::open(config).await.context("opening")?;
    let filling = tokio::spawn(disk::follow(disk_controls));
    let trusted = coordinator.serve(yoto_server::tcp(listener), asked_to_stop());
    let asked = yoto_server::tcp(door);
    let asked = coordinator.serve_to(Admission::Nobody, asked, asked_to_stop());
    let served = futures::try_join!(trusted, asked);
    filling.abort();
    coordinator.close().await;
    served.context("serving").map(drop)
}

/// The system's clock, moved by the controls.
#[derive(Debug)]
struct JumpingClock {
    controls: Controls,
    /// Number of the coordinator.
    number: usize,
    /// Whether the database's clock takes its place.
    replaced: bool,
}

impl Clock for JumpingClock {
    fn now(&self) -> f64 {
        SystemClock.now() + self.controls.clock(self.number)
    }

    fn is_system(&self) -> bool {
        self.replaced
    }

    fn steady(&self) -> f64 {
        SystemClock.steady()
    }
}

/// Disturbs a share of the calls.
#[derive(Debug)]
struct Disturbed {
    controls: Controls,
    chance: Mutex<ChaCha8Rng>,
}

impl Disturbed {
    fn note(&self, fault: Fault) {
        if let Err(error) = self.controls.note(fault) {
            tracing::error!(%error, "could not note a fault");
        }
    }
}

impl Faults for Disturbed {
    fn reached(&self, call: &str, moment: Moment) {
        if let Some(fault) = self.controls.end(call, moment) {
            // Only once: the next process must live, and so must another one that is here too.
            if self.controls.withdraw_end() {
                self.controls.end_here(fault);
            }
        }
    }

    fn delivery(&self, call: &str) -> Delivery {
        let mut chance = self.chance.lock().unwrap_or_else(PoisonError::into_inner);
        let times = match chance.random_bool(REPEATED) {
            true => chance.random_range(2..=3),
            false => 1,
        };
        let late = !NEVER_LATE.contains(&call) && chance.random_bool(LATE);
        let late = late.then(|| Duration::from_millis(chance.random_range(LATE_BY)));
        let answered = !chance.random_bool(LOST);
        drop(chance);
        if times > 1 {
            self.note(Fault::CallRepeated);
        }
        if late.is_some() {
            self.note(Fault::CallLate);
        }
        if !answered {
            self.note(Fault::AnswerLost);
        }
        Delivery {
            times,
            late,
            answered,
        }
    }

    fn hears(&self) -> bool {
        let mut chance = self.chance.lock().unwrap_or_else(PoisonError::into_inner);
        let heard = !chance.random_bool(UNHEARD);
        drop(chance);
        if !heard {
            self.note(Fault::HintLost);
        }
        heard
    }
}
