//! `yoto subject`: people and their captures.

mod add;
mod consent;
mod delete;
mod edit;
mod erase;
#[cfg(feature = "embedded")]
mod export;
mod fetch;
mod ingest;
mod poses;

use crate::args::Server;
use crate::show;
use clap::{Args, Subcommand};
use poses::SubjectPoses;
use yoto_proto::pose_track::describe;
use yoto_proto::v1::subject;
use yoto_terminal::output::{self, others};
use yoto_terminal::progress::count;

const SHOW_HELP: &str = "\
Example:
  yoto subject show ada";

const LIST_HELP: &str = "\
Example:
  yoto subject list";

/// Add, list, show and edit people, and fetch their refined poses.
#[derive(Debug, Args)]
pub(crate) struct SubjectCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Add a person: upload a capture folder and wait until it is ready for training.
    #[command(after_help = add::HELP)]
    Add(Box<add::Add>),
    /// List the people of the service.
    #[command(after_help = LIST_HELP)]
    List {
        #[command(flatten)]
        server: Server,
    },
    /// Show a person, their consents and their captures, with the faults of rejected ones.
    #[command(after_help = SHOW_HELP)]
    Show {
        /// The person, by name.
        name: String,
        #[command(flatten)]
        server: Server,
    },
    /// Change the name or the consent note of a person.
    #[command(after_help = edit::HELP)]
    Edit(edit::Edit),
    /// Record what a person agrees to, for how long, and who said so.
    #[command(after_help = consent::GRANT_HELP)]
    Consent(consent::Grant),
    /// Revoke the consent of a person, and end the jobs that needed it.
    #[command(name = "revoke-consent", after_help = consent::REVOKE_HELP)]
    RevokeConsent(consent::Revoke),
    /// Write the thumbnail of a person's newest capture, and the report of its check.
    #[command(after_help = fetch::HELP)]
    Fetch(fetch::Fetch),
    /// Write everything that the service holds about a person.
    #[cfg(feature = "embedded")]
    #[command(after_help = export::HELP)]
    Export(export::Export),
    /// Delete a person and their captures.
    #[command(after_help = delete::SUBJECT_HELP)]
    Delete(delete::DeleteSubject),
    /// Remove a person from everything: models, captures, renders, exports.
    #[command(after_help = erase::ERASE_HELP)]
    Erase(erase::Erase),
    /// Show the report of an erasure.
    #[command(after_help = erase::ERASURE_HELP)]
    Erasure(erase::ShowErasure),
    /// Delete a capture.
    #[command(name = "delete-capture", after_help = delete::CAPTURE_HELP)]
    DeleteCapture(delete::DeleteCapture),
    /// Read an uploaded capture again, after its ingest failed or was cancelled.
    #[command(after_help = ingest::HELP)]
    Ingest(ingest::Ingest),
    /// Write the poses of a person as a training has refined them.
    Poses(Box<SubjectPoses>),
}

impl SubjectCommand {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        match self.action {
            Action::Add(add) => add.run().await,
            Action::List { server } => list(&server).await,
            Action::Show { name, server } => show(&server, &name).await,
            Action::Edit(edit) => edit.run().await,
            Action::Consent(grant) => grant.run().await,
            Action::RevokeConsent(revoke) => revoke.run().await,
            Action::Fetch(fetch) => fetch.run().await,
            #[cfg(feature = "embedded")]
            Action::Export(export) => export.run().await,
            Action::Delete(subject) => subject.run().await,
            Action::DeleteCapture(capture) => capture.run().await,
            Action::Erase(erase) => erase.run().await,
            Action::Erasure(erasure) => erasure.run().await,
            Action::Ingest(capture) => capture.run().await,
            Action::Poses(poses) => poses.run().await,
        }
    }
}

async fn show(server: &Server, name: &str) -> anyhow::Result<()> {
    let client = server.connect().await?;
    let subject = client.find_subject(name).await?;
    say!("person   {} ({})", subject.display_name, subject.name);
    say!("state    {}", subject.state().as_str_name());
    if !subject.consent_note.is_empty() {
        say!("note     {}", others(&subject.consent_note));
    }
    let consents = client.list_consents(&subject.name).await?;
    for consent in &consents {
        say!("consent  {}", consent::line(consent));
    }
    let mut captures = Vec::new();
    for capture in client.list_captures(&subject.name).await? {
        say!(
            "capture  {}, {} of {}x{}: {}",
            capture.state().as_str_name(),
            count(capture.frames as usize, "frame"),
            capture.width,
            capture.height,
            capture.name
        );
        for violation in &capture.violations {
            say!("         {}", describe(violation));
        }
        captures.push(capture);
    }
    output::put("subject", output::message(&subject));
    output::put("consents", output::messages(&consents));
    output::put("captures", output::messages(&captures));
    Ok(())
}

async fn list(server: &Server) -> anyhow::Result<()> {
    let subjects = server.connect().await?.list_subjects().await?;
    output::put("subjects", output::messages(&subjects));
    let row = |subject: &subject::State| subject.as_str_name().to_owned();
    let rows: Vec<Vec<String>> = subjects
        .iter()
        .map(|subject| {
            let captures = subject.captures.len().to_string();
            vec![
                subject.name.clone(),
                subject.display_name.clone(),
                row(&subject.state()),
                captures,
                subject.consent_note.clone(),
            ]
        })
        .collect();
    say!(
        "{}",
        show::table(&["NAME", "PERSON", "STATE", "CAPTURES", "CONSENT"], &rows)
    );
    Ok(())
}
