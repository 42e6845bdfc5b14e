//! `yoto usage`: what tenants use, and what each may use at most.

use super::amount::Bytes;
use crate::args::Server;
use crate::show;
use clap::Args;
use yoto_proto::v1::{StoredBytes, Usage};
use yoto_terminal::output;

const AFTER_HELP: &str = "\
Device hours are the hours that workers spent on jobs in the last 30 days, and pictures were rendered in the same
time, also by jobs that have been deleted since. `8/20` means 8 of at most 20.

Examples:
  yoto usage
  yoto usage --tenant lab
  yoto usage --all";

/// Show what a tenant uses of the service, and its quota.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct ShowUsage {
    /// Tenant to show [default: the caller's tenant].
    #[arg(long, value_name = "TENANT", conflicts_with = "all")]
    tenant: Option<String>,
    /// Show all tenants, as an operator of the service.
    #[arg(long)]
    all: bool,
    #[command(flatten)]
    server: Server,
}

impl ShowUsage {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let usage = match self.all {
            true => client.all_usage().await?,
            false => vec![client.usage(&self.tenant.unwrap_or_default()).await?],
        };
        show(&usage);
        Ok(())
    }
}

/// Writes a table with a line for each tenant.
pub(super) fn show(usage: &[Usage]) {
    output::put("usage", output::messages(usage));
    let rows: Vec<Vec<String>> = usage.iter().map(row).collect();
    let header = [
        "TENANT",
        "PEOPLE",
        "STORED",
        "OPEN JOBS",
        "DEVICE HOURS",
        "PICTURES",
    ];
    say!("{}", show::table(&header, &rows));
    for one in usage {
        if let Some(rate) = one.quota.and_then(|it| it.calls_per_second) {
            say!(
                "{}: at most {rate} calls per second",
                output::others(&one.tenant)
            );
        }
    }
    if let [one] = usage
        && let Some(stored) = &one.stored
    {
        say!("{}", kinds(stored));
    }
}

/// What is stored, by kind.
fn kinds(stored: &StoredBytes) -> String {
    format!(
        "stored: {} of uploads, {} of captures, {} of checkpoints, {} of renders, evaluations and exports",
        Bytes(stored.uploads),
        Bytes(stored.captures),
        Bytes(stored.checkpoints),
        Bytes(stored.results)
    )
}

fn row(usage: &Usage) -> Vec<String> {
    let quota = usage.quota.unwrap_or_default();
    let of = |used: String, most: Option<String>| match most {
        Some(most) => format!("{used}/{most}"),
        None => used,
    };
    let count = |used: u64, most: Option<u64>| of(used.to_string(), most.map(|it| it.to_string()));
    let bytes = |it: u64| Bytes(it).to_string();
    let hours = |seconds: f64| format!("{:.1}", seconds / 3600.0);
    vec![
        output::others(&usage.tenant).to_string(),
        count(usage.people, quota.people),
        of(bytes(usage.bytes), quota.bytes.map(bytes)),
        count(usage.open_jobs, quota.open_jobs),
        of(hours(usage.device_seconds), quota.device_seconds.map(hours)),
        count(usage.pictures, quota.pictures),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::Quota;

    #[test]
    fn a_line_has_what_is_used_and_what_may_be() {
        let usage = Usage {
            tenant: "lab".into(),
            people: 3,
            bytes: 3 << 30,
            open_jobs: 0,
            device_seconds: 5400.0,
            pictures: 24,
            quota: Some(Quota {
                people: Some(20),
                device_seconds: Some(36_000.0),
                ..Quota::default()
            }),
            stored: None,
        };
        assert_eq!(
            row(&usage),
            ["lab", "3/20", "3.0 GiB", "0", "1.5/10.0", "24"]
        );
    }
}
