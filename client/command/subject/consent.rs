//! `yoto subject consent` and `revoke-consent`: what a person agrees to.

use crate::args::Server;
use crate::show::now;
use anyhow::{Context, ensure};
use clap::{Args, ValueEnum};
use prost_types::Timestamp;
use std::path::{Path, PathBuf};
use yoto_client::NewConsent;
use yoto_proto::limits::EVIDENCE_BYTES;
use yoto_proto::v1::consent_item::State;
use yoto_proto::v1::{Consent, ConsentPurpose};
use yoto_terminal::output::{self, others};
use yoto_terminal::progress::count;

pub(crate) const GRANT_HELP: &str = "\
Records what the person agrees to: everything, unless --for says otherwise. A purpose has consent as long as any
record of it is valid. Once a consent has been recorded, its end stops jobs: new ones are refused, and open ones end.
A service with `yoto serve --require-consent` also refuses jobs of people without a recorded consent. `yoto subject
show` lists the records.

train: trainings and measurements; render: pictures, also of others who move as in the person's capture;
export: files for other programs; share: links to pages (`yoto share`), and files that are given to others, which the
service only records.

Examples:
  yoto subject consent ada --for train,render --until 2027-12-31
  yoto subject consent ada --evidence signed-form.pdf
  yoto subject consent ada --by \"Ada's father\" --note \"signed form 17\"";
pub(crate) const REVOKE_HELP: &str = "\
Open jobs that need the person for these purposes end at once, and new ones are refused. Files that were made before
stay: `yoto subject delete` and `yoto job delete` remove them.

Examples:
  yoto subject revoke-consent ada
  yoto subject revoke-consent ada --for render --note \"by telephone\"";

/// What a person can agree to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Purpose {
    Train,
    Render,
    Export,
    Share,
}

impl From<Purpose> for ConsentPurpose {
    fn from(purpose: Purpose) -> Self {
        match purpose {
            Purpose::Train => Self::ConsentTrain,
            Purpose::Render => Self::ConsentRender,
            Purpose::Export => Self::ConsentExport,
            Purpose::Share => Self::ConsentShare,
        }
    }
}

/// A consent to record.
#[derive(Debug, Args)]
pub(crate) struct Grant {
    /// The person, by name.
    name: String,
    /// Purposes that the person agrees to, separated by commas.
    #[arg(
        long = "for",
        value_enum,
        value_delimiter = ',',
        value_name = "PURPOSE",
        default_values = ["train", "render", "export", "share"]
    )]
    purposes: Vec<Purpose>,
    /// Last day (UTC) on which the consent is valid, such as 2027-12-31, or its end, such as 2027-12-31T12:00:00Z
    /// [default: no end].
    #[arg(long, value_name = "DATE", value_parser = until)]
    until: Option<Timestamp>,
    /// Who gave the consent, if not the person.
    #[arg(long, value_name = "WHO", default_value = "")]
    by: String,
    /// Note, such as where the signed form is.
    #[arg(long, value_name = "TEXT", default_value = "")]
    note: String,
    /// File that proves the consent, such as a signed form, at most 3 MiB. It is stored with the record, and deleted
    /// with the person.
    #[arg(long, value_name = "FILE")]
    evidence: Option<PathBuf>,
    #[command(flatten)]
    server: Server,
}

/// A consent to revoke.
#[derive(Debug, Args)]
pub(crate) struct Revoke {
    /// The person, by name.
    name: String,
    /// Purposes that the person no longer agrees to, separated by commas [default: everything].
    #[arg(
        long = "for",
        value_enum,
        value_delimiter = ',',
        value_name = "PURPOSE"
    )]
    purposes: Vec<Purpose>,
    /// How the person said so. The note is stored only if no consent was recorded before.
    #[arg(long, value_name = "TEXT", default_value = "")]
    note: String,
    #[command(flatten)]
    server: Server,
}

impl Grant {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        if let Some(end) = &self.until {
            ensure!(
                end.seconds as f64 > now(),
                "--until {end} is in the past: name a later date"
            );
        }
        let client = self.server.connect().await?;
        let subject = client.find_subject(&self.name).await?;
        let evidence = self.evidence.as_deref().map(file).transpose()?;
        let new = NewConsent {
            evidence,
            purposes: self.purposes.into_iter().map(Into::into).collect(),
            given_by: self.by,
            note: self.note,
            expire_time: self.until,
        };
        let consent = client.grant_consent(&subject.name, new).await?;
        output::put("consent", output::message(&consent));
        say!("{}: {}", others(&subject.display_name), line(&consent));
        Ok(())
    }
}

