//! `yoto adopt`: binds a store of objects to a database.

use super::state::{ObjectsArgs, StateArgs};
use anyhow::Context;
use clap::Args;
use yoto_server::{ServerConfig, adopt, shown};

const AFTER_HELP: &str = "\
A store of objects belongs to one database, and `yoto serve` refuses both if they don't belong together. Run this after
you have moved the objects without `yoto-store`, have lost all of them, or have replaced the database. Stop the service first.
The database to which the store belonged before is refused from then on: objects that this database does not name are
garbage to it, and are removed after the time of grace.

Examples:
  yoto adopt --data /srv/yoto
  yoto adopt --database postgres://yoto@db.example/yoto --objects s3://bucket/prefix";

/// Bind a store of objects to a service's database, whatever it was bound to before.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Adopt {
    #[command(flatten)]
    state: StateArgs,
    #[command(flatten)]
    objects: ObjectsArgs,
}

impl Adopt {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let config = ServerConfig {
            database: self.state.database,
            objects: self.objects.objects,
            ..ServerConfig::new(self.state.data)
        };
        let url = adopt(&config).await;
        let url = url.context("binding the objects to the database")?;
        say!(
            "the objects at {} belong to this database now; start it with `yoto serve`",
            shown(&url)
        );
        Ok(())
    }
}
