//! The requested faults, in a folder of small files. The torture writes them; its processes read them and note
//! what happened, so that even a process that ends itself leaves a note.

use crate::fault::Fault;
use anyhow::{Context, Result};
use nix::sys::signal;
use nix::unistd::Pid;
use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use yoto_server::faults::Moment;

/// How the workers' object store fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StoreFault {
    /// With an error.
    Error,
    /// After a while.
    Late,
    /// In the middle of an object.
    Half,
    /// Never, and nor does the thread that asks.
    Never,
}

impl StoreFault {
    const ALL: [Self; 4] = [Self::Error, Self::Late, Self::Half, Self::Never];

    /// Its kind of fault.
    pub(crate) fn fault(self) -> Fault {
        match self {
            Self::Error => Fault::StoreError,
            Self::Late => Fault::StoreLate,
            Self::Half => Fault::StoreHalf,
            Self::Never => Fault::JobHung,
        }
    }
}

const MOMENTS: [(Moment, Fault); 3] = [
    (Moment::BeforeCommit, Fault::EndBeforeCommit),
    (Moment::AfterCommit, Fault::EndAfterCommit),
    (Moment::BeforeReply, Fault::EndBeforeReply),
];

/// The folder.
#[derive(Debug, Clone)]
pub(crate) struct Controls(PathBuf);

impl Controls {
    /// The controls in `folder`.
    pub(crate) fn of(folder: PathBuf) -> Self {
        Self(folder)
    }

    /// The folder.
    pub(crate) fn folder(&self) -> &Path {
        &self.0
    }

    /// Moves the clock of the coordinator with this number to `seconds` after the system's.
    ///
    /// # Errors
    /// When the file can't be written.
    pub(crate) fn set_clock(&self, coordinator: usize, seconds: f64) -> Result<()> {
        self.write(&format!("clock-{coordinator}"), &seconds.to_string())
    }

    /// Seconds by which that coordinator's clock is ahead.
    pub(crate) fn clock(&self, coordinator: usize) -> f64 {
        let text = self.read(&format!("clock-{coordinator}"));
        text.and_then(|text| text.parse().ok()).unwrap_or(0.0)
    }

    /// Has one of the coordinators end at the next `fault` of a `call`.
    ///
    /// # Errors
    /// When the file can't be written.
    pub(crate) fn set_end(&self, fault: Fault, call: &str) -> Result<()> {
        self.write("end", &format!("{} {call}", fault.name()))
    }

    /// Withdraws it; whether it was still to come.
    pub(crate) fn withdraw_end(&self) -> bool {
        std::fs::remove_file(self.0.join("end")).is_ok()
    }

    /// The kind of end, if the coordinator is to end now.
    pub(crate) fn end(&self, call: &str, moment: Moment) -> Option<Fault> {
        let text = self.read("end")?;
        let (fault, wanted) = text.split_once(' ')?;
        let (_, kind) = MOMENTS.into_iter().find(|(at, _)| *at == moment)?;
        (wanted == call && kind.name() == fault).then_some(kind)
    }

    /// Has the workers' store fail in one way, or work.
    ///
    /// # Errors
    /// When the file can't be written.
    pub(crate) fn set_store(&self, fault: Option<StoreFault>) -> Result<()> {
        self.write("store", fault.map_or("", |it| it.fault().name()))
    }

    /// How the workers' store fails now.
    pub(crate) fn store(&self) -> Option<StoreFault> {
        let text = self.read("store")?;
        let mut kinds = StoreFault::ALL.into_iter();
        kinds.find(|it| it.fault().name() == text)
    }

    /// Sets whether the coordinator's writes to files fail, as on a full disk.
    ///
    /// # Errors
    /// When the file can't be written.
    pub(crate) fn set_full(&self, full: bool) -> Result<()> {
        self.write("full", if full { "full" } else { "" })
    }

    /// Whether the coordinator's writes to files fail.
    pub(crate) fn is_full(&self) -> bool {
        self.read("full").is_some_and(|text| !text.is_empty())
    }

    /// Has each worker end that touches an object with `part` in its key; an empty one: none.
    ///
    /// # Errors
    /// When the file can't be written.
    pub(crate) fn set_poison(&self, part: &str) -> Result<()> {
        self.write("poison", part)
    }

    /// Whether the object at `key` ends a worker.
    pub(crate) fn is_poison(&self, key: &str) -> bool {
        let part = self.read("poison");
        part.is_some_and(|part| !part.is_empty() && key.contains(&part))
    }

    /// Notes that something was broken.
    ///
    /// # Errors
    /// When it can't be written.
    pub(crate) fn note(&self, fault: Fault) -> Result<()> {
        let path = self.0.join("notes");
        let file = OpenOptions::new().append(true).create(true).open(&path);
        let mut file = file.with_context(|| path.display().to_string())?;
        // One write, so that notes of several processes never mix.
        file.write_all(format!("{}\n", fault.name()).as_bytes())?;
        Ok(())
    }

    /// Notes it, and ends this process at once.
    pub(crate) fn end_here(&self, fault: Fault) -> ! {
        if let Err(error) = self.note(fault) {
            tracing::error!(%error, "could not note a fault");
        }
        // SIGKILL leaves no time for anything; an abort is as good if it can't be sent.
        let _ = signal::kill(Pid::this(), signal::Signal::SIGKILL);
        std::process::abort()
    }

    /// How often each kind of fault was noted.
    pub(crate) fn noted(&self) -> BTreeMap<Fault, usize> {
        let mut counts = BTreeMap::new();
        let text = self.read("notes").unwrap_or_default();
        for fault in text.lines().filter_map(Fault::of_name) {
            *counts.entry(fault).or_default() += 1;
        }
        counts
    }

    fn read(&self, name: &str) -> Option<String> {
        std::fs::read_to_string(self.0.join(name)).ok()
    }

    /// Replaces a file as a whole: its readers never see half of it.
    fn write(&self, name: &str, text: &str) -> Result<()> {
        let (path, new) = (self.0.join(name), self.0.join(format!("{name}.new")));
        std::fs::write(&new, text).with_context(|| new.display().to_string())?;
        std::fs::rename(&new, &path).with_context(|| path.display().to_string())
    }
}
