//! `yoto quota`: what a tenant may use at most.

use super::amount::{Limit, bytes, calls, count, hours};
use super::usage::show;
use crate::args::Server;
use clap::Args;
use yoto_proto::v1::Quota;

const AFTER_HELP: &str = "\
Limits without an option stay as they are; `none` removes a limit. A quota deletes nothing: a tenant above its
quota gets no more. Device hours and pictures count the last 30 days; once they are used up, new jobs are
refused, except ingest jobs, and queued jobs still run.

Examples:
  yoto quota lab --people 50 --bytes 500G
  yoto quota lab --open-jobs 20 --device-hours 100 --pictures none";

/// Set the quota of a tenant, as an operator of the service.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct SetQuota {
    /// The tenant.
    tenant: String,
    /// Number of people.
    #[arg(long, value_name = "N", value_parser = count)]
    people: Option<Limit<u64>>,
    /// Bytes of uploads, captures, checkpoints, renders and exports, such as 500G.
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    bytes: Option<Limit<u64>>,
    /// Number of jobs that wait or run at the same time.
    #[arg(long, value_name = "N", value_parser = count)]
    open_jobs: Option<Limit<u64>>,
    /// Hours that workers spend on jobs, in 30 days.
    #[arg(long, value_name = "HOURS", value_parser = hours)]
    device_hours: Option<Limit<f64>>,
    /// Number of rendered pictures, in 30 days.
    #[arg(long, value_name = "N", value_parser = count)]
    pictures: Option<Limit<u64>>,
    /// Calls per second, at each coordinator. Calls of workers do not count.
    #[arg(long, value_name = "N", value_parser = calls)]
    calls_per_second: Option<Limit<f64>>,
    #[command(flatten)]
    server: Server,
}

impl SetQuota {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let now = client.usage(&self.tenant).await?.quota.unwrap_or_default();
        let quota = self.changed(now);
        let usage = match quota == now {
            true => client.usage(&self.tenant).await?,
            false => client.set_quota(&self.tenant, quota).await?,
        };
        show(&[usage]);
        Ok(())
    }

    /// The quota with the numbers that are named.
    fn changed(&self, now: Quota) -> Quota {
        let or = |named: Option<Limit<u64>>, now| named.map_or(now, Limit::field);
        let seconds = self.device_hours.map(|it| it.field().map(|it| it * 3600.0));
        Quota {
            people: or(self.people, now.people),
            bytes: or(self.bytes, now.bytes),
            open_jobs: or(self.open_jobs, now.open_jobs),
            device_seconds: seconds.unwrap_or(now.device_seconds),
            pictures: or(self.pictures, now.pictures),
            calls_per_second: (self.calls_per_second).map_or(now.calls_per_second, Limit::field),
        }
    }
}
