//! `yoto model`: shared networks and the people in them.

#[cfg(feature = "embedded")]
mod erase;
mod keep;
mod person;

use super::titles::Titles;
use super::{Server, table};
use clap::{Args, Subcommand};
use yoto_client::{ClientError, YotoClient};
use yoto_proto::tiers;
use yoto_proto::v1::{Checkpoint, Model, Subject, subject};
use yoto_terminal::output;

/// Variant with one person per model.
const SINGLE: &str = "humannerf";

const CREATE_HELP: &str = "\
Examples:
  yoto model create duo --subjects ada,bob
  yoto model create solo --subjects ada --tier draft --variant humannerf";

const SHOW_HELP: &str = "\
With --output json, every field of the model and of its checkpoints.

Example:
  yoto model show duo";

const LIST_HELP: &str = "\
Example:
  yoto model list";

/// Create, list, show, export and delete models, and add people to them.
#[derive(Debug, Args)]
pub(super) struct ModelCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Create an untrained model with an identity slot for each person.
    #[command(after_help = CREATE_HELP)]
    Create(Create),
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
    /// Write a checkpoint's folder anew without one of its people.
    #[cfg(feature = "embedded")]
    #[command(name = "erase-person", after_help = erase::AFTER_HELP)]
    ErasePerson(erase::Erase),
    /// List the checkpoints of a model, and why each is kept.
    #[command(after_help = keep::CHECKPOINTS_HELP)]
    Checkpoints(keep::Which),
    /// Choose which checkpoints a model keeps.
    #[command(after_help = keep::KEEP_HELP)]
    Keep(keep::Keep),
    /// Delete a checkpoint.
    #[command(name = "delete-checkpoint", after_help = keep::DELETE_CHECKPOINT_HELP)]
    DeleteCheckpoint(keep::DeleteCheckpoint),
    /// Delete a model with its checkpoints, its jobs and their pictures.
    #[command(after_help = keep::DELETE_HELP)]
    Delete(keep::Which),
    /// Write the files of a checkpoint to a folder.
    #[command(after_help = super::model_export::AFTER_HELP)]
    Export(super::model_export::Export),
}

#[derive(Debug, Args)]
struct Create {
    /// Name of the model.
    name: String,
    /// People to add to it, by name, separated by commas.
    #[arg(long, value_delimiter = ',', required = true, value_name = "A,B,…")]
    subjects: Vec<String>,
    #[command(flatten)]
    shape: Shape,
    #[command(flatten)]
    server: Server,
}

/// Configuration of a new model.
#[derive(Debug, Args)]
pub(super) struct Shape {
    /// Quality tier: a trade-off of speed and detail.
    #[arg(long, default_value = tiers::DEFAULT_TIER, value_parser = table::tier, long_help = tier_help())]
    pub tier: String,
    /// Model variant of the paper's ablation.
    #[arg(long, default_value = "yoto", value_parser = table::variant, long_help = variant_help())]
    pub variant: String,
}

pub(super) fn tier_help() -> String {
    format!(
        "Quality tier: a trade-off of speed and detail.{}",
        table::explained(tiers::TIERS)
    )
}

pub(super) fn variant_help() -> String {
    format!(
        "Model variant of the paper's ablation.{}",
        table::explained(tiers::VARIANTS)
    )
}

impl ModelCommand {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        match self.action {
            Action::Create(create) => {
                let client = create.server.connect().await?;
                let model =
                    create_with(&client, &create.name, &create.subjects, &create.shape).await?;
                say!("{}", model.name);
                output::put("model", output::message(&model));
                Ok(())
            }
            Action::List { server } => list(&server.connect().await?).await,
            Action::Show { model, server } => show(&server.connect().await?, &model).await,
            Action::AddPerson(person) => person.run().await,
            Action::RemovePerson(person) => person.run().await,
            #[cfg(feature = "embedded")]
            Action::ErasePerson(erase) => erase.run(),
            Action::Checkpoints(which) => which.checkpoints().await,
            Action::Keep(keep) => keep.run().await,
            Action::DeleteCheckpoint(checkpoint) => checkpoint.run().await,
            Action::Delete(which) => which.delete().await,
            Action::Export(export) => export.run().await,
        }
    }
}

/// Creates a model and gives each of `subjects` a slot. People are looked up first, so that
/// a mistyped name leaves no incomplete model behind.
pub(super) async fn create_with(
    client: &YotoClient,
    name: &str,
    subjects: &[String],
    shape: &Shape,
) -> Result<Model, ClientError> {
    if client
        .list_models()
        .await?
        .iter()
        .any(|model| model.display_name == name)
    {
        return Err(ClientError::Name(format!(
            "there is a model called '{name}' already: `yoto train {name}` continues its training, \
             `yoto model add-person {name} PERSON` adds a person to it"
        )));
    }
    let mut people: Vec<Subject> = Vec::new();
    if shape.variant == SINGLE && subjects.len() > 1 {
        return Err(ClientError::Name(format!(
            "a model of the variant {SINGLE} has one person, not {}",
            subjects.len()
        )));
    }
    for subject in subjects {
        let person = client.find_subject(subject).await?;
        if person.state() != subject::State::Ready {
            return Err(ClientError::Name(format!(
                "{subject} is {}: only a person whose capture is READY can be trained",
                person.state().as_str_name()
            )));
        }
        if people.iter().any(|known| known.name == person.name) {
            return Err(ClientError::Name(format!("{subject} is named twice")));
        }
        people.push(person);
    }
    let model = client
        .create_model(name, &shape.tier, &shape.variant)
        .await?;
    for person in &people {
        client.add_identity(&model.name, &person.name).await?;
    }
    client.get_model(&model.name).await
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
                table::size_of(it.image_size),
                format!("{:.1} MB", it.bytes as f64 / 1e6),
                notes(it),
            ]
        })
        .collect();
    let header = ["STEP", "HELD OUT", "TRAINED AT", "SIZE", ""];
    say!("\n{}", table::table(&header, &rows));
    Ok(())
}

/// What distinguishes a checkpoint: `best, trade-off measured`.
fn notes(checkpoint: &Checkpoint) -> String {
    let all = [
        (checkpoint.best, "best"),
        (checkpoint.tradeoff.is_some(), "trade-off measured"),
    ];
    let all: Vec<&str> = all
        .iter()
        .filter(|(is, _)| *is)
        .map(|(_, it)| *it)
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
        table::table(
            &["NAME", "MODEL", "TIER", "VARIANT", "PEOPLE", "CHECKPOINT"],
            &rows
        )
    );
    Ok(())
}
