//! `yoto subject edit`: another name or consent note of a person.

use crate::args::Server;
use anyhow::ensure;
use clap::Args;
use yoto_terminal::output::{self, others};

pub(crate) const HELP: &str = "\
Captures, models and jobs of the person stay as they are.

Examples:
  yoto subject edit ada --rename \"Ada L.\"
  yoto subject edit ada --consent \"signed on 3 May\"";

#[derive(Debug, Args)]
pub(crate) struct Edit {
    /// The person, by name.
    name: String,
    /// The new name.
    #[arg(long, value_name = "NAME")]
    rename: Option<String>,
    /// The consent under which the recordings are used.
    #[arg(long, value_name = "NOTE")]
    consent: Option<String>,
    #[command(flatten)]
    server: Server,
}

impl Edit {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        let (name, note) = (self.rename.as_deref(), self.consent.as_deref());
        ensure!(
            name.or(note).is_some(),
            "nothing to change: add --rename or --consent"
        );
        let client = self.server.connect().await?;
        let subject = client.find_subject(&self.name).await?;
        if let Some(name) = name {
            // Commands find people by their names.
            let known = client.list_subjects().await?;
            let taken = known
                .iter()
                .find(|it| it.display_name == name && it.name != subject.name);
            ensure!(taken.is_none(), "another person is already called '{name}'");
        }
        let subject = client.update_subject(&subject, name, note).await?;
        say!(
            "{} is called {}",
            subject.name,
            others(&subject.display_name)
        );
        output::put("subject", output::message(&subject));
        Ok(())
    }
}
