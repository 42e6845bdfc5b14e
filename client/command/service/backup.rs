//! `yoto backup` and `yoto restore`: a whole service at one point.

use super::erased;
use super::state::StateArgs;
use anyhow::{Context, ensure};
use clap::Args;
use indicatif::{BinaryBytes, HumanDuration};
use std::path::PathBuf;
use yoto_server::backup::{Copied, Place, Restored, backup, made_at, restore};
use yoto_terminal::output;
use yoto_terminal::progress::count;

const BACKUP_HELP: &str = "\
The service may be running. Rows are copied first, as of one moment, and then the objects. The copy must end within
the time of grace (`yoto serve --grace-hours`), and without a `yoto gc --now` meanwhile. Rows in PostgreSQL need pg_dump.

Examples:
  yoto backup /backup/monday
  yoto backup /backup/monday --data /srv/yoto --database postgres://yoto@db.example/yoto";

const RESTORE_HELP: &str = "\
The data folder must be empty or missing, and so must the tables of a database in PostgreSQL, which needs
pg_restore. A backup of SQLite can be restored into PostgreSQL, without that program. Jobs that ran at the time of the
backup continue from their last checkpoints.

A backup has the people who were erased after it was made. --erased names files that tell who was erased: lists by
`yoto erased`, and reports by `yoto subject erasure --out`. These people are erased again when the service starts.

Examples:
  yoto restore /backup/monday --data /srv/yoto --erased erased.jsonl
  yoto restore /backup/monday --data /srv/yoto --erased-nobody
  yoto restore /backup/monday --data /srv/yoto --database postgres://yoto@db.example/yoto --erased erased.jsonl";

/// Where the service has its state.
#[derive(Debug, Args)]
struct Service {
    #[command(flatten)]
    state: StateArgs,
    /// Copy no objects, for a store that is backed up by itself.
    #[arg(long)]
    rows_only: bool,
}

impl Service {
    fn place(self) -> Place {
        Place {
            data_dir: self.state.data,
            database: self.state.database,
            objects: !self.rows_only,
        }
    }
}

/// Copy a service into a folder.
#[derive(Debug, Args)]
#[command(after_help = BACKUP_HELP)]
pub(crate) struct Backup {
    /// Folder for the backup: an empty one, or one that does not exist yet.
    folder: PathBuf,
    #[command(flatten)]
    service: Service,
}

/// Restore a service from a backup.
#[derive(Debug, Args)]
#[command(after_help = RESTORE_HELP)]
pub(crate) struct Restore {
    /// Folder of the backup.
    folder: PathBuf,
    /// File that tells who was erased since the backup: a list by `yoto erased`, or a report. Can be repeated.
    #[arg(long, value_name = "FILE")]
    erased: Vec<PathBuf>,
    /// Nobody was erased since the backup.
    #[arg(long, conflicts_with = "erased")]
    erased_nobody: bool,
    #[command(flatten)]
    service: Service,
}

impl Backup {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let from = self.service.place();
        let copied = backup(&from, &self.folder).await;
        let copied = copied.context("making a backup")?;
        output::put("files", output::paths(&[&self.folder]));
        say!("{} are in {}", told(&from, copied), self.folder.display());
        Ok(())
    }
}

impl Restore {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let made = made_at(&self.folder).context("restoring a backup")?;
        ensure!(
            self.erased_nobody || !self.erased.is_empty(),
            "the backup was made {} ago: people who were erased since then would come back. Name the files that tell \
             who was erased (--erased FILE; `yoto erased` writes one), or say --erased-nobody",
            HumanDuration(made.elapsed().unwrap_or_default())
        );
        let mut erased = Vec::new();
        for path in &self.erased {
            erased.extend(erased::read(path)?);
        }
        let to = self.service.place();
        let restored = restore(&self.folder, &to, &erased).await;
        let Restored { copied, erased } = restored.context("restoring a backup")?;
        output::put("erased_again", erased);
        if erased > 0 {
            say!("people whom the service will erase again when it starts: {erased}");
        }
        let data = to.data_dir.display().to_string();
        say!(
            "{} are in {data}; start it with `yoto serve`",
            told(&to, copied)
        );
        Ok(())
    }
}

/// `all rows, and 12 objects of 3.00 MiB,`.
fn told(place: &Place, copied: Copied) -> String {
    match place.objects {
        false => "all rows, without objects,".to_owned(),
        true => {
            let objects = usize::try_from(copied.objects).unwrap_or(usize::MAX);
            let bytes = BinaryBytes(copied.bytes);
            format!("all rows, and {} of {bytes},", count(objects, "object"))
        }
    }
}
