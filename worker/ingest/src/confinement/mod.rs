//! Confinement of the child by the kernel: files by Landlock, system calls by seccomp. A decoder that a file has taken over
//! reads nothing else of this user, reaches no network, and leaves nothing behind.
//!
//! Both hold for the calling thread, the threads and the programs that it starts, and can't be taken back. What a kernel
//! lacks is left out and named by [`Confinement`].

#[cfg(target_os = "linux")]
mod calls;
#[cfg(target_os = "linux")]
mod files;

use std::fmt;
use std::path::PathBuf;

/// What a confined process may use.
#[derive(Debug, Clone, Default)]
pub(crate) struct Room {
    /// The folder in which it reads and writes.
    pub(crate) folder: PathBuf,
    /// Files that it only reads.
    pub(crate) read: Vec<PathBuf>,
    /// The program that it may start; without one, it starts no process.
    pub(crate) program: Option<PathBuf>,
}

/// How far the kernel confines a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Confinement {
    /// Files outside of its folder.
    pub files: Extent,
    /// Network, processes and other system calls that decoders do not need.
    pub calls: Extent,
}

/// The extent of one part of a confinement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// The kernel supports all of it.
    Full,
    /// The kernel supports a part of it; later kernels support more.
    Partial,
    /// The kernel supports none of it.
    None,
}

impl Confinement {
    /// The confinement of a child on this machine, tried in a thread of its own.
    ///
    /// # Errors
    /// When the kernel refuses a confinement that it supports.
    pub fn of_this_machine() -> Result<Self, String> {
        let tried = std::thread::spawn(|| {
            let folder = std::env::temp_dir();
            confine(&Room {
                folder,
                ..Room::default()
            })
        });
        tried
            .join()
            .map_err(|_| "a thread that confines itself panicked".to_owned())?
    }

    /// Whether files outside of its folder and system calls are both refused.
    pub fn is_whole(&self) -> bool {
        self.files != Extent::None && self.calls == Extent::Full
    }
}

impl fmt::Display for Confinement {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let files = match self.files {
            Extent::Full => "its own alone (Landlock)",
            Extent::Partial => "its own alone, as far as this kernel's Landlock goes",
            Extent::None => "ALL OF THIS USER, since the kernel has no Landlock",
        };
        let calls = match self.calls {
            Extent::Full | Extent::Partial => "none (seccomp)",
            Extent::None => "ALL, since the kernel has no seccomp",
        };
        write!(
            out,
            "what the process that decodes uploads can use: files: {files}; network: {calls}"
        )
    }
}

/// Confines the calling thread to `room`.
///
/// # Errors
/// When the kernel refuses a confinement that it supports, or a folder that can't be opened.
#[cfg(target_os = "linux")]
pub(crate) fn confine(room: &Room) -> Result<Confinement, String> {
    let files = files::confine(room).map_err(|error| format!("confining files: {error}"))?;
    let calls = calls::confine(room.program.is_some())
        .map_err(|error| format!("confining system calls: {error}"))?;
    Ok(Confinement { files, calls })
}

/// Confines nothing: there is no Landlock and no seccomp on this system.
///
/// # Errors
/// None.
#[cfg(not(target_os = "linux"))]
pub(crate) fn confine(_: &Room) -> Result<Confinement, String> {
    Ok(Confinement {
        files: Extent::None,
        calls: Extent::None,
    })
}

#[cfg(all(test, target_os = "linux"))]
mod tests;
