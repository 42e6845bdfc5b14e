//! The demo's render jobs, and the paths of their files.

use super::people::{Actor, HeldOut};
use crate::api::YotoClient;
use crate::progress::ProgressDisplay;
use anyhow::{Context, bail, ensure};
use image::RgbImage;
use std::path::{Path, PathBuf};
use yoto_lab::pictures;
use yoto_proto::v1::{
    BodyPose, Job, Model, MotionTransfer, Orbit, RenderSpec, Subject, View, ViewList, job_result,
    render_spec,
};

/// Views of an orbit.
const ORBIT_VIEWS: u32 = 24;
/// The frame of the orbit, as a share of the video: a raised arm shows more than the neutral pose
/// at the start.
const ORBIT_MOMENT: f64 = 0.4;
/// The motion that is transferred: every other frame of the whole video.
pub(super) const MOTION_STEP: u32 = 2;
const MOTION_FRAMES: u32 = 30;
/// Frames per second of animations: the orbit goes around in two seconds.
const FPS: f32 = 12.0;
/// Name of a render job's animation.
const ANIMATION: &str = "animation.png";

/// Renders with one trained model, into one folder.
#[derive(Debug)]
pub(super) struct Studio<'a> {
    pub client: &'a YotoClient,
    pub model: &'a Model,
    pub out: &'a Path,
    pub size: u32,
}

/// One person's held-out views, rendered by the model.
#[derive(Debug)]
pub(super) struct HeldOutRenders {
    pub novel_view: Vec<RgbImage>,
    pub novel_pose: Vec<RgbImage>,
    pub seconds_per_frame: f64,
}

struct Finished {
    job: Job,
    frames: Vec<PathBuf>,
    seconds_per_frame: f64,
}

impl Studio<'_> {
    /// Renders the views for which [`Actor`] has ground truth.
    pub(super) async fn held_out(
        &self,
        actor: &Actor,
        subject: &Subject,
    ) -> anyhow::Result<HeldOutRenders> {
        let views = actor
            .novel_view
            .iter()
            .chain(&actor.novel_pose)
            .map(view)
            .collect();
        let what = render_spec::What::Views(ViewList { views });
        let folder = self.out.join(format!("held-out-{}", actor.name));
        let finished = self
            .render(
                &format!("{}, held out", actor.name),
                subject,
                what,
                &folder,
                None,
            )
            .await?;
        let expected = actor.novel_view.len() + actor.novel_pose.len();
        let (found, name) = (finished.frames.len(), &finished.job.name);
        ensure!(
            found == expected,
            "{name}: {found} pictures for {expected} views"
        );
        let mut novel_view = read_all(&finished.frames)?;
        let novel_pose = novel_view.split_off(actor.novel_view.len());
        Ok(HeldOutRenders {
            novel_view,
            novel_pose,
            seconds_per_frame: finished.seconds_per_frame,
        })
    }

    /// Renders one pose from all around, as `orbit-NAME/` and one animation.
    pub(super) async fn orbit(&self, actor: &Actor, subject: &Subject) -> anyhow::Result<()> {
        let frame = (ORBIT_MOMENT * actor.film.len() as f64) as u32;
        let what = render_spec::What::Orbit(Orbit {
            frame,
            views: ORBIT_VIEWS,
            size: self.size,
        });
        let stem = format!("orbit-{}", actor.name);
        let animation = self.out.join(format!("{stem}-animation.png"));
        let label = format!("{}, orbit", actor.name);
        self.render(
            &label,
            subject,
            what,
            &self.out.join(&stem),
            Some(&animation),
        )
        .await?;
        Ok(())
    }

    /// Renders the motion of `moves` on the body of `wears`.
    pub(super) async fn motion_transfer(
        &self,
        moves: &Subject,
        wears: &Subject,
    ) -> anyhow::Result<Vec<RgbImage>> {
        let what = render_spec::What::Motion(MotionTransfer {
            driver: moves.name.clone(),
            first_frame: None,
            frame_count: MOTION_FRAMES,
            frame_step: MOTION_STEP,
            size: self.size,
            follow: false,
        });
        let label = format!("{} moves {}", moves.display_name, wears.display_name);
        let animation = self.out.join("motion-transfer.png");
        let finished = self
            .render(
                &label,
                wears,
                what,
                &self.out.join("motion-transfer"),
                Some(&animation),
            )
            .await?;
        read_all(&finished.frames)
    }

    /// Runs one render job and fetches its files; the animation, if requested, has its own
    /// path.
    async fn render(
        &self,
        label: &str,
        subject: &Subject,
        what: render_spec::What,
        folder: &Path,
        animation: Option<&Path>,
    ) -> anyhow::Result<Finished> {
        let spec = RenderSpec {
            model: self.model.name.clone(),
            subject: subject.name.clone(),
            what: Some(what),
            background: Vec::new(),
            animate: animation.is_some(),
            fps: FPS,
            quality: None,
            checkpoint: String::new(),
            transparent: false,
        };
        let queued = self.client.create_render(spec).await?;
        let mut display = ProgressDisplay::new(label);
        let job = self
            .client
            .wait_for_job(&queued.name, |job| display.job(job))
            .await?;
        let Some(job_result::Kind::Render(result)) =
            job.result.as_ref().and_then(|result| result.kind.as_ref())
        else {
            bail!("{} succeeded without a render result", job.name);
        };
        let seconds_per_frame = result.seconds_per_frame;
        let objects = self.client.list_objects(&job.name).await?;
        let mut frames = self
            .client
            .fetch_objects(&objects, folder, &mut |_| ())
            .await?;
        if let Some(target) = animation {
            let is_animation =
                |path: &PathBuf| path.file_name().is_some_and(|name| name == ANIMATION);
            let index = frames.iter().position(is_animation);
            let source =
                frames.remove(index.with_context(|| format!("{} made no {ANIMATION}", job.name))?);
            std::fs::rename(&source, target)
                .with_context(|| format!("writing {}", target.display()))?;
        }
        display.finish(&format!(
            "{} pictures, {seconds_per_frame:.2} s each",
            frames.len()
        ));
        Ok(Finished {
            job,
            frames,
            seconds_per_frame,
        })
    }
}

fn read_all(paths: &[PathBuf]) -> anyhow::Result<Vec<RgbImage>> {
    Ok(paths
        .iter()
        .map(|path| pictures::read(path))
        .collect::<Result<_, _>>()?)
}

/// A held-out view in the API's terms.
fn view(held_out: &HeldOut) -> View {
    let pose = &held_out.pose;
    let pose = BodyPose {
        rotations: pose.rotations.concat(),
        translation: pose.translation.to_vec(),
    };
    View {
        pose: Some(pose),
        camera: Some(held_out.camera.to_proto()),
    }
}
