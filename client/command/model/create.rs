//! `yoto model create`: a new model and the people in it.

use crate::args;
use crate::args::{Server, tier_help, variant_help};
use clap::Args;
use yoto_client::{ClientError, YotoClient};
use yoto_proto::tiers;
use yoto_proto::v1::{Model, Subject, subject};
use yoto_terminal::output;

/// Variant with one person per model.
const SINGLE: &str = "humannerf";

pub(super) const HELP: &str = "\
Examples:
  yoto model create duo --subjects ada,bob
  yoto model create solo --subjects ada --tier draft --variant humannerf";

#[derive(Debug, Args)]
pub(super) struct Create {
    /// Name of the model.
    name: String,
    /// People in the model, by name, separated by commas.
    #[arg(long, value_delimiter = ',', required = true, value_name = "A,B,…")]
    subjects: Vec<String>,
    #[command(flatten)]
    shape: Shape,
    #[command(flatten)]
    server: Server,
}

/// Configuration of a new model.
#[derive(Debug, Args)]
pub(crate) struct Shape {
    /// Quality tier: a trade-off of speed and detail.
    #[arg(long, default_value = tiers::DEFAULT_TIER, value_parser = args::tier, long_help = tier_help())]
    pub tier: String,
    /// Model variant of the paper's ablation.
    #[arg(long, default_value = "yoto", value_parser = args::variant, long_help = variant_help())]
    pub variant: String,
}

impl Create {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let model = create_with(&client, &self.name, &self.subjects, &self.shape).await?;
        say!("{}", model.name);
        output::put("model", output::message(&model));
        Ok(())
    }
}

/// Creates a model and gives each of `subjects` a slot. People are looked up first, so that
/// a mistyped name leaves no incomplete model behind.
pub(crate) async fn create_with(
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
