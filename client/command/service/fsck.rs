//! `yoto fsck`: whether the objects of a service are what its rows say.

use super::state::{ObjectsArgs, StateArgs};
use anyhow::Context;
use clap::Args;
use indicatif::BinaryBytes;
use serde_json::{Value, json};
use std::process::ExitCode;
use yoto_server::Environment;
use yoto_server::fsck::{ObjectFault, Place, Report, fsck};
use yoto_terminal::output;
use yoto_terminal::progress::{ProgressDisplay, count};

/// Exit status if an object is missing or damaged.
const UNSOUND: u8 = 3;
/// Faults that are shown to people.
const SHOWN: usize = 20;

const AFTER_HELP: &str = "\
Reads every object that a row names, and compares its length and its SHA-256. Nothing is changed. The service
may be running: what it is writing or removing is not counted as a fault. You make repairs: delete the resources
that lost objects, or copy the objects from a backup.

Orphans are objects that nothing names and nobody can commit any more. They are not faults: `yoto gc` removes them.

Exit status: 0 if all objects are there, 3 if one is missing or damaged, 1 if the check could not end.

Examples:
  yoto fsck --data /srv/yoto
  yoto fsck --database postgres://yoto@db.example/yoto --objects s3://bucket/prefix
  yoto --output json fsck";

/// Check that every object is there and has its bytes.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Fsck {
    #[command(flatten)]
    state: StateArgs,
    #[command(flatten)]
    objects: ObjectsArgs,
}

impl Fsck {
    pub(crate) async fn run(self) -> anyhow::Result<ExitCode> {
        let place = Place {
            data_dir: self.state.data,
            database: self.state.database,
            objects: self.objects.objects,
            environment: Environment::of_process(),
        };
        let mut display = ProgressDisplay::new("fsck");
        let checked = fsck(&place, |it| display.read(it.bytes, it.of)).await;
        display.clear();
        let report = checked.context("checking the service")?;
        output::put("fsck", json(&report));
        for line in lines(&report) {
            say!("{line}");
        }
        Ok(match report.is_sound() {
            true => ExitCode::SUCCESS,
            false => ExitCode::from(UNSOUND),
        })
    }
}

fn json(report: &Report) -> Value {
    let faults = |faults: &[ObjectFault]| -> Vec<Value> {
        let one = |it: &ObjectFault| json!({"key": it.key, "of": it.of, "what": it.what});
        faults.iter().map(one).collect()
    };
    let orphans = report.orphans.iter();
    let orphans: Vec<Value> = orphans
        .map(|it| json!({"key": it.key, "bytes": it.bytes}))
        .collect();
    json!({
        "sound": report.is_sound(),
        "objects": report.objects,
        "bytes": report.bytes,
        "missing": faults(&report.missing),
        "damaged": faults(&report.damaged),
        "orphans": orphans,
    })
}

/// One line for each of the first faults, and a summary.
fn lines(report: &Report) -> Vec<String> {
    let faults: Vec<&ObjectFault> = report.missing.iter().chain(&report.damaged).collect();
    let mut lines: Vec<String> = (faults.iter().take(SHOWN))
        .map(|it| format!("{} of {}: {}", it.key, it.of, it.what))
        .collect();
    if let Some(more) = faults.len().checked_sub(SHOWN).filter(|more| *more > 0) {
        lines.push(format!("and {more} more; --output json has all"));
    }
    let orphans = match report.orphans.len() {
        0 => "no orphans".to_owned(),
        found => {
            let bytes = report.orphans.iter().map(|it| it.bytes).sum();
            format!("{} of {}", count(found, "orphan"), BinaryBytes(bytes))
        }
    };
    lines.push(format!(
        "{} of {}: {} missing, {} damaged; {orphans}",
        count(
            usize::try_from(report.objects).unwrap_or(usize::MAX),
            "object"
        ),
        BinaryBytes(report.bytes),
        report.missing.len(),
        report.damaged.len(),
    ));
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(missing: usize) -> Report {
        let fault = |number| ObjectFault {
            key: format!("renders/j/1/{number}.png"),
            of: "jobs/j".to_owned(),
            what: "it is missing".to_owned(),
        };
        Report {
            objects: 40,
            bytes: 2048,
            missing: (0..missing).map(fault).collect(),
            ..Report::default()
        }
    }

    #[test]
    fn faults_are_listed_up_to_a_limit_and_always_counted() {
        let sound = "40 objects of 2.00 KiB: 0 missing, 0 damaged; no orphans";
        assert_eq!(lines(&report(0)), [sound]);
        let one = lines(&report(1));
        assert_eq!(one[0], "renders/j/1/0.png of jobs/j: it is missing");
        assert_eq!(lines(&report(SHOWN)).len(), SHOWN + 1);
        let many = lines(&report(SHOWN + 5));
        assert_eq!(many.len(), SHOWN + 2);
        assert_eq!(many[SHOWN], "and 5 more; --output json has all");
        assert_eq!(
            json(&report(25))["missing"].as_array().map(Vec::len),
            Some(25)
        );
    }
}
