//! `yoto worker cordon` and `uncordon`: workers that get no jobs.

use crate::args::{Reason, Server};
use clap::Subcommand;
use yoto_terminal::output::others;

const CORDON_HELP: &str = "\
Its running job continues. The name is the one in `yoto status`. The cordon holds for all workers with this
name, also after a restart.

Example:
  yoto worker cordon gpu-1 --reason \"a fan is broken\"";

const UNCORDON_HELP: &str = "\
Example:
  yoto worker uncordon gpu-1";

#[derive(Debug, Subcommand)]
pub(crate) enum Action {
    /// Give a worker no more jobs.
    #[command(after_help = CORDON_HELP)]
    Cordon {
        /// Display name of the worker.
        name: String,
        #[command(flatten)]
        reason: Reason,
        #[command(flatten)]
        server: Server,
    },
    /// Give a worker jobs again.
    #[command(after_help = UNCORDON_HELP)]
    Uncordon {
        /// Display name of the worker.
        name: String,
        #[command(flatten)]
        server: Server,
    },
}

impl Action {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        match self {
            Self::Cordon {
                name,
                reason,
                server,
            } => {
                let client = server.connect().await?;
                client.cordon(&name, &reason.reason).await?;
                say!("{} gets no more jobs", others(&name));
            }
            Self::Uncordon { name, server } => {
                server.connect().await?.uncordon(&name).await?;
                say!("{} gets jobs again", others(&name));
            }
        }
        Ok(())
    }
}
