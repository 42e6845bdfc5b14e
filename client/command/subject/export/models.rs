//! What models have learned of a person: their own parameters in each checkpoint, and their poses as trainings have
//! refined them.

use super::{ExportedPart, PersonExport, id};
use anyhow::Context;
use serde_json::json;
use std::path::Path;
use yoto_avatar::config::Variant;
use yoto_avatar::train::leaving::own_part;
use yoto_proto::manifest::files;
use yoto_proto::v1::{Checkpoint, IdentitySlot, Model};

impl PersonExport<'_> {
    /// Writes their part of all models.
    pub(super) async fn models(&self) -> anyhow::Result<ExportedPart> {
        let mut part = ExportedPart::default();
        for model in self.client.list_models().await? {
            let mut slots = model.slots.iter();
            let Some(slot) = slots.find(|slot| slot.subject == self.subject.name) else {
                continue;
            };
            let checkpoints = self.client.list_checkpoints(&model.name).await?;
            let steps: Vec<u64> = checkpoints.iter().map(|it| it.step).collect();
            part.about.push(json!({
                "model": model.name,
                "slot": slot.slot,
                "trained": slot.trained,
                "checkpoints": steps,
            }));
            if !has_own(&model) {
                part.left_out.push(format!(
                    "the parameters of {}: its people have none of their own",
                    model.name
                ));
            }
            let of_them = |it: &&Checkpoint| it.slots.is_empty() || it.slots.contains(&slot.slot);
            for checkpoint in checkpoints.iter().filter(of_them) {
                self.checkpoint(&model, slot, checkpoint, &mut part).await?;
            }
        }
        Ok(part)
    }

    async fn checkpoint(
        &self,
        model: &Model,
        slot: &IdentitySlot,
        checkpoint: &Checkpoint,
        part: &mut ExportedPart,
    ) -> anyhow::Result<()> {
        let place = Path::new("models")
            .join(id(&model.name))
            .join(checkpoint.step.to_string());
        let poses = files::refined_poses(slot.slot as usize);
        for object in self.client.list_objects(&checkpoint.name).await? {
            let (file, bytes) = match &*object.file {
                files::WEIGHTS if has_own(model) => {
                    let weights = self.client.object(&object).await?;
                    let own = own_part(&weights, slot.slot as usize);
                    let own = own.with_context(|| format!("reading {}", checkpoint.name))?;
                    ("person.safetensors", own)
                }
                name if name == poses => ("refined-poses.json", self.client.object(&object).await?),
                _ => continue,
            };
            part.files.push(self.write(&place.join(file), &bytes)?);
        }
        Ok(())
    }
}

/// Whether its people have parameters of their own.
fn has_own(model: &Model) -> bool {
    model.variant != Variant::NoIdentity.name()
}
