//! `yoto erased`: who was erased, and what `yoto restore` reads of it.

use anyhow::{Context, ensure};
use clap::Args;
use serde_json::{Deserializer, json};
use std::path::{Path, PathBuf};
use yoto_proto::names::Collection;
use yoto_server::{ErasedPerson, PostgresUrl, erased_in_folder, erased_in_postgres};
use yoto_terminal::output;

const HELP: &str = "\
One line of JSON per person, with the id that they had and without their name. Keep this list outside of the service, and
renew it after each erasure: a backup has the people who were erased after it, and `yoto restore --erased` reads the list.

Examples:
  yoto erased --data /srv/yoto --out erased.jsonl
  yoto restore /backup/monday --data /srv/yoto2 --erased erased.jsonl";

/// List who was erased from a service, for `yoto restore`.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(crate) struct Erased {
    #[command(flatten)]
    place: Place,
    /// Write the list to this file instead of printing it.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// The service's database.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Place {
    /// The service's data folder, on its host. The service may be running. Run this as the service's user.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// The service's database in PostgreSQL, postgres://USER@HOST/NAME. The service may be running.
    #[arg(long, value_name = "URL")]
    database: Option<PostgresUrl>,
}

impl Erased {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let people = match (&self.place.data, &self.place.database) {
            (_, Some(url)) => erased_in_postgres(url).await?,
            (Some(folder), None) => erased_in_folder(folder).await?,
            (None, None) => anyhow::bail!("name the service's database with --data or --database"),
        };
        output::put("erased", json!(people));
        let lines: Result<Vec<String>, _> = people.iter().map(serde_json::to_string).collect();
        let lines = lines?;
        match &self.out {
            Some(path) => {
                let text: String = lines.iter().map(|it| format!("{it}\n")).collect();
                std::fs::write(path, text)
                    .with_context(|| format!("writing {}", path.display()))?;
                tell!("{} people were erased: {}", people.len(), path.display());
            }
            None => {
                for line in &lines {
                    say!("{line}");
                }
            }
        }
        Ok(())
    }
}

/// The people in a file: a list by `yoto erased`, or reports of erasures.
pub(super) fn read(path: &Path) -> anyhow::Result<Vec<ErasedPerson>> {
    let named = || path.display().to_string();
    let text = std::fs::read_to_string(path).with_context(named)?;
    let people: Result<Vec<ErasedPerson>, _> = Deserializer::from_str(&text).into_iter().collect();
    let people = people.with_context(named)?;
    for person in &people {
        let subject = &person.subject;
        ensure!(
            Collection::Subjects.parse(subject).is_ok(),
            "{}: subject '{subject}' is not of the form subjects/ID",
            named()
        );
    }
    Ok(people)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> anyhow::Result<Vec<ErasedPerson>> {
        let folder = tempfile::TempDir::new().expect("a folder");
        let path = folder.path().join("erased.jsonl");
        std::fs::write(&path, text).expect("writes");
        read(&path)
    }

    #[test]
    fn lists_and_reports_are_read() {
        let line = r#"{"erasure": "erasures/1", "subject": "subjects/a"}"#;
        let report = r#"{
            "version": 1,
            "erasure": "erasures/2",
            "subject": "subjects/b",
            "name_sha256": "00"
        }"#;
        let people = of(&format!("{line}\n{line}\n{report}")).expect("reads");
        let subjects: Vec<_> = people.iter().map(|it| it.subject.as_str()).collect();
        assert_eq!(subjects, ["subjects/a", "subjects/a", "subjects/b"]);
        assert_eq!(of("").expect("reads"), []);
    }

    #[test]
    fn what_names_nobody_is_refused_by_file_and_field() {
        for (text, field) in [
            (r#"{"erasure": "erasures/1"}"#, "subject"),
            (r#"{"erasure": "erasures/1", "subject": "ada"}"#, "subject"),
            ("ada", "line 1"),
        ] {
            let told = format!("{:#}", of(text).expect_err(text));
            assert!(
                told.contains("erased.jsonl") && told.contains(field),
                "{told}"
            );
        }
    }
}
