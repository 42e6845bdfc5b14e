//! The work of the service: from a capture to a trained person, their pictures, and the page that plays them.

use super::live::Live;
use super::motion::ShownMotion;
use super::report::AvatarReport;
use super::{AvatarOptions, PLAYER, REPORT};
use crate::model::preview::Previews;
use crate::model::report;
use crate::studio::person;
use crate::studio::players::write_pages;
use crate::studio::service::with_service;
use crate::studio::shots::{Finished, Shot, Shots};
use crate::studio::training::train;
use std::path::{Path, PathBuf};
use yoto_ingest::IngestSettings;
use yoto_proto::tiers::DEFAULT_TIER;
use yoto_proto::v1::{Orbit, TrainResult, TrainSpec, render_spec};
use yoto_terminal::output::others;

/// Quality tier and variant of the model.
const TIER: &str = DEFAULT_TIER;
const VARIANT: &str = "yoto";
/// Views of the orbit.
const ORBIT_VIEWS: u32 = 24;
/// Frames per second of the orbit's animation: it goes around in two seconds.
const ORBIT_FPS: f32 = 12.0;

/// Seconds between the checkpoints of a short training, each with a picture for the page.
const CHECKPOINT_SECONDS: f64 = 15.0;
/// Longest training, seconds, that has them; the service chooses the checkpoints of longer ones.
const SHORT_TRAINING: f64 = 900.0;

/// Folders that the service reads and writes.
pub(super) struct Places<'a> {
    pub out: &'a Path,
    pub capture: PathBuf,
    pub pictures: PathBuf,
    pub data: PathBuf,
}

/// What the service made.
pub(super) struct Made {
    pub trained: TrainResult,
    pub orbit: Finished,
    pub moved: Finished,
}

/// Uploads the capture, trains, renders, and writes the page that plays, with a service of its own.
pub(super) async fn make(
    options: &AvatarOptions,
    about: &AvatarReport,
    shown: &ShownMotion<'_>,
    places: Places<'_>,
    live: &Live,
) -> anyhow::Result<Made> {
    let Places {
        out,
        capture,
        pictures,
        data,
    } = places;
    let size = about.size;
    let ingest = IngestSettings {
        ffmpeg: options.import.ffmpeg.clone(),
        ..IngestSettings::default()
    };
    with_service(data, ingest, None, async |client| {
        let consent = "made by `yoto avatar` on the user's own machine";
        let subject = person::upload(client, &options.name, consent, &capture).await?;
        let model = client.create_model(&options.name, TIER, VARIANT).await?;
        client.add_identity(&model.name, &subject.name).await?;
        let label = format!("training of {}", options.name);
        let spec = TrainSpec {
            model: model.name.clone(),
            image_size: size,
            checkpoint_seconds: checkpoint_seconds(options.train.seconds),
            ..options.train.clone()
        };
        let folder = pictures.join("progress");
        let previews = Previews::start(client, &model.name, folder, live.pictures());
        let trained = train(client, &label, spec, |job| {
            live.job(job);
            previews.look(job);
        })
        .await?;
        // The avatar does not depend on the pictures of its making.
        if let Err(error) = previews.finish().await {
            tell!("note: pictures of the training are missing: {error:#}");
        }
        for note in &trained.notes {
            detail!("note: {}", others(note));
        }
        live.doing("trained; rendering the person from all around");
        let shots = Shots {
            client,
            model: &model,
        };
        let orbit = shots
            .render(Shot {
                between: None,
                label: format!("{} from all around", options.name),
                subject: &subject,
                what: render_spec::What::Orbit(Orbit {
                    frame: about.orbit_frame,
                    views: ORBIT_VIEWS,
                    size,
                }),
                folder: pictures.join("orbit"),
                animation: Some((out.join("orbit.png"), ORBIT_FPS)),
            })
            .await?;
        live.doing("trained; rendering a motion");
        let (what, fps) = shown.what(&subject, size, about.fps)?;
        let moved = shots
            .render(Shot {
                between: None,
                label: format!("{} in a motion", options.name),
                subject: &subject,
                what,
                folder: pictures.join("motion"),
                animation: Some((out.join("motion.png"), fps)),
            })
            .await?;
        live.doing("trained; writing the page that plays the person");
        let player = out.join(PLAYER);
        write_pages(client, &model, &[(&subject, &player)]).await?;
        report::write(client, &model.name, &out.join(REPORT)).await?;
        Ok(Made {
            trained,
            orbit,
            moved,
        })
    })
    .await
}

/// Seconds between the checkpoints of a training of `seconds`; 0 leaves them to the service.
fn checkpoint_seconds(seconds: f64) -> f64 {
    match seconds <= SHORT_TRAINING {
        true => CHECKPOINT_SECONDS,
        false => 0.0,
    }
}
