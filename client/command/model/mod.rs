//! `yoto model`: shared networks and the people in them.

mod create;
#[cfg(feature = "embedded")]
mod erase;
pub(crate) mod evaluate;
mod export;
mod keep;
mod person;
pub(crate) mod preview;
pub(crate) mod report;
#[cfg(feature = "embedded")]
pub(crate) mod tradeoff;
pub(crate) mod train;

use crate::args::Server;
use crate::show;
use crate::show::Titles;
use clap::{Args, Subcommand};
use yoto_client::YotoClient;
use yoto_proto::v1::Checkpoint;
use yoto_terminal::output;

const SHOW_HELP: &str = "\
--output json prints every field of the model and of its checkpoints.

Example:
  yoto model show duo";

const LIST_HELP: &str = "\
Example:
  yoto model list";

/// Create, list, show, export and delete models, and add people to them.
#[derive(Debug, Args)]
pub(crate) struct ModelCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Create an untrained model with an identity slot for each person.
    #[command(after_help = create::HELP)]
    Create(create::Create),
    /// List models, the people in them, and their newest checkpoint.
    #[command(after_help = LIST_HELP)]
    List {
        #[command(flatten)]
        server: Server,
    },
    /// Show a model with its people and checkpoints.
    #[command(after_help = SHOW_HELP)]
    Show {
        /// The model, by name.
        model: String,
        #[command(flatten)]
        server: Server,
    },
    /// Add a person to a model, and train them in it if it is trained.
    #[command(name = "add-person", after_help = person::ADD_HELP)]
    AddPerson(person::Add),
    /// Remove a person with whom a model was not trained yet.
    #[command(name = "remove-person", after_help = person::REMOVE_HELP)]
    RemovePerson(person::Remove),
    /// Copy the folder of a checkpoint without one of its people.
    #[cfg(feature = "embedded")]
    #[command(name = "erase-person", after_help = erase::AFTER_HELP)]
    ErasePerson(erase::Erase),
    /// List the checkpoints of a model, and why each is kept.
    #[command(after_help = keep::CHECKPOINTS_HELP)]
    Checkpoints(keep::ModelArgs),
    /// Choose which checkpoints a model keeps.
    #[command(after_help = keep::KEEP_HELP)]
    Keep(keep::Keep),
    /// Give a checkpoint an alias, such as prod, or remove the alias.
    #[command(after_help = keep::ALIAS_HELP)]
    Alias(keep::Alias),
    /// Delete a checkpoint.
    #[command(name = "delete-checkpoint", after_help = keep::DELETE_CHECKPOINT_HELP)]
    DeleteCheckpoint(keep::DeleteCheckpoint),
    /// Delete a model with its checkpoints, its jobs and their pictures.
    #[command(after_help = keep::DELETE_HELP)]
    Delete(keep::ModelArgs),
    /// Write the files of a checkpoint to a folder.
    #[command(after_help = export::AFTER_HELP)]
    Export(export::Export),
}

impl ModelCommand {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        match self.action {
            Action::Create(create) => create.run().await,
            Action::List { server } => list(&server.connect().await?).await,
            Action::Show { model, server } => show(&server.connect().await?, &model).await,
            Action::AddPerson(person) => person.run().await,
            Action::RemovePerson(person) => person.run().await,
            #[cfg(feature = "embedded")]
            Action::ErasePerson(erase) => erase.run(),
            Action::Checkpoints(which) => which.checkpoints().await,
            Action::Keep(keep) => keep.run().await,
            Action::Alias(alias) => alias.run().await,
            Action::DeleteCheckpoint(checkpoint) => checkpoint.run().await,
            Action::Delete(which) => which.delete().await,
            Action::Export(export) => export.run().await,
        }
    }
}

async fn show(client: &YotoClient, name: &str) -> anyhow::Result<()> {
    let model = client.find_model(name).await?;
    let checkpoints = client.list_checkpoints(&model.name).await?;
    output::put("model", output::message(&model));
    output::put("checkpoints", output::messages(&checkpoints));
    let titles = Titles::load(client).await?;
    say!("model    {} ({})", model.display_name, model.name);
    say!("tier     {}, variant {}", model.tier, model.variant);
    for slot in &model.slots {
        let state = if slot.trained { "trained" } else { "untrained" };
        say!(
            "person   {}, {state}, slot {}",
            titles.name(&slot.subject),
            slot.slot
        );
    }
    let rows: Vec<Vec<String>> = checkpoints
        .iter()
        .map(|it| {
            let psnr = it
                .psnr
                .map_or_else(|| "-".to_owned(), |psnr| format!("{psnr:.2} dB"));
            vec![
                it.step.to_string(),
                psnr,
                show::size_of(it.image_size),
                format!("{:.1} MB", it.bytes as f64 / 1e6),
                notes(it),
            ]
        })
        .collect();
    let header = ["STEP", "HELD OUT", "TRAINED AT", "SIZE", ""];
    say!("\n{}", show::table(&header, &rows));
    Ok(())
}

/// What distinguishes a checkpoint: `best, trade-off measured`.
fn notes(checkpoint: &Checkpoint) -> String {
    let all = [
        (checkpoint.best, "best"),
        (checkpoint.tradeoff.is_some(), "trade-off measured"),
    ];
    let all = all.iter().filter(|(is, _)| *is).map(|(_, it)| *it);
    let all: Vec<&str> = checkpoint
        .aliases
        .iter()
        .map(String::as_str)
        .chain(all)
        .collect();
    all.join(", ")
}

async fn list(client: &YotoClient) -> anyhow::Result<()> {
    let titles = Titles::load(client).await?;
    let person = |name: &str| titles.name(name).to_owned();
    let mut rows = Vec::new();
    let models = client.list_models().await?;
    output::put("models", output::messages(&models));
    for model in models {
        let checkpoints = client.list_checkpoints(&model.name).await?;
        let newest = checkpoints.first();
        let people: Vec<String> = model
            .slots
            .iter()
            .map(|slot| match (slot.trained, newest) {
                (false, Some(_)) => format!("{} (untrained)", person(&slot.subject)),
                _ => person(&slot.subject),
            })
            .collect();
        let checkpoint = newest.map_or_else(
            || "-".to_owned(),
            |newest| match checkpoints.iter().find(|it| it.best) {
                Some(best) if best.step != newest.step => {
                    format!("step {}, step {} is better", newest.step, best.step)
                }
                _ => format!("step {}", newest.step),
            },
        );
        rows.push(vec![
            model.name,
            model.display_name,
            model.tier,
            model.variant,
            people.join(","),
            checkpoint,
        ]);
    }
    say!(
        "{}",
        show::table(
            &["NAME", "MODEL", "TIER", "VARIANT", "PEOPLE", "CHECKPOINT"],
            &rows
        )
    );
    Ok(())
}
