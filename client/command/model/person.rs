//! `yoto model add-person` and `remove-person`: who is in a model.

use crate::args;
use crate::args::{QueueArgs, Server};
use crate::model::train;
use anyhow::Context;
use clap::Args;
use std::path::PathBuf;
use yoto_client::{ClientError, YotoClient};
use yoto_proto::v1::{Model, Subject, TrainSpec};
use yoto_terminal::output;

/// Default seconds of training for a person who joins.
const SECONDS: f64 = 60.0;

pub(crate) const ADD_HELP: &str = "\
A person who joins a trained model is trained at once. Only their own parameters change: everybody else
renders bit for bit as before. In an untrained model they are trained together with the others.

Examples:
  yoto model add-person duo cleo
  yoto model add-person duo cleo --seconds 30 --size 256
  yoto model add-person duo cleo --refine 60   then trains everybody for a minute
  yoto model add-person duo cleo --no-train    only gives them a slot";

pub(crate) const REMOVE_HELP: &str = "\
Example:
  yoto model remove-person duo cleo";

#[derive(Debug, Args)]
struct ModelPerson {
    /// The model, by name.
    model: String,
    /// The person, by name.
    subject: String,
    #[command(flatten)]
    server: Server,
}

#[derive(Debug, Args)]
pub(crate) struct Add {
    #[command(flatten)]
    who: ModelPerson,
    /// Seconds of training in a trained model [default: 60].
    #[arg(long, value_parser = args::seconds, conflicts_with = "steps", value_name = "S")]
    seconds: Option<f64>,
    /// Steps of training, in place of seconds.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Longest side of the training images, pixels [default: as in the model's last training].
    #[arg(
        long,
        default_value_t = 0,
        hide_default_value = true,
        value_name = "PX"
    )]
    size: u32,
    /// Write a picture for each checkpoint: a held-out frame of the person beside its render.
    #[arg(long, value_name = "DIR", conflicts_with = "no_wait")]
    preview: Option<PathBuf>,
    /// Then train all people for this many seconds, if the new person needs more than their own
    /// parameters. The others change too; earlier checkpoints still show them as they were.
    #[arg(long, value_parser = args::seconds, value_name = "S")]
    refine: Option<f64>,
    /// Only give the person a slot.
    #[arg(long, conflicts_with_all = ["seconds", "steps", "preview", "no_wait", "refine"])]
    no_train: bool,
    /// Queue the training and return.
    #[arg(long)]
    no_wait: bool,
    #[command(flatten)]
    queue: QueueArgs,
}

#[derive(Debug, Args)]
pub(crate) struct Remove {
    #[command(flatten)]
    who: ModelPerson,
}

impl Add {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let (client, model, subject) = self.who.find().await?;
        let client = self.queue.apply(client);
        let (person, name) = (&subject.display_name, &model.display_name);
        let slot = model.slots.iter().find(|slot| slot.subject == subject.name);
        anyhow::ensure!(
            !slot.is_some_and(|slot| slot.trained),
            "{person} is in {name} already, and trained: `yoto train {name} --only {person}` trains them \
             further, alone"
        );
        let is_trained = model.slots.iter().any(|slot| slot.trained);
        let wants = self.seconds.is_some() || self.steps.is_some() || self.refine.is_some();
        anyhow::ensure!(
            is_trained || !wants,
            "{name} is untrained, so {person} cannot be trained in it alone: train it first, with `yoto train {name}`"
        );
        // A person whose training did not finish has a slot already.
        let joins = is_trained && !self.no_train;
        anyhow::ensure!(slot.is_none() || joins, "{person} is in {name} already");
        let slot = client.add_identity(&model.name, &subject.name).await?;
        output::put("slot", output::message(&slot));
        if !joins {
            say!(
                "{person} has slot {} of {name}, untrained: `yoto train {name}` trains it",
                slot.slot
            );
            return Ok(());
        }
        say!("{person} has slot {} of {name}", slot.slot);
        let all = TrainSpec {
            model: model.name.clone(),
            image_size: self.size,
            ..TrainSpec::default()
        };
        let joining = TrainSpec {
            only: subject.name,
            seconds: match self.steps {
                Some(_) => 0.0,
                None => self.seconds.unwrap_or(SECONDS),
            },
            steps: self.steps.unwrap_or(0),
            ..all.clone()
        };
        let refining = self.refine.map(|seconds| TrainSpec { seconds, ..all });
        // Trainings of one model run in the order in which they are queued.
        for spec in [joining].into_iter().chain(refining) {
            let preview = self.preview.clone();
            train::trained(&client, &model, spec, preview, self.no_wait).await?;
        }
        Ok(())
    }
}

impl Remove {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let (client, model, subject) = self.who.find().await?;
        let (person, name) = (&subject.display_name, &model.display_name);
        let slot = model.slots.iter().find(|slot| slot.subject == subject.name);
        let slot = slot.with_context(|| format!("{person} is not in {name}"))?;
        anyhow::ensure!(
            !slot.trained,
            "{name} was trained with {person}: only a person that it was not trained with can be removed; `yoto model erase-person \
             DIR --slot {}` removes them from an exported checkpoint",
            slot.slot
        );
        let model = client.remove_identity(&model.name, &subject.name).await?;
        let name = &model.display_name;
        output::put("model", output::message(&model));
        say!("{person} is no longer in {name}");
        Ok(())
    }
}

impl ModelPerson {
    async fn find(&self) -> Result<(YotoClient, Model, Subject), ClientError> {
        let client = self.server.connect().await?;
        let model = client.find_model(&self.model).await?;
        let subject = client.find_subject(&self.subject).await?;
        Ok((client, model, subject))
    }
}
