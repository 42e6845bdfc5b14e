//! Settings of `yoto serve` from a file: options of the command line win over environment variables, these over the file, and
//! the file over the defaults.
//!
//! The file's keys are the options' names. Its values become the options' defaults before the command line is parsed, so
//! that each value has one parser and one check, wherever it comes from.

mod file;
mod print;

pub(crate) use print::print;

use clap::error::ErrorKind;
use clap::{ArgAction, ArgMatches, Command};
use file::{FileError, FileSetting};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The command whose settings can be in a file.
pub(crate) const COMMAND: &str = "serve";
/// Options of that command that are no settings.
const NOT_SETTINGS: [&str; 6] = [
    "config",
    "print_config",
    "open",
    "log_json",
    "help",
    "version",
];

/// A command line that was parsed with a file.
pub(crate) struct Parsed {
    /// All values.
    pub matches: ArgMatches,
    /// The definition of the command line.
    pub command: Command,
    /// The file, and the ids of the options that it has values for.
    pub file: Option<(PathBuf, BTreeSet<String>)>,
}

/// Parses `arguments`, and the file that they or the environment name.
///
/// # Errors
/// As clap tells them: also for the file, which is named with its line.
pub(crate) fn parse(command: Command, arguments: Vec<OsString>) -> Result<Parsed, clap::Error> {
    let matches = command.clone().try_get_matches_from(&arguments)?;
    let path = matches
        .subcommand_matches(COMMAND)
        .and_then(|serve| serve.get_one::<PathBuf>("config"));
    let Some(path) = path.cloned() else {
        return Ok(Parsed {
            matches,
            command,
            file: None,
        });
    };
    let raw = |error: FileError| clap::Error::raw(ErrorKind::ValueValidation, format!("{error}\n"));
    let entries = file::read(&path, &settings(&command)).map_err(raw)?;
    check(&command, &path, &entries)?;
    let matches = with_defaults(command.clone(), &entries).try_get_matches_from(&arguments)?;
    let ids = entries.into_iter().map(|it| it.id).collect();
    Ok(Parsed {
        matches,
        command,
        file: Some((path, ids)),
    })
}

/// Ids and names of the options that a file can have.
fn settings(command: &Command) -> Vec<(String, String)> {
    let serve = command.find_subcommand(COMMAND);
    let arguments = serve.into_iter().flat_map(|it| it.get_arguments());
    let named =
        arguments.filter_map(|it| Some((it.get_id().to_string(), it.get_long()?.to_owned())));
    named
        .filter(|(id, _)| !NOT_SETTINGS.contains(&id.as_str()))
        .collect()
}

/// The command with the values of `entries` as defaults.
fn with_defaults(command: Command, entries: &[FileSetting]) -> Command {
    command.mut_subcommand(COMMAND, |mut serve| {
        for entry in entries {
            // The definition of a command line keeps defaults for the life of the process.
            let value: &'static str = Box::leak(entry.value.clone().into_boxed_str());
            serve = serve.mut_arg(&entry.id, |it| it.default_value(value));
        }
        serve
    })
}

/// Parses each value by itself, as an option of the command line.
///
/// # Errors
/// With the line of the first value that is refused.
fn check(command: &Command, path: &Path, entries: &[FileSetting]) -> Result<(), clap::Error> {
    let serve = command.find_subcommand(COMMAND);
    for entry in entries {
        let mut arguments = serve.into_iter().flat_map(|it| it.get_arguments());
        let argument = arguments.find(|it| *it.get_id() == entry.id);
        let is_flag = argument.is_some_and(|it| matches!(it.get_action(), ArgAction::SetTrue));
        let place = format!("{}:{}", path.display(), entry.line);
        if is_flag {
            if !["true", "false"].contains(&entry.value.as_str()) {
                let text = format!("{place}: {} is true or false\n", entry.name);
                return Err(clap::Error::raw(ErrorKind::ValueValidation, text));
            }
            continue;
        }
        let option = format!("--{}={}", entry.name, entry.value);
        let one = ["yoto", COMMAND, &option];
        if let Err(error) = command.clone().try_get_matches_from(one) {
            let text = error.to_string();
            let text = format!("{place}: {}", text.trim_start_matches("error: "));
            return Err(clap::Error::raw(error.kind(), text));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
