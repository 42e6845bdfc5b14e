//! An export by a worker of the service.

use crate::export::Export;
use crate::export::motions::Numbered;
use crate::export::written::Written;
use crate::show::note_capture_end;
use crate::waiting::wait_for_new;
use anyhow::{Context, bail};
use yoto_client::YotoClient;
use yoto_proto::v1::{Distillation, DistilledSplats, ExportForm, ExportSpec, job_result};
use yoto_terminal::output;
use yoto_terminal::progress::ProgressDisplay;

impl Export {
    /// Has `subject` of the `model` exported, and writes the files.
    pub(crate) async fn by_service(
        &self,
        model: &str,
        subject: &str,
        form: ExportForm,
        written: &Written,
    ) -> anyhow::Result<()> {
        let client = self.queue.apply(self.person.server.connect().await?);
        let drivers = self.drivers(&client).await?;
        let chosen = self.chosen(drivers, form)?;
        let found = client.find_model(model).await?;
        let person = client.find_subject(subject).await?;
        let checkpoint = self.person.checkpoint.clone();
        let distilled = self.seconds.is_some() || self.size.is_some() || self.field_only;
        let spec = ExportSpec {
            subject: person.name,
            form: form.into(),
            motions: chosen.motions,
            rest: self.no_motion,
            frame: chosen.frame,
            triangles: self.triangles.unwrap_or_default(),
            texture: self.texture.unwrap_or_default(),
            distillation: distilled.then(|| Distillation {
                seconds: self.seconds.unwrap_or_default(),
                size: self.size.unwrap_or_default(),
                field_only: self.field_only,
            }),
            checkpoint: checkpoint.map(|it| it.of(&found.name)).unwrap_or_default(),
            file: written.stem()?.to_owned(),
            max_bytes: self.max_bytes.unwrap_or_default(),
            model: found.name,
        };
        let job = client.export(spec).await?;
        output::put("job", output::message(&job));
        let mut display = ProgressDisplay::new(format!("{subject} by {model}"));
        let job = wait_for_new(&client, &job.name, &mut display).await?;
        display.clear();
        output::put("job", output::message(&job));
        let Some(job_result::Kind::Export(result)) = job.result.and_then(|it| it.kind) else {
            bail!("{} succeeded without the result of an export", job.name);
        };
        let contents = client.exported(&job.name, &result).await?;
        written.write(&contents, &result)?;
        if let Some(distilled) = &result.distilled {
            show(distilled, self.field_only);
        }
        Ok(())
    }

    /// The motions of people in the service.
    async fn drivers(&self, client: &YotoClient) -> anyhow::Result<Vec<Numbered>> {
        let mut drivers = Vec::new();
        for name in &self.drivers {
            let driver = client.find_subject(name).await.context("--motion")?;
            if let Some(range) = self.range {
                note_capture_end(client, &driver, range).await;
            }
            drivers.push(Numbered::driver(name, driver.name, self.range));
        }
        Ok(drivers)
    }
}

/// Says how near splats are to the field that they were made of.
fn show(distilled: &DistilledSplats, field_only: bool) {
    let DistilledSplats {
        pictures,
        frames,
        seconds,
        ..
    } = *distilled;
    let of_field = pictures.saturating_sub(frames);
    tell!(
        "splats made from {of_field} pictures of the field and {frames} frames in {seconds:.0} s"
    );
    if frames == 0 && !field_only {
        tell!(
            "note: the person's capture is not the one that the model was trained on, so its frames were left \
             out: train the model again for them to count"
        );
    }
    if let (Some(whole), Some(near)) = (distilled.psnr, distilled.psnr_mask_box) {
        tell!(
            "{whole:.2} dB to the field on pictures that were held out, {near:.2} dB near the person"
        );
        output::put("psnr", whole);
        output::put("psnr_mask_box", near);
    }
}
