//! The demo's render jobs, and the paths of their files.

use super::people::{Actor, HeldOut};
use crate::studio::shots::{Shot, Shots};
use anyhow::ensure;
use image::RgbImage;
use std::path::{Path, PathBuf};
use yoto_media::picture_file;
use yoto_proto::v1::{
    Between, BodyPose, MotionTransfer, Orbit, Subject, View, ViewList, render_spec,
};

/// Views of an orbit.
const ORBIT_VIEWS: u32 = 24;
/// The frame of the orbit, as a share of the video: a raised arm shows more than the neutral pose
/// at the start.
const ORBIT_MOMENT: f64 = 0.4;
/// The motion that is transferred: every other frame of the whole video.
pub(super) const MOTION_STEP: u32 = 2;
const MOTION_FRAMES: u32 = 30;
/// People between two, both included.
const STEPS_BETWEEN: u32 = 10;
/// Frames per second of animations: the orbit goes around in two seconds.
const FPS: f32 = 12.0;

/// Renders with one trained model, into one folder.
#[derive(Debug)]
pub(super) struct Studio<'a> {
    pub shots: Shots<'a>,
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
            .shots
            .render(Shot {
                label: format!("{} in held-out views and poses", actor.name),
                subject,
                what,
                between: None,
                folder,
                animation: None,
            })
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
        self.shots
            .render(Shot {
                label: format!("{} from all around", actor.name),
                subject,
                what,
                between: None,
                folder: self.out.join(&stem),
                animation: Some((animation, FPS)),
            })
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
            frame_count: MOTION_FRAMES,
            frame_step: MOTION_STEP,
            size: self.size,
            ..MotionTransfer::default()
        });
        let animation = self.out.join("motion-transfer.png");
        let finished = self
            .shots
            .render(Shot {
                label: format!(
                    "{} in the motion of {}",
                    wears.display_name, moves.display_name
                ),
                subject: wears,
                what,
                between: None,
                folder: self.out.join("motion-transfer"),
                animation: Some((animation, FPS)),
            })
            .await?;
        read_all(&finished.frames)
    }
}

impl Studio<'_> {
    /// Renders [`STEPS_BETWEEN`] people between two, from one to the other, all in one pose of the first.
    pub(super) async fn between(
        &self,
        one: &Subject,
        other: &Subject,
    ) -> anyhow::Result<Vec<RgbImage>> {
        let what = render_spec::What::Orbit(Orbit {
            frame: 0,
            views: 1,
            size: self.size,
        });
        let last = (STEPS_BETWEEN - 1) as f32;
        let shares = (0..STEPS_BETWEEN).map(|step| step as f32 / last).collect();
        let finished = self
            .shots
            .render(Shot {
                label: format!(
                    "mixtures from {} to {}",
                    one.display_name, other.display_name
                ),
                subject: one,
                what,
                between: Some(Between {
                    subject: other.name.clone(),
                    shares,
                }),
                folder: self.out.join("between"),
                animation: None,
            })
            .await?;
        read_all(&finished.frames)
    }
}

fn read_all(paths: &[PathBuf]) -> anyhow::Result<Vec<RgbImage>> {
    Ok(paths
        .iter()
        .map(|path| picture_file::read(path))
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
