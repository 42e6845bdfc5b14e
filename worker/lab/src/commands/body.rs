//! `yoto-lab body`: the model of clothed bodies, learned from bodies in dense correspondence.

use anyhow::Context;
use clap::Args;
use std::path::{Path, PathBuf};
use yoto_body::Body;
use yoto_body::learn::{Bodies, BodyMesh, Settings};
use yoto_terminal::output;

const AFTER_HELP: &str = "\
DIR has bodies.npz with names [N], vertices [N, V, 3] in tenths of a millimetre, colours [N, V, 3] and joints
[N, 24, 3], and topology.npz with faces, uv, part, weight_joint and weight. A name is an identity, _, and an outfit. The
model is measured on the identities that it was not learned from.

Examples:
  yoto-lab body bodies --out body.safetensors
  yoto-lab body bodies --without Asian_F_1 Black_M_1 --shapes 20 --out body.safetensors";

/// Learn the model of clothed bodies.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct BodyCommand {
    /// Folder of the bodies.
    #[arg(value_name = "DIR")]
    bodies: PathBuf,
    /// Identity to leave out; may be repeated.
    #[arg(long, value_name = "IDENTITY", num_args = 1..)]
    without: Vec<String>,
    /// Number of shape components.
    #[arg(long, default_value_t = 40, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=512))]
    shapes: u16,
    /// Number of colour components.
    #[arg(long, default_value_t = 24, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=512))]
    colours: u16,
    /// The model's file.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Reads the bodies in `folder`.
fn bodies(folder: &Path) -> anyhow::Result<Bodies> {
    let read = |name: &str| {
        let path = folder.join(name);
        std::fs::read(&path).with_context(|| format!("reading {}", path.display()))
    };
    let bodies = Bodies::read(&read("bodies.npz")?, &read("topology.npz")?);
    bodies.with_context(|| format!("the bodies {}", folder.display()))
}

/// Reads those bodies in `folder` that have these `names`, with the joints of fingers and face if `parts` are wanted.
pub(super) fn meshes(
    folder: &Path,
    names: &[String],
    parts: bool,
) -> anyhow::Result<Vec<BodyMesh>> {
    let read = bodies(folder)?;
    let meshes = names.iter().map(|name| read.mesh(name, parts));
    let meshes = meshes.collect::<Result<_, _>>();
    meshes.with_context(|| format!("the bodies {}", folder.display()))
}

impl BodyCommand {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let folder = || format!("the bodies {}", self.bodies.display());
        let bodies = bodies(&self.bodies)?;
        let settings = Settings {
            shapes: self.shapes.into(),
            colours: self.colours.into(),
            without: self.without,
        };
        let bytes = Body::learn(&bodies, &settings)
            .with_context(folder)?
            .to_bytes()?;
        std::fs::write(&self.out, &bytes)
            .with_context(|| format!("writing {}", self.out.display()))?;
        if !settings.without.is_empty() {
            let report = Body::from_bytes(&bytes)?.measure(&bodies, &settings.without)?;
            say!("{report}");
        }
        say!("{} bytes: {}", bytes.len(), self.out.display());
        output::put("files", output::paths(&[&self.out]));
        Ok(())
    }
}
