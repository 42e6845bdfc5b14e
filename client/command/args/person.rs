//! The person of a command that works on a model of the service, or on the folder of a checkpoint.

use crate::args::Server;
use crate::args::version::Version;
use anyhow::{Context, ensure};
use clap::Args;
#[cfg(feature = "embedded")]
use std::path::Path;
use std::path::PathBuf;

/// Which person of which model.
#[derive(Debug, Args)]
pub(crate) struct PersonArgs {
    /// A model of the service, by name, or the folder of a checkpoint.
    #[arg(value_name = "MODEL|DIR", required_unless_present = "model_dir")]
    model: Option<String>,
    /// The folder as an option.
    #[arg(
        long,
        hide = true,
        conflicts_with_all = ["model", "subject", "checkpoint"],
        value_name = "DIR"
    )]
    model_dir: Option<PathBuf>,
    /// The person, by name, in a model of the service.
    #[arg(long, value_name = "NAME", conflicts_with = "slot")]
    subject: Option<String>,
    /// Identity slot in the folder of a checkpoint [default: 0].
    #[arg(long, value_name = "N")]
    slot: Option<usize>,
    /// Step or alias of the checkpoint, in a model of the service [default: the best one by held-out PSNR].
    #[arg(long, value_name = "STEP|ALIAS")]
    pub checkpoint: Option<Version>,
    #[command(flatten)]
    pub server: Server,
}

/// Where the model of a person comes from.
pub(crate) enum ModelSource<'a> {
    /// The folder of a checkpoint.
    Folder(PathBuf),
    /// A model of the service.
    Service {
        /// Its name.
        model: &'a str,
        /// The person's name.
        subject: &'a str,
    },
}

impl PersonArgs {
    /// Where the model comes from.
    ///
    /// # Errors
    /// Options that do not belong together.
    pub(crate) fn source(&self) -> anyhow::Result<ModelSource<'_>> {
        if let Some(folder) = &self.model_dir {
            return Ok(ModelSource::Folder(folder.clone()));
        }
        // Clap requires one of the two options.
        let model = self.model.as_deref().context("no model is given")?;
        let folder = PathBuf::from(model);
        if folder.is_dir() {
            ensure!(
                self.subject.is_none() && self.checkpoint.is_none(),
                "{model} is a folder: --subject and --checkpoint belong to a model of the service; --slot \
                 chooses the person"
            );
            return Ok(ModelSource::Folder(folder));
        }
        ensure!(
            self.slot.is_none(),
            "--slot belongs to the folder of a checkpoint, which {model} is not: --subject chooses the \
             person of a model of the service"
        );
        let subject = self.subject.as_deref().with_context(|| {
            format!("--subject is needed: the person, by name, as {model} is not a folder")
        })?;
        Ok(ModelSource::Service { model, subject })
    }
}

/// A person of a model whose files are on this disk.
#[cfg(feature = "embedded")]
pub(crate) struct ChosenPerson {
    folder: PathBuf,
    /// Identity slot.
    pub slot: usize,
    /// Name of the person.
    pub name: String,
    /// The model, as the user knows it.
    pub model: String,
}

#[cfg(feature = "embedded")]
impl ChosenPerson {
    /// The folder of the model.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }
}

#[cfg(feature = "embedded")]
impl PersonArgs {
    /// The person in a folder.
    pub(crate) fn in_folder(&self, folder: PathBuf) -> ChosenPerson {
        let slot = self.slot.unwrap_or(0);
        ChosenPerson {
            model: folder.display().to_string(),
            folder,
            slot,
            name: format!("slot {slot}"),
        }
    }
}
