//! `yoto share`: links to pages that play a person.

mod create;

use crate::args::Server;
use crate::show::{self, ID, now, span};
use clap::{Args, Subcommand};
use create::Create;
use yoto_client::pick_name;
use yoto_proto::names::Collection;
use yoto_proto::v1::Share;
use yoto_proto::v1::share::State;
use yoto_terminal::output::{self, others};

const AFTER_HELP: &str = "\
Anyone with a link can see the page of one person without a key, until the link is revoked or expires, the person's
consent to sharing ends, or the export or the person is deleted. A page that a browser has already loaded still plays.

Examples:
  yoto share create duo --subject ada --expires 30d
  yoto share list
  yoto share revoke 3f1c0a2b";

const LIST_HELP: &str = "\
Examples:
  yoto share list
  yoto share list --subject ada";

const REVOKE_HELP: &str = "\
Example:
  yoto share revoke 3f1c0a2b";

/// Make, list and revoke links to pages that play a person.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct ShareCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Create(Create),
    List(List),
    Revoke(Revoke),
}

/// Show all links, without their addresses.
#[derive(Debug, Args)]
#[command(after_help = LIST_HELP)]
struct List {
    /// Show only links to pages of this person, by name.
    #[arg(long, value_name = "NAME")]
    subject: Option<String>,
    #[command(flatten)]
    server: Server,
}

/// Revoke a link at once and for ever.
#[derive(Debug, Args)]
#[command(after_help = REVOKE_HELP)]
struct Revoke {
    /// The link, by id.
    share: String,
    #[command(flatten)]
    server: Server,
}

impl ShareCommand {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        match self.action {
            Action::Create(create) => create.run().await,
            Action::List(list) => list.run().await,
            Action::Revoke(revoke) => revoke.run().await,
        }
    }
}

impl List {
    async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let subject = match &self.subject {
            Some(name) => client.find_subject(name).await?.name,
            None => String::new(),
        };
        let shares = client.list_shares(&subject).await?;
        output::put("shares", output::messages(&shares));
        if shares.is_empty() {
            say!("no links");
            return Ok(());
        }
        let people = client.list_subjects().await?;
        let name = |share: &Share| {
            let person = people.iter().find(|it| it.name == share.subject);
            person.map_or_else(|| share.subject.clone(), |it| it.display_name.clone())
        };
        let rows: Vec<Vec<String>> = shares
            .iter()
            .map(|share| row(share, name(share), now()))
            .collect();
        let header = ["ID", "PERSON", "AGE", "STATE", "NOTE"];
        say!("{}", show::table(&header, &rows));
        Ok(())
    }
}

impl Revoke {
    async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let known = client.list_shares("").await?;
        let names = known.iter().map(|share| (share.name.as_str(), ""));
        let index = pick_name(Collection::Shares, &self.share, names)?;
        let revoked = client.revoke_share(&known[index].name).await?;
        output::put("share", output::message(&revoked));
        say!("{} is revoked", revoked.name);
        Ok(())
    }
}

/// A line of the table at `now`, seconds since 1970.
fn row(share: &Share, person: String, now: f64) -> Vec<String> {
    let id = share.name.split('/').next_back().unwrap_or_default();
    let made = share.create_time.as_ref();
    let age = made.map_or_else(|| "-".to_owned(), |at| span(now - at.seconds as f64));
    vec![
        id.chars().take(ID).collect(),
        person,
        age,
        state(share, now),
        others(&share.note).to_string(),
    ]
}

/// What the link is worth at `now`.
fn state(share: &Share, now: f64) -> String {
    match share.state() {
        State::Revoked => "revoked".to_owned(),
        State::Expired => "expired".to_owned(),
        State::WithoutConsent => "without consent".to_owned(),
        State::Unspecified | State::Valid => match &share.expire_time {
            Some(end) => format!("ends in {}", span(end.seconds as f64 - now)),
            None => "valid".to_owned(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_tells_whether_a_link_still_shows_something() {
        let at = |seconds| Some(prost_types::Timestamp { seconds, nanos: 0 });
        let mut share = Share {
            name: "shares/0123456789abcdef".into(),
            note: "for Bob".into(),
            state: State::Valid.into(),
            create_time: at(1000),
            expire_time: at(1000 + 7200),
            ..Share::default()
        };
        let line = |share: &Share| row(share, "ada".to_owned(), 1060.0).join(" · ");
        assert_eq!(line(&share), "01234567 · ada · 1m · ends in 1h · for Bob");
        share.state = State::WithoutConsent.into();
        assert_eq!(state(&share, 1060.0), "without consent");
        share.state = State::Revoked.into();
        assert_eq!(state(&share, 1060.0), "revoked");
    }
}
