//! `yoto key`: keys of the people, programs and workers that call a service.

mod create;
mod place;

use crate::show;
use crate::show::{ID, now, span};
use clap::{Args, Subcommand};
use create::Create;
use place::KeyStoreArgs;
use yoto_client::pick_name;
use yoto_proto::names::Collection;
use yoto_proto::v1::{Key, Scope};
use yoto_terminal::output::{self, others};

const AFTER_HELP: &str = "\
From the first key on, the service asks every caller for one. Callers put their key into YOTO_KEY or into
the file of --key-file. --data or --database opens the service's database on its own host, without a key:
to make the first key, or to replace a lost one.

Examples:
  yoto key create admin --scopes read,write,operate --data /srv/yoto
  yoto key create gpu-1 --scopes work
  yoto key list
  yoto key revoke gpu-1";

const LIST_HELP: &str = "\
Example:
  yoto key list --tenant lab";

const REVOKE_HELP: &str = "\
Calls with the key are refused, and its streams end: at once at the coordinator that revokes it, and within a
second at others.

Example:
  yoto key revoke gpu-1";

/// Create, list and revoke the keys with which people, programs and workers call a service.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct KeyCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Create(Create),
    List(List),
    Revoke(Revoke),
}

/// Show the keys of a tenant, without the keys themselves.
#[derive(Debug, Args)]
#[command(after_help = LIST_HELP)]
struct List {
    /// Tenant whose keys are shown [default: the caller's tenant].
    #[arg(long, value_name = "TENANT")]
    tenant: Option<String>,
    #[command(flatten)]
    place: KeyStoreArgs,
}

/// Revoke a key at once and for ever.
#[derive(Debug, Args)]
#[command(after_help = REVOKE_HELP)]
struct Revoke {
    /// The key, by name or id.
    key: String,
    /// Tenant that has the key [default: the caller's tenant].
    #[arg(long, value_name = "TENANT")]
    tenant: Option<String>,
    #[command(flatten)]
    place: KeyStoreArgs,
}

impl KeyCommand {
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
        let keys = self.place.open().await?;
        let keys = keys.list(&self.tenant.unwrap_or_default()).await?;
        output::put("keys", output::messages(&keys));
        if keys.is_empty() {
            say!("no keys");
            return Ok(());
        }
        let rows: Vec<Vec<String>> = keys.iter().map(|key| row(key, now())).collect();
        let header = ["ID", "NAME", "SCOPES", "AGE", "USED", "STATE"];
        say!("{}", show::table(&header, &rows));
        Ok(())
    }
}

impl Revoke {
    async fn run(self) -> anyhow::Result<()> {
        let keys = self.place.open().await?;
        let mut known = keys.list(&self.tenant.unwrap_or_default()).await?;
        // A name may be given again once its key has ended.
        let time = now();
        let ended = |key: &Key| {
            let end = key.expire_time.as_ref();
            key.revoke_time.is_some() || end.is_some_and(|it| it.seconds as f64 <= time)
        };
        let lives = |key: &Key| !ended(key);
        if known
            .iter()
            .any(|key| lives(key) && key.display_name == self.key)
        {
            known.retain(lives);
        }
        let names = known
            .iter()
            .map(|key| (key.name.as_str(), key.display_name.as_str()));
        let index = pick_name(Collection::Keys, &self.key, names)?;
        let revoked = keys.revoke(&known[index].name).await?;
        output::put("key", output::message(&revoked));
        say!("{} is revoked", others(&revoked.display_name));
        Ok(())
    }
}

/// A line of the table at `now`, seconds since 1970.
fn row(key: &Key, now: f64) -> Vec<String> {
    let id = key.name.split('/').next_back().unwrap_or_default();
    let since = |at: &Option<prost_types::Timestamp>| {
        at.as_ref()
            .map_or_else(|| "-".to_owned(), |at| span(now - at.seconds as f64))
    };
    let end = key.expire_time.as_ref().map(|it| it.seconds as f64);
    let state = match (&key.revoke_time, end) {
        (Some(_), _) => "revoked".to_owned(),
        (None, Some(end)) if end <= now => "expired".to_owned(),
        (None, Some(end)) => format!("ends in {}", span(end - now)),
        (None, None) => "good".to_owned(),
    };
    vec![
        id.chars().take(ID).collect(),
        key.display_name.clone(),
        scope_names(key.scopes()),
        since(&key.create_time),
        since(&key.last_use_time),
        state,
    ]
}

/// `read, write`.
fn scope_names(scopes: impl Iterator<Item = Scope>) -> String {
    let short = |scope: Scope| {
        let name = scope.as_str_name().trim_start_matches("SCOPE_");
        name.to_ascii_lowercase()
    };
    scopes.map(short).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_tells_what_a_key_allows_and_whether_it_lives() {
        let at = |seconds| Some(prost_types::Timestamp { seconds, nanos: 0 });
        let key = Key {
            name: "keys/0123456789abcdef".into(),
            display_name: "gpu-1".into(),
            scopes: vec![Scope::Work.into()],
            create_time: at(1000),
            ..Key::default()
        };
        let line = |key: &Key| row(key, 1090.0)[1..].join("|");
        assert_eq!(line(&key), "gpu-1|work|1m|-|good");
        let ending = Key {
            expire_time: at(1000 + 86_400),
            last_use_time: at(1085),
            ..key.clone()
        };
        assert_eq!(line(&ending), "gpu-1|work|1m|5s|ends in 23h");
        let ended = Key {
            expire_time: at(1090),
            ..key.clone()
        };
        assert!(line(&ended).ends_with("expired"));
        let revoked = Key {
            revoke_time: at(1001),
            ..ended
        };
        assert!(line(&revoked).ends_with("revoked"));
    }
}
