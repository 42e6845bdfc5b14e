//! Files: Landlock (Linux 5.13 and later; `man 7 landlock`).

use super::{Extent, Room};
use landlock::{
    ABI, Access, AccessFs, AccessNet, BitFlags, CompatLevel, Compatible, PathBeneath, PathFd,
    Ruleset, RulesetAttr, RulesetCreated, RulesetCreatedAttr, RulesetError, RulesetStatus, Scope,
    path_beneath_rules,
};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The latest rights that are asked for: files, their length, devices, TCP, signals and abstract sockets. An earlier kernel
/// refuses what it has of them.
const RIGHTS: ABI = ABI::V6;
/// Folders of programs and libraries, for a program that the process starts.
const SYSTEM: [&str; 8] = [
    "/usr",
    "/bin",
    "/lib",
    "/lib64",
    "/nix/store",
    "/gnu/store",
    "/etc/ld.so.cache",
    "/etc/ld.so.preload",
];
/// Devices without content that programs open.
const DEVICES: [&str; 4] = ["/dev/null", "/dev/zero", "/dev/random", "/dev/urandom"];

/// Why files can't be confined.
#[derive(Debug, Error)]
pub(super) enum FilesError {
    #[error("{path}: {error}")]
    Folder { path: String, error: String },
    #[error(transparent)]
    Ruleset(#[from] RulesetError),
}

/// Refuses the calling thread all files, TCP ports, signals and abstract sockets that `room` does not name.
pub(super) fn confine(room: &Room) -> Result<Extent, FilesError> {
    let all = AccessFs::from_all(RIGHTS);
    let read: BitFlags<AccessFs> = AccessFs::ReadFile | AccessFs::ReadDir;
    let write = all & !AccessFs::Execute;
    let rules = Ruleset::default()
        .set_compatibility(CompatLevel::BestEffort)
        .handle_access(all)?
        .handle_access(AccessNet::from_all(RIGHTS))?
        .scope(Scope::from_all(RIGHTS))?
        .create()?;
    let folder = PathFd::new(&room.folder).map_err(|error| FilesError::Folder {
        path: room.folder.display().to_string(),
        error: error.to_string(),
    })?;
    let rules = rules
        .add_rule(PathBeneath::new(folder, write))?
        .add_rules(path_beneath_rules(&room.read, read))?
        // Its own figures, such as the most memory that it had.
        .add_rules(path_beneath_rules(["/proc/self"], read))?
        .add_rules(path_beneath_rules(DEVICES, read | AccessFs::WriteFile))?;
    let rules = match &room.program {
        Some(program) => with_program(rules, program.clone())?,
        None => rules,
    };
    Ok(match rules.restrict_self()?.ruleset {
        RulesetStatus::FullyEnforced => Extent::Full,
        RulesetStatus::PartiallyEnforced => Extent::Partial,
        RulesetStatus::NotEnforced => Extent::None,
    })
}

/// Allows to run `program` with its libraries, too. Programs that it starts are confined as well.
fn with_program(rules: RulesetCreated, program: PathBuf) -> Result<RulesetCreated, RulesetError> {
    let run: BitFlags<AccessFs> = AccessFs::Execute | AccessFs::ReadFile | AccessFs::ReadDir;
    let real = program.canonicalize().unwrap_or_else(|_| program.clone());
    let named = std::env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    let libraries = std::env::split_paths(&named).filter(|path| path.is_absolute());
    let own = [&program, &real].map(|it| own_libraries(it));
    rules
        .add_rules(path_beneath_rules(SYSTEM, run))?
        .add_rules(path_beneath_rules([&program, &real], run))?
        .add_rules(path_beneath_rules(own.into_iter().flatten(), run))?
        .add_rules(path_beneath_rules(libraries, run))
}

/// The libraries of a `program` that is installed with its own, as `PREFIX/bin/PROGRAM` and `PREFIX/lib`.
fn own_libraries(program: &Path) -> Option<PathBuf> {
    let folder = program.parent()?;
    (folder.file_name()? == "bin").then(|| folder.with_file_name("lib"))
}
