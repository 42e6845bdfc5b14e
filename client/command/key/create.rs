//! `yoto key create`.

use super::place::KeyStoreArgs;
use super::scope_names;
use crate::args::span::span;
use crate::show::now;
use clap::{Args, ValueEnum};
use prost_types::Timestamp;
use std::time::Duration;
use yoto_proto::v1::{CreateKeyRequest, Scope};
use yoto_terminal::output::{self, others};

const AFTER_HELP: &str = "\
The key is the only line on stdout, and is shown once: the service keeps its SHA-256.

Scopes: read looks at everything and downloads; write creates, changes and deletes; operate manages keys,
pauses and cordons, and with a key of the tenant default drains the service, collects its garbage and
reads its figures; work is for workers, and stands alone.

Examples:
  yoto key create admin --scopes read,write,operate --data /srv/yoto
  yoto key create ada --expires 90d
  yoto key create gpu-1 --scopes work > gpu-1.key
  yoto key create lab-1 --tenant lab --scopes read,write,operate";

/// Create a key, and print it once.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct Create {
    /// Name of the key, such as the name of its holder.
    name: String,
    /// Scopes: what the key allows, separated by commas.
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        value_name = "SCOPE",
        default_values = ["read", "write"]
    )]
    scopes: Vec<ScopeName>,
    /// Time until the key expires, such as 90d, 12h or 30m [default: never].
    #[arg(long, value_name = "TIME", value_parser = span)]
    expires: Option<Duration>,
    /// Tenant whose calls the key makes [default: the caller's tenant]. Tenants share a service without seeing each
    /// other.
    #[arg(long, value_name = "TENANT")]
    tenant: Option<String>,
    #[command(flatten)]
    place: KeyStoreArgs,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ScopeName {
    Read,
    Write,
    Operate,
    Work,
}

impl From<ScopeName> for Scope {
    fn from(name: ScopeName) -> Self {
        match name {
            ScopeName::Read => Self::Read,
            ScopeName::Write => Self::Write,
            ScopeName::Operate => Self::Operate,
            ScopeName::Work => Self::Work,
        }
    }
}

impl Create {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        let ends = self.expires.map(|it| now() + it.as_secs_f64());
        let scopes = self.scopes.into_iter().map(Scope::from);
        let new = CreateKeyRequest {
            display_name: self.name,
            scopes: scopes.map(i32::from).collect(),
            expire_time: ends.map(|at| Timestamp {
                seconds: at as i64,
                nanos: 0,
            }),
            tenant: self.tenant.unwrap_or_default(),
        };
        let keys = self.place.open().await?;
        let created = keys.create(new).await?;
        let key = created.key.unwrap_or_default();
        output::put("key", output::message(&key));
        output::put("secret", created.secret.clone());
        say!("{}", created.secret);
        tell!(
            "the key {} of the tenant {} allows {}; it is not shown again",
            others(&key.display_name),
            key.tenant,
            scope_names(key.scopes())
        );
        tell!("the service asks every caller for a key: in YOTO_KEY, or in the file of --key-file");
        Ok(())
    }
}
