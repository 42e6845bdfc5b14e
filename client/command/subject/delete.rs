//! `yoto subject delete` and `delete-capture`.

use crate::args::Server;
use crate::show;
use clap::Args;

pub(crate) const SUBJECT_HELP: &str = "\
A person in a model is not deleted: the model's checkpoints would still hold what it has learned from
them. `yoto model delete` deletes the model.

Example:
  yoto subject delete ada";
pub(crate) const CAPTURE_HELP: &str = "\
`yoto subject show` lists the captures of a person; trainings and renders use the newest.

Example:
  yoto subject delete-capture captures/0b55bd0e-0b5c-4c7e-9b0c-0d6d3c0e7d7a";

/// A person to delete.
#[derive(Debug, Args)]
pub(crate) struct DeleteSubject {
    /// The person, by name.
    name: String,
    #[command(flatten)]
    server: Server,
}

/// A capture to delete.
#[derive(Debug, Args)]
pub(crate) struct DeleteCapture {
    /// The capture, captures/ID.
    capture: String,
    #[command(flatten)]
    server: Server,
}

impl DeleteSubject {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let subject = client.find_subject(&self.name).await?;
        let deleted = client.delete_subject(&subject.name, &subject.etag).await?;
        show::say_deleted(&subject.display_name, &deleted);
        Ok(())
    }
}

impl DeleteCapture {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let deleted = client.delete_capture(&self.capture, "").await?;
        show::say_deleted(&self.capture, &deleted);
        Ok(())
    }
}
