//! `yoto audit`: who has called what that changes something, read in the service's database on its own host.

mod noted;

use crate::show;
use crate::show::{now, span};
use clap::{Args, Subcommand};
use noted::Noted;
use serde_json::json;
use std::path::PathBuf;
use yoto_server::{AuditEntry, AuditLog, PostgresUrl};
use yoto_terminal::output::{self, others};

const AFTER_HELP: &str = "\
Each call that changes something gets an entry before it begins and one after it has ended. Entries are never
changed: each has a hash of itself and of all entries before it. `yoto serve --audit-days` removes old ones.

Examples:
  yoto audit list --data /srv/yoto
  yoto audit verify --data /srv/yoto";

const LIST_HELP: &str = "\
Example:
  yoto audit list --data /srv/yoto --newest 200 --output json";

const VERIFY_HELP: &str = "\
Prints number and hash of the last entry. Keep them elsewhere: with --noted, they also reveal a log that was
cut off, or rewritten from some entry on.

Examples:
  yoto audit verify --data /srv/yoto
  yoto audit verify --database postgres://yoto@db/yoto --noted 1207:5f2c…";

/// Show and verify the log of calls that have changed something.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct AuditCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    List(List),
    Verify(Verify),
}

/// The service's database.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct AuditLogArgs {
    /// The service's data folder, on its host. The service may be running. Run this as the service's user.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// The service's database in PostgreSQL, postgres://USER@HOST/NAME. The service may be running.
    #[arg(long, value_name = "URL")]
    database: Option<PostgresUrl>,
}

/// Show the newest entries.
#[derive(Debug, Args)]
#[command(after_help = LIST_HELP)]
struct List {
    /// Number of entries.
    #[arg(long, value_name = "N", default_value_t = 50)]
    newest: u32,
    #[command(flatten)]
    place: AuditLogArgs,
}

/// Check that no entry was changed or removed.
#[derive(Debug, Args)]
#[command(after_help = VERIFY_HELP)]
struct Verify {
    /// An entry that this command printed before, as NUMBER:HASH, and that the log must still have.
    #[arg(long, value_name = "ENTRY")]
    noted: Option<Noted>,
    #[command(flatten)]
    place: AuditLogArgs,
}

impl AuditCommand {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        match self.action {
            Action::List(list) => list.run().await,
            Action::Verify(verify) => verify.run().await,
        }
    }
}

impl AuditLogArgs {
    async fn open(&self) -> anyhow::Result<AuditLog> {
        match (&self.data, &self.database) {
            (_, Some(url)) => Ok(AuditLog::in_postgres(url).await?),
            (Some(folder), None) => Ok(AuditLog::in_folder(folder).await?),
            (None, None) => anyhow::bail!("name the service's database with --data or --database"),
        }
    }
}

impl List {
    async fn run(self) -> anyhow::Result<()> {
        let log = self.place.open().await?;
        let entries = log.newest(self.newest).await?;
        log.close().await;
        let all: Vec<_> = entries.iter().map(as_json).collect();
        output::put("entries", json!(all));
        if entries.is_empty() {
            say!("nothing was called that changes something");
            return Ok(());
        }
        let rows: Vec<Vec<String>> = entries.iter().map(|it| row(it, now())).collect();
        let header = ["NUMBER", "AGE", "TENANT", "KEY", "CALL", "NAMES", "OUTCOME"];
        say!("{}", show::table(&header, &rows));
        Ok(())
    }
}

impl Verify {
    async fn run(self) -> anyhow::Result<()> {
        let log = self.place.open().await?;
        let noted = self.noted.map(|it| it.0);
        let verified = log.verify(noted.as_ref()).await;
        log.close().await;
        let head = verified?;
        output::put("number", json!(head.number));
        output::put("hash", json!(head.hash));
        say!("{} entries, none changed or missing", head.number);
        say!("the last one: {}:{}", head.number, head.hash);
        Ok(())
    }
}

fn as_json(entry: &AuditEntry) -> serde_json::Value {
    json!({
        "number": entry.number,
        "time": entry.time,
        "tenant": entry.tenant,
        "key": entry.key,
        "call": entry.call,
        "names": entry.names.split_whitespace().collect::<Vec<_>>(),
        "began": entry.began,
        "outcome": entry.outcome,
        "hash": entry.hash,
    })
}

/// A line of the table at `now`, seconds since 1970.
fn row(entry: &AuditEntry, now: f64) -> Vec<String> {
    let outcome = match entry.began {
        Some(began) => format!("{} (of {began})", entry.outcome),
        None => "begins".to_owned(),
    };
    let or_none = |text: &str| if text.is_empty() { "-" } else { text }.to_owned();
    vec![
        entry.number.to_string(),
        span(now - entry.time),
        others(&entry.tenant).to_string(),
        or_none(&entry.key),
        others(entry.call.trim_start_matches("/yoto.v1.")).to_string(),
        or_none(&others(&entry.names).to_string()),
        others(&outcome).to_string(),
    ]
}
