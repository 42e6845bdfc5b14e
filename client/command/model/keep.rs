//! `yoto model checkpoints`, `keep`, `delete-checkpoint` and `delete`: what of a model is stored.

use crate::args::Server;
use crate::args::version::Version;
use crate::show;
use crate::show::{now, span};
use clap::Args;
use yoto_client::YotoClient;
use yoto_proto::names;
use yoto_proto::v1::{Checkpoint, Retention};
use yoto_terminal::output;

pub(crate) const CHECKPOINTS_HELP: &str = "\
Example:
  yoto model checkpoints duo";
pub(crate) const KEEP_HELP: &str = "\
The best checkpoints by held-out PSNR are also kept, and those that a job uses. Checkpoints that are no longer
kept are removed at once.

Example:
  yoto model keep duo --newest 5 --every 20";
pub(crate) const ALIAS_HELP: &str = "\
An alias stands for the checkpoint in --checkpoint, and in requests over gRPC and HTTP. A checkpoint is kept as long as
it has one. A job uses the checkpoint that had the alias when the job was queued.

Examples:
  yoto model alias duo prod                     the best checkpoint becomes prod
  yoto model alias duo prod --checkpoint 2000
  yoto render duo --subject ada --checkpoint prod --orbit 0 --out out/ada
  yoto model alias duo prod --remove";
pub(crate) const DELETE_CHECKPOINT_HELP: &str = "\
Example:
  yoto model delete-checkpoint duo 4000";
pub(crate) const DELETE_HELP: &str = "\
Its checkpoints and jobs, and the pictures that were rendered with it, are deleted with it. The people stay.

Example:
  yoto model delete duo";

/// A model of a service.
#[derive(Debug, Args)]
pub(crate) struct ModelArgs {
    /// The model, by name.
    model: String,
    #[command(flatten)]
    server: Server,
}

/// Which checkpoints a model keeps.
#[derive(Debug, Args)]
pub(crate) struct Keep {
    #[command(flatten)]
    which: ModelArgs,
    /// Number of newest checkpoints to keep [default: the service's].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..),
          required_unless_present = "every")]
    newest: Option<u32>,
    /// Also keep every N-th checkpoint; 0 keeps none for this reason [default: the service's].
    #[arg(long, value_name = "N")]
    every: Option<u32>,
}

/// A checkpoint to delete.
#[derive(Debug, Args)]
pub(crate) struct DeleteCheckpoint {
    #[command(flatten)]
    which: ModelArgs,
    /// Step of the checkpoint.
    step: u64,
}

/// A checkpoint to name.
#[derive(Debug, Args)]
pub(crate) struct Alias {
    /// The model, by name.
    model: String,
    /// The alias.
    alias: String,
    /// Step, or another alias, of the checkpoint [default: the best one by held-out PSNR].
    #[arg(long, value_name = "STEP|ALIAS", conflicts_with = "remove")]
    checkpoint: Option<Version>,
    /// Remove the alias.
    #[arg(long)]
    remove: bool,
    #[command(flatten)]
    server: Server,
}

impl Alias {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let model = client.find_model(&self.model).await?;
        if self.remove {
            client.remove_alias(&model.name, &self.alias).await?;
        } else {
            let checkpoint = match &self.checkpoint {
                Some(version) => version.of(&model.name),
                None => client.checkpoint_name(&model).await?,
            };
            client.set_alias(&checkpoint, &self.alias).await?;
        }
        list(&client, &model.name).await
    }
}

impl ModelArgs {
    /// Lists the checkpoints, with the reasons for which they are kept.
    pub(crate) async fn checkpoints(&self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let model = client.find_model(&self.model).await?;
        list(&client, &model.name).await
    }

    pub(crate) async fn delete(&self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let model = client.find_model(&self.model).await?;
        let deleted = client.delete_model(&model.name, &model.etag).await?;
        show::say_deleted(&model.display_name, &deleted);
        Ok(())
    }
}

impl Keep {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.which.server.connect().await?;
        let model = client.find_model(&self.which.model).await?;
        let retention = Retention {
            newest: self.newest,
            every: self.every,
        };
        let model = client.set_retention(&model.name, retention).await?;
        output::put("model", output::message(&model));
        list(&client, &model.name).await
    }
}

impl DeleteCheckpoint {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.which.server.connect().await?;
        let model = client.find_model(&self.which.model).await?;
        let name = names::checkpoint(&model.name, self.step);
        let deleted = client.delete_checkpoint(&name, "").await?;
        let what = format!("step {} of {}", self.step, model.display_name);
        show::say_deleted(&what, &deleted);
        Ok(())
    }
}

async fn list(client: &YotoClient, model: &str) -> anyhow::Result<()> {
    let checkpoints = client.list_checkpoints(model).await?;
    output::put("checkpoints", output::messages(&checkpoints));
    let now = now();
    let rows: Vec<Vec<String>> = checkpoints.iter().map(|it| row(it, now)).collect();
    let header = ["STEP", "AGE", "HELD OUT", "SIZE", "KEPT AS"];
    say!("{}", show::table(&header, &rows));
    Ok(())
}

/// A checkpoint at `now`, seconds since 1970.
fn row(it: &Checkpoint, now: f64) -> Vec<String> {
    let age = it.create_time.as_ref().map(|at| now - at.seconds as f64);
    let kept = match it.kept_for.as_slice() {
        [] => "nothing: the next one replaces it".to_owned(),
        reasons => reasons.join(", "),
    };
    vec![
        it.step.to_string(),
        age.map_or_else(|| "-".to_owned(), span),
        it.psnr
            .map_or_else(|| "-".to_owned(), |psnr| format!("{psnr:.2} dB")),
        format!("{:.1} MB", it.bytes as f64 / 1e6),
        kept,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checkpoint_says_why_it_is_kept() {
        let mut it = Checkpoint {
            step: 40,
            bytes: 2_000_000,
            psnr: Some(30.126),
            create_time: Some(prost_types::Timestamp {
                seconds: 100,
                nanos: 0,
            }),
            kept_for: vec!["newest 3".into(), "best".into()],
            ..Checkpoint::default()
        };
        let found = row(&it, 160.0);
        assert_eq!(found, ["40", "1m", "30.13 dB", "2.0 MB", "newest 3, best"]);
        it.kept_for.clear();
        assert!(row(&it, 160.0)[4].starts_with("nothing"));
    }
}
