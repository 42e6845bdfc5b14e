//! `yoto gc`: objects of the service that nothing refers to.

use crate::args::Server;
use crate::show;
use crate::show::span;
use clap::Args;
use indicatif::BinaryBytes;
use yoto_proto::v1::{CollectGarbageResponse, GarbageFolder};
use yoto_terminal::output;

const AFTER_HELP: &str = "\
The service does this every hour by itself. Files of deleted resources stay for a time of grace (a day unless
`yoto serve --grace-hours` says otherwise), and so do files of interrupted uploads, of uploads that were
ingested, and of jobs that ended without committing them.

Examples:
  yoto gc --dry-run
  yoto gc --now";

/// Remove stored files that nothing refers to any more.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Gc {
    /// Remove nothing: show the garbage, and how much of it would be removed.
    #[arg(long)]
    dry_run: bool,
    /// Remove objects of deleted resources at once, without the time of grace.
    #[arg(long)]
    now: bool,
    #[command(flatten)]
    server: Server,
}

impl Gc {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let garbage = client.collect_garbage(self.dry_run, self.now).await?;
        output::put("garbage", output::message(&garbage));
        if garbage.count > 0 {
            let header = ["KEY", "FILES", "SIZE", "OF", "FOUND", ""];
            let row = |it: &GarbageFolder| row(it, garbage.grace_seconds, self.dry_run);
            let rows: Vec<Vec<String>> = garbage.folders.iter().map(row).collect();
            say!("{}\n", show::table(&header, &rows));
        }
        say!("{}", summary(&garbage, self.dry_run));
        Ok(())
    }
}

fn row(it: &GarbageFolder, grace: f64, dry_run: bool) -> Vec<String> {
    let of = match it.deleted {
        true => "deleted",
        false => "nothing",
    };
    let what = match (it.due, dry_run) {
        (true, false) => "removed".to_owned(),
        (true, true) => "would be removed".to_owned(),
        (false, _) => format!("stays {}", span(grace - it.age_seconds)),
    };
    vec![
        it.key.clone(),
        it.files.to_string(),
        BinaryBytes(it.bytes).to_string(),
        of.to_owned(),
        format!("{} ago", span(it.age_seconds)),
        what,
    ]
}

/// `3 folders of 12.00 MiB, 2.00 MiB of them removed`.
fn summary(garbage: &CollectGarbageResponse, dry_run: bool) -> String {
    let count = usize::try_from(garbage.count).unwrap_or(usize::MAX);
    let more = count.saturating_sub(garbage.folders.len());
    let more = match more {
        0 => String::new(),
        more => format!(" ({more} smaller ones are not shown)"),
    };
    if count == 0 {
        return "there is no garbage".to_owned();
    }
    format!(
        "{} of {}{more}, {} of it {}",
        yoto_terminal::progress::count(count, "folder"),
        BinaryBytes(garbage.bytes),
        BinaryBytes(garbage.due_bytes),
        if dry_run { "due" } else { "removed" }
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stays_and_what_goes_is_told() {
        let folder = |due| GarbageFolder {
            key: "renders/a/1".into(),
            files: 2,
            bytes: 2048,
            deleted: true,
            age_seconds: 3600.0,
            due,
        };
        let stays = row(&folder(false), 86_400.0, true);
        assert_eq!(stays[2..], ["2.00 KiB", "deleted", "1h ago", "stays 23h"]);
        let goes = |dry_run| row(&folder(true), 86_400.0, dry_run)[5].clone();
        assert_eq!([goes(true), goes(false)], ["would be removed", "removed"]);
        let garbage = CollectGarbageResponse {
            folders: vec![folder(true)],
            count: 2,
            bytes: 3072,
            due_bytes: 2048,
            grace_seconds: 86_400.0,
        };
        let expected =
            "2 folders of 3.00 KiB (1 smaller ones are not shown), 2.00 KiB of it removed";
        assert_eq!(summary(&garbage, false), expected);
        let nothing = summary(&CollectGarbageResponse::default(), false);
        assert_eq!(nothing, "there is no garbage");
    }
}