/// Name and content of a file.
fn file(path: &Path) -> anyhow::Result<(String, Vec<u8>)> {
    let bytes = std::fs::metadata(path)
        .with_context(|| format!("reading {}", path.display()))?
        .len();
    ensure!(
        (1..=EVIDENCE_BYTES as u64).contains(&bytes),
        "{}: {bytes} bytes; the file that proves a consent has 1 to {EVIDENCE_BYTES}",
        path.display()
    );
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let content = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
    Ok((name.into_owned(), content))
}

impl Revoke {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let subject = client.find_subject(&self.name).await?;
        let purposes: Vec<ConsentPurpose> = self.purposes.into_iter().map(Into::into).collect();
        let jobs = client
            .revoke_consent(&subject.name, &purposes, &self.note)
            .await?;
        let what = match purposes.is_empty() {
            true => "everything".to_owned(),
            false => purposes
                .iter()
                .map(|it| word(*it))
                .collect::<Vec<_>>()
                .join(", "),
        };
        output::put("jobs", serde_json::json!(jobs));
        say!(
            "{} no longer agrees to {what}; {} ended",
            others(&subject.display_name),
            count(jobs.len(), "job")
        );
        Ok(())
    }
}

/// A record in a line: `train, render until 2028-01-01T00:00:00Z, given by …: note`.
pub(super) fn line(consent: &Consent) -> String {
    let item = |it: &yoto_proto::v1::ConsentItem| {
        let word = word(it.purpose());
        match it.state() {
            State::Valid | State::Unspecified => word,
            State::Expired => format!("{word} (run out)"),
            State::Revoked => format!("{word} (revoked)"),
        }
    };
    let items: Vec<String> = consent.items.iter().map(item).collect();
    let mut line = items.join(", ");
    if let Some(end) = &consent.expire_time {
        line.push_str(&format!(" until {end}"));
    }
    if !consent.given_by.is_empty() {
        line.push_str(&format!(", given by {}", others(&consent.given_by)));
    }
    if let Some(evidence) = &consent.evidence {
        line.push_str(&format!(", proved by {}", others(&evidence.file_name)));
    }
    if !consent.note.is_empty() {
        line.push_str(&format!(": {}", others(&consent.note)));
    }
    line
}

/// The purpose as commands spell it.
fn word(purpose: ConsentPurpose) -> String {
    let name = purpose.as_str_name().trim_start_matches("CONSENT_");
    name.to_ascii_lowercase()
}

/// The end of a consent: a time, or the end of a day.
fn until(text: &str) -> Result<Timestamp, String> {
    const DAY: i64 = 86_400;
    let wrong = || "a date such as 2027-12-31, or a time such as 2027-12-31T12:00:00Z".to_owned();
    let mut end: Timestamp = text.parse().map_err(|_| wrong())?;
    if !text.contains(['T', 't', ' ']) {
        end.seconds = end.seconds.checked_add(DAY).ok_or_else(wrong)?;
    }
    Ok(end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_date_counts_to_its_end_and_a_time_to_itself() {
        let said = |text| until(text).map(|it| it.to_string());
        assert_eq!(said("2027-12-31"), Ok("2028-01-01T00:00:00Z".to_owned()));
        let noon = "2027-12-31T12:00:00Z";
        assert_eq!(said(noon), Ok(noon.to_owned()));
        for bad in [
            "",
            "tomorrow",
            "2027",
            "31.12.2027",
            "2027-13-01",
            "2027-02-30",
        ] {
            assert!(until(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_line_says_what_and_until_when() {
        let item = |purpose: ConsentPurpose, state: State| yoto_proto::v1::ConsentItem {
            purpose: purpose.into(),
            state: state.into(),
            revoke_time: None,
        };
        let consent = Consent {
            items: vec![
                item(ConsentPurpose::ConsentTrain, State::Valid),
                item(ConsentPurpose::ConsentRender, State::Revoked),
            ],
            given_by: "her father".into(),
            note: "form 17".into(),
            expire_time: Some(Timestamp::default()),
            ..Consent::default()
        };
        assert_eq!(
            line(&consent),
            "train, render (revoked) until 1970-01-01T00:00:00Z, given by her father: form 17"
        );
    }
}
