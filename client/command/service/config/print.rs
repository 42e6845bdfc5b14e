//! `yoto serve --print-config`: a file with all settings, the values in force, and where each comes from.

use super::{COMMAND, Parsed, settings};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches};
use std::fmt::Write;
use yoto_server::PostgresUrl;

/// Longest line of a comment, characters.
const WIDTH: usize = 90;

/// The file, if the command line asks for it.
pub(crate) fn print(parsed: &Parsed) -> Option<String> {
    let matches = parsed.matches.subcommand_matches(COMMAND)?;
    if !matches.get_flag("print_config") {
        return None;
    }
    let serve = parsed.command.find_subcommand(COMMAND)?;
    let mut text = "# Settings of `yoto serve --config FILE`. Options of the command line win over environment variables,\n\
                    # and these over this file.\n"
        .to_owned();
    for (id, name) in settings(&parsed.command) {
        let Some(argument) = serve.get_arguments().find(|it| *it.get_id() == id) else {
            continue;
        };
        text.push('\n');
        let help = argument.get_help().map(ToString::to_string);
        for line in wrapped(&help.unwrap_or_default()) {
            // Writing to a string does not fail.
            let _ = writeln!(text, "# {line}");
        }
        let _ = writeln!(text, "# {}", origin(parsed, matches, argument, &id));
        let _ = match value(matches, argument, &id) {
            Some(value) => writeln!(text, "{name} = {value}"),
            None => writeln!(text, "# {name} ="),
        };
    }
    Some(text)
}

/// Where the value comes from.
fn origin(parsed: &Parsed, matches: &ArgMatches, argument: &Arg, id: &str) -> String {
    let variable = argument.get_env().map(|it| it.to_string_lossy());
    let variable = variable.unwrap_or_default();
    match matches.value_source(id) {
        Some(ValueSource::CommandLine) => "From the command line.".to_owned(),
        Some(ValueSource::EnvVariable) => format!("From the environment variable {variable}."),
        Some(_) => match &parsed.file {
            Some((path, ids)) if ids.contains(id) => format!("From {}.", path.display()),
            _ => format!("The default. Environment variable: {variable}"),
        },
        None => format!("Not set. Environment variable: {variable}"),
    }
}

/// The value as TOML; `None` without one.
fn value(matches: &ArgMatches, argument: &Arg, id: &str) -> Option<String> {
    if let ArgAction::SetTrue = argument.get_action() {
        return Some(matches.get_flag(id).to_string());
    }
    // Shown without its password.
    if let Ok(Some(url)) = matches.try_get_one::<PostgresUrl>(id) {
        return Some(quoted(&url.to_string()));
    }
    let raw = matches.get_raw(id)?.next()?.to_string_lossy().into_owned();
    let is_number =
        raw.parse::<f64>().is_ok() && toml::from_str::<toml::Table>(&format!("v = {raw}")).is_ok();
    Some(match is_number {
        true => raw,
        false => quoted(&raw),
    })
}

/// A text in TOML.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// The text in lines of at most [`WIDTH`] characters.
fn wrapped(text: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.len() + 1 + word.len() <= WIDTH => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}
