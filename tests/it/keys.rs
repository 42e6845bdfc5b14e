//! Keys as an operator and callers use them, by the real command.

use anyhow::{Context, bail, ensure};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};
use yoto_tests::process::{PATIENCE, Service, output, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");

/// Runs the command with a key in its environment.
fn keyed(key: &str, arguments: &[&str]) -> anyhow::Result<Output> {
    Command::new(YOTO)
        .args(arguments)
        .env("YOTO_KEY", key)
        .env("RUST_LOG", "trace")
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("running {arguments:?}"))
}

/// Makes a call until the service refuses it; returns what the command then says.
fn refusal(call: impl Fn() -> anyhow::Result<Output>) -> anyhow::Result<String> {
    let began = Instant::now();
    while began.elapsed() < PATIENCE {
        let output = call()?;
        if !output.status.success() {
            return Ok(String::from_utf8_lossy(&output.stderr).into_owned());
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    bail!("it is still answered")
}

/// Files below `folder` that contain `secret`.
fn files_with(folder: &Path, secret: &str) -> anyhow::Result<Vec<String>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(files_with(&path, secret)?);
            continue;
        }
        let bytes = std::fs::read(&path)?;
        let secret = secret.as_bytes();
        if bytes.windows(secret.len()).any(|it| it == secret) {
            found.push(path.display().to_string());
        }
    }
    Ok(found)
}

#[test]
fn a_newcomer_sees_no_keys_and_an_operator_makes_the_first_one_on_the_host() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let data = dir.path().join("data");
    let service = Service::start(YOTO, &data, false)?;
    let data = data.to_str().context("a path")?;
    let status = ["status", "--server", service.address.as_str()];
    succeed(YOTO, &status)?;
    let create = ["key", "create", "ada", "--data", data];
    let key = succeed(YOTO, &create)?;
    let key = key.trim();
    ensure!(
        key.starts_with("yoto_") && key.lines().count() == 1,
        "{key}"
    );
    // The service learns of it within a second.
    let refused = refusal(|| output(YOTO, &status))?;
    ensure!(
        refused.contains("[KEY_MISSING]") && refused.contains("YOTO_KEY"),
        "{refused}"
    );
    ensure!(keyed(key, &status)?.status.success());
    let file = dir.path().join("ada.key");
    std::fs::write(&file, format!("{key}\n"))?;
    let file = file.to_str().context("a path")?;
    succeed(YOTO, &[&status[..], &["--key-file", file]].concat())?;
    let more = ["key", "list", "--server", service.address.as_str()];
    let refused = keyed(key, &more)?;
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    ensure!(said.contains("the scope operate [SCOPE_MISSING]"), "{said}");
    succeed(YOTO, &["key", "revoke", "ada", "--data", data])?;
    let refused = refusal(|| keyed(key, &status))?;
    ensure!(refused.contains("[KEY_REVOKED]"), "{refused}");
    let listed = succeed(YOTO, &["key", "list", "--data", data])?;
    ensure!(listed.contains("revoked"), "{listed}");
    Ok(())
}

#[test]
fn keys_are_in_no_log_and_no_file() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let data = dir.path().join("data");
    let log = dir.path().join("log");
    let mut serving = Command::new(YOTO)
        .args(["serve", "--no-worker", "--listen", "127.0.0.1:0", "--data"])
        .arg(&data)
        .env("RUST_LOG", "trace")
        .stdin(Stdio::null())
        .stderr(std::fs::File::create(&log)?)
        .spawn()?;
    let told = || -> anyhow::Result<Option<String>> {
        let log = std::fs::read_to_string(&log)?;
        let line = log.lines().find_map(|it| it.split_once("serves "));
        let words = line.and_then(|(_, rest)| rest.split_whitespace().next());
        Ok(words.map(str::to_owned))
    };
    let began = Instant::now();
    let address = loop {
        if let Some(address) = told()? {
            break address;
        }
        ensure!(began.elapsed() < PATIENCE, "no address");
        std::thread::sleep(Duration::from_millis(20));
    };
    let scopes = [
        "--scopes",
        "read,write,operate",
        "--server",
        address.as_str(),
    ];
    let admin = output(YOTO, &[&["key", "create", "admin"], &scopes[..]].concat())?;
    ensure!(admin.status.success());
    let admin = String::from_utf8(admin.stdout)?.trim().to_owned();
    let mut said = String::new();
    let worker = keyed(
        &admin,
        &[
            "key", "create", "w", "--scopes", "work", "--server", &address,
        ],
    )?;
    let key = String::from_utf8(worker.stdout)?.trim().to_owned();
    said.push_str(&String::from_utf8_lossy(&worker.stderr));
    // Malformed by one letter: it is not repeated either.
    let torn = format!("{admin}x");
    for (key, words) in [
        (&admin, &["status"][..]),
        (&admin, &["subject", "list"]),
        (&key, &["status"]),
        (&torn, &["status"]),
        (&admin, &["key", "list", "--output", "json"]),
    ] {
        let ended = keyed(key, &[words, &["--server", &address]].concat())?;
        said.push_str(&String::from_utf8_lossy(&ended.stderr));
        said.push_str(&String::from_utf8_lossy(&ended.stdout));
    }
    serving.kill()?;
    serving.wait()?;
    ensure!(
        said.contains("[SCOPE_MISSING]"),
        "they were not called: {said}"
    );
    let log = std::fs::read_to_string(&log)?;
    ensure!(log.contains("a key was created"), "{log}");
    for secret in [&admin, &key] {
        let digits = secret.trim_start_matches("yoto_");
        ensure!(digits.len() == 64);
        ensure!(!said.contains(digits), "a command tells a key");
        ensure!(!log.contains(digits), "the service's log has a key");
        let files = files_with(&data, digits)?;
        ensure!(files.is_empty(), "a key is in {files:?}");
    }
    Ok(())
}
