//! An export from the folder of a checkpoint, on this machine.

use crate::export::written::Written;
use crate::export::{ChosenMotions, Export};
use crate::studio::trained;
use anyhow::{Context, ensure};
use std::path::PathBuf;
use yoto_export::mesh::MeshOptions;
use yoto_export::order::Order;
use yoto_export::source::Source;
use yoto_proto::v1::export_motion::Motion;
use yoto_proto::v1::{ExportForm, ExportMotion, ExportResult};

impl Export {
    /// Writes the person in a slot of the model in `folder`.
    pub(crate) fn on_disk(
        &self,
        folder: PathBuf,
        form: ExportForm,
        chosen: ChosenMotions,
        written: &Written,
    ) -> anyhow::Result<()> {
        ensure!(
            chosen.frame.is_none() || !chosen.motions.is_empty(),
            "--frame needs one --capture or one --motion-file: {} has no captures",
            folder.display()
        );
        let motions = chosen.motions.iter().map(source);
        let motions: Vec<Source> = motions.collect::<anyhow::Result<_>>()?;
        let found = self.person.in_folder(folder);
        let person = trained::person(found.folder(), found.slot, &found.model)?;
        let standard = MeshOptions::default();
        let order = Order {
            form,
            title: &found.name,
            stem: written.stem()?,
            motions: &motions,
            frame: chosen.frame,
            mesh: MeshOptions {
                triangles: self.triangles.map_or(standard.triangles, |n| n as usize),
                texture: self.texture.unwrap_or(standard.texture),
            },
            rights: "",
            max_bytes: self.max_bytes,
        };
        let exported = order.of(&person)?;
        let (triangles, texture) = exported.mesh.unwrap_or_default();
        let result = ExportResult {
            splats: u32::try_from(exported.splats.unwrap_or_default())?,
            triangles: u32::try_from(triangles)?,
            texture,
            ..ExportResult::default()
        };
        let contents: Vec<Vec<u8>> = exported.files.into_iter().map(|it| it.bytes).collect();
        written.write(&contents, &result)
    }
}

/// A motion of this disk.
fn source(motion: &ExportMotion) -> anyhow::Result<Source> {
    let Some(Motion::Clip(clip)) = &motion.motion else {
        anyhow::bail!("{}: a folder has no captures", motion.name);
    };
    Source::clip(&motion.name, clip, &motion.up).context("a motion")
}
