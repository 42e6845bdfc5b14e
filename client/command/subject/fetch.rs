//! `yoto subject fetch`: what the service keeps of a capture for people.

use crate::args::Server;
use crate::files::{OutFolder, download_some};
use anyhow::Context;
use clap::Args;
use yoto_proto::keys::{CHECK, THUMBNAIL};
use yoto_proto::v1::{NamedObject, capture};
use yoto_terminal::output;

pub(crate) const HELP: &str = "\
thumbnail.png is the person in the middle frame, check.json the report of `yoto capture check`. Captures that an
earlier version read have neither.

Examples:
  yoto subject fetch ada --out ada
  yoto subject fetch captures/9f31c2aa-0000-4000-8000-000000000000 --out ada";

#[derive(Debug, Args)]
pub(crate) struct Fetch {
    /// The person, by name, for their newest READY capture, or a capture: captures/ID.
    of: String,
    #[command(flatten)]
    folder: OutFolder,
    #[command(flatten)]
    server: Server,
}

impl Fetch {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let capture = match self.of.starts_with("captures/") {
            true => client.get_capture(&self.of).await?,
            false => {
                let subject = client.find_subject(&self.of).await?;
                let mut captures = client.list_captures(&subject.name).await?.into_iter();
                let newest = captures.rfind(|it| it.state() == capture::State::Ready);
                newest.with_context(|| format!("{} has no READY capture", self.of))?
            }
        };
        anyhow::ensure!(
            !capture.thumbnail.is_empty() || !capture.check.is_empty(),
            "{} has no thumbnail and no report: an earlier version read it",
            capture.name
        );
        output::put("capture", output::message(&capture));
        let shown = |object: &NamedObject| [CHECK, THUMBNAIL].contains(&&*object.file);
        let paths = download_some(&client, &capture.name, &self.folder, shown).await?;
        self.folder.show(&paths);
        Ok(())
    }
}
