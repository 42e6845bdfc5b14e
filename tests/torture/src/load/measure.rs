//! Latencies of calls, and the memory of a process.

use anyhow::{Context, Result};
use std::fmt;
use std::future::Future;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Latencies of one kind of calls.
pub(super) struct Latencies {
    name: &'static str,
    times: Mutex<Vec<Duration>>,
}

impl Latencies {
    pub(super) fn new(name: &'static str) -> Self {
        Self {
            name,
            times: Mutex::default(),
        }
    }

    /// Times a call.
    ///
    /// # Errors
    /// When the call fails.
    pub(super) async fn time<T, E>(&self, call: impl Future<Output = Result<T, E>>) -> Result<T>
    where
        anyhow::Error: From<E>,
    {
        let began = Instant::now();
        let answer = call.await?;
        let mut times = self.times.lock().unwrap_or_else(PoisonError::into_inner);
        times.push(began.elapsed());
        Ok(answer)
    }

    /// Number of calls so far.
    pub(super) fn count(&self) -> usize {
        self.times
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .len()
    }
}

/// `p50 and p99, ms: name, number`.
impl fmt::Display for Latencies {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut times = self
            .times
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone();
        times.sort_unstable();
        let at = |share: f64| {
            let index = (share * times.len().saturating_sub(1) as f64).round() as usize;
            times
                .get(index)
                .map_or(0.0, |time| time.as_secs_f64() * 1e3)
        };
        let (half, most) = (at(0.5), at(0.99));
        let count = times.len();
        write!(
            f,
            "{half:>9.2} ms p50, {most:>9.2} ms p99: {} ({count} calls)",
            self.name
        )
    }
}

/// Memory of a process that is in RAM.
///
/// # Errors
/// When the system is not Linux.
pub(super) fn resident_bytes(process: u32) -> Result<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status"))?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kib = line.and_then(|line| line.split_whitespace().next());
    Ok(kib.context("VmRSS")?.parse::<u64>()? << 10)
}
