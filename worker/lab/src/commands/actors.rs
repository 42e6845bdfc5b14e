//! Options for people whose truth is known.

use super::body::meshes;
use clap::Args;
use std::path::PathBuf;
use yoto_body::learn::BodyMesh;

/// Bodies to film.
#[derive(Debug, Args)]
pub(super) struct BodyArgs {
    /// Folder of bodies.
    #[arg(long, value_name = "DIR", requires = "names")]
    bodies: Option<PathBuf>,
    /// Body of that folder to film, IDENTITY_OUTFIT; may be repeated.
    #[arg(long = "body", id = "names", value_name = "NAME", requires = "bodies", num_args = 1..)]
    names: Vec<String>,
}

/// People and bodies to film.
#[derive(Debug, Args)]
pub(super) struct ActorArgs {
    /// Number of synthetic people, in clothes that move.
    #[arg(long, value_name = "N", default_value_t = 0, required_unless_present_any = ["bodies", "captures"], value_parser = clap::value_parser!(u8).range(0..=64))]
    pub people: u8,
    #[command(flatten)]
    pub bodies: BodyArgs,
}

impl BodyArgs {
    /// The bodies that are named, with the joints of fingers and face if `parts` are wanted.
    ///
    /// # Errors
    /// A folder that can't be read, or has no body of a name.
    pub(super) fn meshes(&self, parts: bool) -> anyhow::Result<Vec<BodyMesh>> {
        match &self.bodies {
            Some(folder) => meshes(folder, &self.names, parts),
            None => Ok(Vec::new()),
        }
    }
}
