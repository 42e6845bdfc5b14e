//! Settings of files, environment and command line.

use super::*;
use crate::cli::Cli;
use clap::{CommandFactory, FromArgMatches};

/// Parses `line` with a file of `text` at `{file}`.
fn parsed(line: &str, text: &str) -> Result<Parsed, String> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("yoto.toml");
    std::fs::write(&path, text).expect("writes");
    let arguments = line.split(' ').map(|word| match word {
        "{file}" => path.clone().into_os_string(),
        word => word.into(),
    });
    parse(Cli::command(), arguments.collect()).map_err(|error| error.to_string())
}

#[test]
fn the_command_line_wins_over_the_file_and_the_file_over_defaults() {
    let text =
        "keep-newest = 7\ngrace-hours = 1.5\nno-worker = true\nlisten = \"127.0.0.1:6000\"\n";
    let line = "yoto serve --config {file} --keep-newest 2 --print-config";
    let parsed = parsed(line, text).expect("parses");
    Cli::from_arg_matches(&parsed.matches).expect("is whole");
    let printed = print(&parsed).expect("was asked for");
    for line in [
        "keep-newest = 2",
        "grace-hours = 1.5",
        "no-worker = true",
        "listen = \"127.0.0.1:6000\"",
        "keep-every = 10",
        "# From the command line.",
        "# The default. Environment variable: YOTO_KEEP_EVERY",
    ] {
        assert!(printed.lines().any(|it| it == line), "{line} in {printed}");
    }
    let from_file = printed.lines().filter(|it| it.ends_with("yoto.toml."));
    assert_eq!(from_file.count(), 3, "{printed}");
}

#[test]
fn what_is_printed_can_be_read_again() {
    let first = parsed("yoto serve --print-config", "").expect("parses");
    let first = print(&first).expect("was asked for");
    let again = parsed("yoto serve --config {file} --print-config", &first).expect("parses");
    let values = |text: &str| -> Vec<String> {
        let lines = text.lines().filter(|it| !it.starts_with('#'));
        lines.map(str::to_owned).collect()
    };
    let again = print(&again).expect("was asked for");
    assert_eq!(values(&first), values(&again));
}

#[test]
fn a_password_is_not_printed() {
    let line = "yoto serve --database postgres://me:secret@db/yoto --print-config";
    let printed = print(&parsed(line, "").expect("parses")).expect("was asked for");
    assert!(
        printed.contains("db/yoto") && !printed.contains("secret"),
        "{printed}"
    );
}

#[test]
fn a_bad_value_is_named_with_its_line() {
    let told = |text: &str| match parsed("yoto serve --config {file}", text) {
        Err(told) => told,
        Ok(_) => panic!("{text} was accepted"),
    };
    let port = told("keep-every = 3\nlisten = \"nowhere\"\n");
    assert!(
        port.contains("yoto.toml:2: ") && port.contains("--listen"),
        "{port}"
    );
    let flag = told("no-worker = \"perhaps\"");
    assert!(flag.contains("yoto.toml:1: "), "{flag}");
    assert!(told("lisen = 3").contains("did you mean listen?"));
}

#[test]
fn each_setting_has_a_variable_of_its_name() {
    let command = Cli::command();
    let serve = command.find_subcommand(COMMAND).expect("is there");
    for (id, name) in settings(&command) {
        let argument = serve.get_arguments().find(|it| *it.get_id() == id);
        let variable = argument
            .and_then(|it| it.get_env())
            .map(|it| it.to_string_lossy());
        let expected = match name.as_str() {
            // As other programs have it.
            "otlp" => "OTEL_EXPORTER_OTLP_ENDPOINT".to_owned(),
            name => format!("YOTO_{}", name.replace('-', "_").to_uppercase()),
        };
        assert_eq!(variable.as_deref(), Some(expected.as_str()), "--{name}");
    }
}
