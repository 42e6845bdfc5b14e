//! The captures of a person: the frames that training reads, as a folder that can be added again.

use super::{ExportedPart, PersonExport, id};
use anyhow::Context;
use std::path::Path;
use yoto_capture::Shard;
use yoto_import::write_images;
use yoto_proto::keys::FRAMES;
use yoto_proto::v1::{Capture, capture};
use yoto_terminal::output;

impl PersonExport<'_> {
    /// Writes all captures that were read.
    pub(super) async fn captures(&self) -> anyhow::Result<ExportedPart> {
        let mut part = ExportedPart::default();
        for capture in self.client.list_captures(&self.subject.name).await? {
            part.about.push(output::message(&capture));
            match capture.state() {
                capture::State::Ready => self.capture(&capture, &mut part).await?,
                state => part.left_out.push(format!(
                    "the uploaded files of {}, which is {}: `yoto subject ingest` reads them, \
                     `yoto subject delete-capture` removes them",
                    capture.name,
                    state.as_str_name()
                )),
            }
        }
        Ok(part)
    }

    async fn capture(&self, capture: &Capture, part: &mut ExportedPart) -> anyhow::Result<()> {
        let place = Path::new("captures").join(id(&capture.name));
        let folder = self.out.join(&place);
        for object in self.client.list_objects(&capture.name).await? {
            let bytes = self.client.object(&object).await?;
            if object.file != FRAMES {
                part.files
                    .push(self.write(&place.join(&object.file), &bytes)?);
                continue;
            }
            let shard = Shard::from_bytes(bytes)
                .with_context(|| format!("reading the frames of {}", capture.name))?;
            std::fs::create_dir_all(&folder)
                .with_context(|| format!("making the folder {}", folder.display()))?;
            let images = (0..shard.frames()).map(|frame| shard.image(frame));
            part.files
                .extend(write_images(&shard.track, images, &folder)?);
        }
        Ok(())
    }
}
