//! The tour of the documentation, command by command, as a newcomer types it.

use anyhow::{Context, ensure};
use std::path::{Path, PathBuf};
use std::process::Command;
use yoto_tests::process::Service;

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const TOUR: &str = include_str!("../../docs/use/tour.md");

/// Commands of the tour, in order, without the commands of the terminal that serves.
fn commands() -> Vec<&'static str> {
    let mut inside = false;
    let mut found = Vec::new();
    for line in TOUR.lines() {
        if line.starts_with("```") {
            inside = line == "```sh";
        } else if inside {
            found.push(line);
        }
    }
    found
}

#[test]
fn every_command_of_the_tour_works() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let commands = commands();
    ensure!(commands.len() > 10, "{commands:?}");
    for command in commands {
        let words = command
            .split('#')
            .next()
            .unwrap_or_default()
            .split_whitespace();
        // A short training is enough to see that all commands work.
        let mut words: Vec<&str> = words
            .map(|word| if word == "60" { "3" } else { word })
            .collect();
        ensure!(words.remove(0) == "yoto", "{command}");
        let output = Command::new(YOTO)
            .args(&words)
            .current_dir(dir.path())
            .env("YOTO_SERVER", &service.address)
            .output()
            .with_context(|| command.to_owned())?;
        let said = String::from_utf8_lossy(&output.stderr);
        ensure!(output.status.success(), "{command}: {said}");
    }
    // The pictures that it promises.
    let promised: Vec<PathBuf> = TOUR
        .split('`')
        .filter(|text| text.ends_with(".png") && !text.contains(' '))
        .map(|text| dir.path().join(text))
        .collect();
    ensure!(promised.len() > 3, "{promised:?}");
    for picture in &promised {
        ensure!(is_picture(picture), "{} is missing", picture.display());
    }
    Ok(())
}

fn is_picture(path: &Path) -> bool {
    image::open(path).is_ok()
}
