//! `yoto scene`: files that describe scenes of several people.

mod camera;
mod file;
mod message;
mod path;

pub(crate) use file::{FileLight, SceneFile};
pub(crate) use message::Names;

use camera::{FileCamera, FileTurntable};
use clap::{Args, Subcommand};
use file::Placed;

const EXAMPLE_HELP: &str = "\
Example:
  yoto scene example ada bob eve > scene.json";

const SCHEMA_HELP: &str = "\
Example:
  yoto scene schema > scene.schema.json";

const AFTER_HELP: &str = "\
A scene has actors, a camera and a background. Its world has y up, the ground at y = 0, metres and
degrees. The default camera stands in front of everybody and shows them as a whole. Others are an orbit, a turntable, keys,
a dolly, matrices, the camera that filmed a motion (capture), or a held-out camera of that capture. An actor belongs to the
model that `yoto render` names, or to the model in the actor's field \"model\". People of splats and of fields hide each
other.

Examples:
  yoto scene example ada bob > scene.json        # edit it, then:
  yoto render duo --scene scene.json --out scene.mp4
  yoto scene schema > scene.schema.json";

/// Write a scene file to start from, or the JSON Schema of scene files.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct SceneCommand {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Print a scene of some people side by side, each with the motion of their capture.
    #[command(after_help = EXAMPLE_HELP)]
    Example {
        /// The people, by name.
        #[arg(required = true, value_name = "NAME")]
        people: Vec<String>,
    },
    /// Print the JSON Schema of scene files, for editors.
    #[command(after_help = SCHEMA_HELP)]
    Schema,
}

impl SceneCommand {
    pub(crate) fn run(self) -> anyhow::Result<()> {
        let json = match self.command {
            Command::Example { people } => serde_json::to_string_pretty(&example(people))?,
            Command::Schema => serde_json::to_string_pretty(&schemars::schema_for!(SceneFile))?,
        };
        say!("{json}");
        Ok(())
    }
}

/// Distance between the people of an example, metres.
const APART: f64 = 1.2;

/// `people` in a row, with a camera that walks around them.
fn example(people: Vec<String>) -> SceneFile {
    let middle = (people.len() as f64 - 1.0) / 2.0;
    let actors = people.into_iter().enumerate().map(|(index, subject)| {
        let mut actor = file::FileActor::of(subject);
        actor.at = Placed([(index as f64 - middle) * APART, 0.0]);
        actor
    });
    let mut scene = SceneFile::of(actors.collect());
    scene.camera = FileCamera::Turntable(FileTurntable::default());
    scene
}
