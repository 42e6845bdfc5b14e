//! Faults of clients.

use super::Breaker;
use crate::fault::Fault;
use anyhow::{Result, ensure};
use rand::RngExt;

/// Watchers of one job that never read.
const SILENT: usize = 20;

impl Breaker {
    pub(super) async fn cut_upload(&mut self) -> Result<()> {
        let before = self.proxy.cuts();
        let bytes = self.workload.upload_bytes();
        self.proxy.cut_after(self.chance.random_range(1..bytes));
        self.workload.person(0).await?;
        ensure!(self.proxy.cuts() > before, "the upload was not cut");
        self.broken(Fault::UploadCut)
    }

    pub(super) async fn watch_silently(&mut self) -> Result<()> {
        let job = self.running().await?;
        for _ in 0..SILENT {
            match self.calls.watch(&job.name).await {
                Ok(stream) => self.silent.push(stream),
                // It was deleted.
                Err(status) if status.code() == tonic::Code::NotFound => break,
                Err(status) => return Err(status.into()),
            }
        }
        ensure!(!self.silent.is_empty(), "no watcher");
        self.broken(Fault::SilentWatcher)
    }
}
