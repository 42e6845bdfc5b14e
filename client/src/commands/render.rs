//! `yoto render`: pictures of a person, rendered by a trained model.

use super::motion::MotionArgs;
use super::out_folder::{OutFolder, is_rendered};
use super::render_film;
use super::render_what::{FrameRange, read_views};
use super::waiting::wait_for_new;
use super::{Server, table};
use crate::api::YotoClient;
use crate::output;
use crate::progress::{ProgressDisplay, count};
use anyhow::Context;
use clap::{ArgGroup, Args};
use std::path::PathBuf;
use yoto_proto::names;
use yoto_proto::tiers::RENDER_TIERS;
use yoto_proto::v1::{
    MotionClip, MotionTransfer, Orbit, RenderChoice, RenderQuality, RenderResult, RenderSpec,
    job_result, render_quality::Want, render_spec,
};

const AFTER_HELP: &str = "\
A view list is a JSON file with the fields of poses.json:
  {\"views\": [{\"pose\": […], \"translation\": […], \"K\": […], \"E\": […], \"image_size\": [256, 256]}]}

Examples:
  yoto render duo --subject ada --orbit 0 --views 36 --animate --out out/ada
  yoto render duo --subject bob --motion ada --range 0..60:2 --animate --out out/dance
  yoto render duo --subject bob --motion-file walk.bvh --range 0..240:4 --animate --out out/walk
  yoto render duo --subject bob --motion ada --out dance.mp4
  yoto render duo --subject ada --orbit 0 --max-seconds-per-frame 0.1 --out out/quick
  yoto render duo --subject ada --view-list views.json --out out/views";

/// Fastest animation of the service, frames per second.
const MAX_FPS: f64 = 120.0;

/// Parses a frame rate.
fn fps(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(fps) if fps > 0.0 && f64::from(fps) <= MAX_FPS => Ok(fps),
        _ => Err(format!("a number above 0, at most {MAX_FPS}")),
    }
}

fn quality_help() -> String {
    let tiers: Vec<(&str, &str)> = RENDER_TIERS.iter().map(|it| (it.name, it.about)).collect();
    format!(
        "Choose a named point on the curve measured by `yoto tradeoff`.{}",
        table::explained(&tiers)
    )
}

/// Render a person: one pose from all around, with a person's or a file's motion, or given views.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
#[command(group = ArgGroup::new("what").required(true).args(["orbit", "motion", "motion_file", "view_list"]))]
pub(super) struct Render {
    /// The trained model, by name.
    model: String,
    /// The person to render, by name.
    #[arg(long, value_name = "NAME")]
    subject: String,
    /// Render this frame of the person's own capture from all around.
    #[arg(long, value_name = "FRAME")]
    orbit: Option<u32>,
    /// Views around the circle [default: 24].
    #[arg(long, conflicts_with_all = ["motion", "motion_file", "view_list"], value_name = "N", value_parser = clap::value_parser!(u32).range(1..=3600))]
    views: Option<u32>,
    /// Use the motion in this person's capture.
    #[arg(long, value_name = "DRIVER")]
    motion: Option<String>,
    /// Use the motion in a file: BVH, AMASS-style .npz, or a pose track (.json, .pb).
    #[arg(long, value_name = "FILE")]
    motion_file: Option<PathBuf>,
    #[command(flatten)]
    reading: MotionArgs,
    /// Frame of the person's own capture whose position and camera the motion file uses
    /// [default: the first].
    #[arg(long, requires = "motion_file", value_name = "FRAME")]
    start: Option<u32>,
    /// Frames of the motion, e.g. 0..60:2 or 100.. [default: all].
    #[arg(long = "range", alias = "frames", conflicts_with_all = ["orbit", "view_list"], value_name = "A..B:STEP")]
    frames: Option<FrameRange>,
    /// Move the camera along with a person who walks, who otherwise may leave the picture.
    #[arg(long, conflicts_with_all = ["orbit", "view_list"])]
    follow: bool,
    /// Poses and cameras from a JSON file.
    #[arg(long, value_name = "FILE")]
    view_list: Option<PathBuf>,
    /// Step of the checkpoint to render with [default: the best one by held-out PSNR].
    #[arg(long, value_name = "STEP")]
    checkpoint: Option<u64>,
    /// Longest side of the pictures, pixels; a view list has its own.
    #[arg(long, default_value_t = 256, value_name = "PX")]
    size: u32,
    /// Also write one animated PNG, for browsers.
    #[arg(long)]
    animate: bool,
    /// Frames per second of the animation or the film [default: the speed of the motion; 15 for others].
    #[arg(long, value_name = "N", value_parser = fps)]
    fps: Option<f32>,
    /// Background colour as red, green, blue from 0 to 1.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "0,0,0",
        value_name = "R,G,B"
    )]
    background: Vec<f32>,
    /// Transparent pictures: no background.
    #[arg(long, conflicts_with = "background")]
    transparent: bool,
    /// Choose the best fidelity within this many seconds per frame, as measured by `yoto tradeoff`.
    #[arg(long, value_name = "S", value_parser = table::seconds, group = "wish")]
    max_seconds_per_frame: Option<f64>,
    /// Choose the fastest with at least this held-out PSNR, dB, as measured by `yoto tradeoff`.
    #[arg(long, value_name = "DB", value_parser = table::decibels, group = "wish")]
    min_psnr: Option<f64>,
    /// Choose a named point on the curve measured by `yoto tradeoff`.
    #[arg(long, value_name = "NAME", value_parser = table::render_tier, group = "wish", long_help = quality_help())]
    quality: Option<String>,
    #[command(flatten)]
    folder: OutFolder,
    #[command(flatten)]
    server: Server,
}

impl Render {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        anyhow::ensure!(
            self.background.len() == 3,
            "--background takes three numbers, e.g. 1,1,1"
        );
        self.ensure_free()?;
        let (clip, fps) = self.clip()?;
        let client = self.server.connect().await?;
        let model = client.find_model(&self.model).await?;
        let subject = client.find_subject(&self.subject).await?;
        let checkpoint = self
            .checkpoint
            .map(|step| names::checkpoint(&model.name, step));
        let spec = RenderSpec {
            checkpoint: checkpoint.unwrap_or_default(),
            model: model.name,
            subject: subject.name,
            what: Some(match clip {
                Some(clip) => render_spec::What::Clip(clip),
                None => self.what(&client).await?,
            }),
            background: self.background.clone(),
            animate: self.animate,
            fps: self.fps.unwrap_or(fps),
            quality: self.wish(),
            transparent: self.transparent,
        };
        let job = client.create_render(spec).await?;
        output::put("job", output::message(&job));
        let mut display = ProgressDisplay::new(format!(
            "{} by {}",
            subject.display_name, model.display_name
        ));
        let job = wait_for_new(&client, &job.name, &mut display).await?;
        output::put("job", output::message(&job));
        let result = match job.result.and_then(|it| it.kind) {
            Some(job_result::Kind::Render(result)) => result,
            _ => RenderResult::default(),
        };
        let paths = if render_film::is_film(&self.folder.out) {
            self.fetch_film(&client, &job.name, result.fps).await?
        } else {
            let out = &self.folder.out;
            let objects = client.list_objects(&job.name).await?;
            let paths = client.fetch_objects(&objects, out, &mut |_| ()).await?;
            self.folder.remove_others(is_rendered, &paths)?;
            paths
        };
        let written = match render_film::is_film(&self.folder.out) {
            true => "a film".to_owned(),
            false => count(paths.len(), "file"),
        };
        display.finish(&format!("{written} in {}", self.folder.out.display()));
        if let Some(choice) = &result.choice {
            tell!("{}", kept(choice));
            if let Some(over) = self
                .max_seconds_per_frame
                .and_then(|it| over(it, choice, &result.device))
            {
                tell!("{over}");
            }
        }
        self.folder.show(&paths);
        Ok(())
    }

    /// Checks the options of the output, and that nothing of the user's would be replaced.
    fn ensure_free(&self) -> anyhow::Result<()> {
        let film = render_film::is_film(&self.folder.out);
        anyhow::ensure!(
            !film || (!self.transparent && !self.animate),
            "--transparent and --animate belong to a folder of pictures: an .mp4 is one film without \
             transparency"
        );
        anyhow::ensure!(
            film || self.animate || self.fps.is_none(),
            "--fps belongs to --animate or to a film (--out FILE.mp4)"
        );
        if film {
            return render_film::ensure_free(&self.folder.out, self.folder.force);
        }
        self.folder.ensure_free(is_rendered)
    }

    /// Writes the pictures of the job `name` as a film, and returns its path.
    async fn fetch_film(
        &self,
        client: &YotoClient,
        name: &str,
        fps: f32,
    ) -> anyhow::Result<Vec<PathBuf>> {
        let folder = tempfile::tempdir().context("making a temporary folder")?;
        let objects = client.list_objects(name).await?;
        let mut pictures = client
            .fetch_objects(&objects, folder.path(), &mut |_| ())
            .await?;
        pictures.sort();
        let out = self.folder.out.clone();
        let written = tokio::task::spawn_blocking(move || {
            render_film::write(&pictures, f64::from(fps), &out).map(|()| vec![out])
        });
        written.await.context("writing the film")?
    }

    /// The requested quality, if any.
    fn wish(&self) -> Option<RenderQuality> {
        let seconds = self.max_seconds_per_frame.map(Want::MaxSecondsPerFrame);
        let psnr = self.min_psnr.map(Want::MinPsnrDb);
        let tier = self.quality.clone().map(Want::Tier);
        let want = seconds.or(psnr).or(tier)?;
        Some(RenderQuality { want: Some(want) })
    }

    /// The motion of a file, and its frame rate; 0 is the service's default.
    fn clip(&self) -> anyhow::Result<(Option<MotionClip>, f32)> {
        let Some(path) = &self.motion_file else {
            anyhow::ensure!(
                !self.reading.any(),
                "--joint-map and --up belong to --motion-file"
            );
            return Ok((None, 0.0));
        };
        let motion = self.reading.read(path)?;
        let range = self.frames.unwrap_or(FrameRange::ALL);
        let step = range.step as usize;
        let mut clip = motion.clip(range.first as usize, range.end as usize, step, self.size);
        anyhow::ensure!(
            !clip.poses.is_empty(),
            "{} has {} frames, none of them chosen by --range",
            path.display(),
            motion.frames.len()
        );
        let last = range.end != FrameRange::ALL.end && range.end as usize > motion.frames.len();
        if last {
            tell!(
                "note: {} has {}: --range ends there",
                path.display(),
                count(motion.frames.len(), "frame")
            );
        }
        clip.camera_frame = self.start;
        clip.follow = self.follow;
        let fps = motion.fps / f64::from(range.step);
        if fps > MAX_FPS && self.animate && self.fps.is_none() {
            let step = (motion.fps / MAX_FPS).ceil();
            tell!(
                "note: {fps:.0} frames per second are more than {MAX_FPS:.0}: the animation is slow; \
                 with --range A..B:{step:.0} it is not"
            );
        }
        Ok((Some(clip), fps.min(MAX_FPS) as f32))
    }

    async fn what(&self, client: &YotoClient) -> anyhow::Result<render_spec::What> {
        if let Some(frame) = self.orbit {
            let orbit = Orbit {
                frame,
                views: self.views.unwrap_or(24),
                size: self.size,
            };
            return Ok(render_spec::What::Orbit(orbit));
        }
        if let Some(driver) = &self.motion {
            let driver = client.find_subject(driver).await?;
            let transfer = MotionTransfer {
                driver: driver.name,
                first_frame: self.frames.map(|range| range.first),
                frame_count: self.frames.map_or(0, |range| range.count()),
                frame_step: self.frames.map_or(1, |range| range.step),
                size: self.size,
                follow: self.follow,
            };
            return Ok(render_spec::What::Motion(transfer));
        }
        let path = self
            .view_list
            .as_deref()
            .context("nothing to render: give --orbit, --motion, --motion-file or --view-list")?;
        Ok(render_spec::What::Views(read_views(path)?))
    }
}

/// The chosen settings, with predicted and actual figures, in two lines.
fn kept(choice: &RenderChoice) -> String {
    let settings = choice.settings.unwrap_or_default();
    let decibels = |psnr: Option<f64>| {
        psnr.map_or_else(|| "unknown".to_owned(), |psnr| format!("{psnr:.2} dB"))
    };
    let seen = match choice.psnr {
        Some(psnr) => format!("{psnr:.2} dB on {} pictures", choice.pictures_with_truth),
        None => "no ground truth for these pictures".to_owned(),
    };
    format!(
        "chosen: {} samples per ray, likelihood bound {}, least light {}, {}, {:.0} % of the \
         resolution\n\
         promised {:.4} s a frame and {} (on {}); took {:.4} s a frame, {seen}",
        settings.samples,
        settings.epsilon,
        settings.min_transmittance,
        if settings.bf16 { "bf16" } else { "f32" },
        100.0 * settings.scale,
        choice.predicted_seconds_per_frame,
        decibels(choice.predicted_psnr),
        choice.measured_on,
        choice.seconds_per_frame,
    )
}

/// A note that a frame took longer than the `limit` in seconds, and a likely reason; `device` has
/// rendered it.
fn over(limit: f64, choice: &RenderChoice, device: &str) -> Option<String> {
    let taken = choice.seconds_per_frame;
    let reason = if choice.measured_on != device {
        format!(
            "the trade-off was measured on {}, this was rendered on {device}: measure it there with \
             `yoto tradeoff`",
            choice.measured_on
        )
    } else {
        "the machine was busier than at the measurement, or these pictures show more of the person; \
         a lower limit leaves room for that"
            .to_owned()
    };
    (taken > limit).then(|| {
        format!(
            "over your limit of {limit} s by {:.4} s: {reason}",
            taken - limit
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_that_was_not_kept_is_admitted() {
        let choice = |seconds| RenderChoice {
            measured_on: "a CPU".into(),
            seconds_per_frame: seconds,
            ..RenderChoice::default()
        };
        assert_eq!(over(0.1, &choice(0.1), "a CPU"), None);
        let said = over(0.1, &choice(0.144), "a CPU").expect("over");
        assert!(
            said.starts_with("over your limit of 0.1 s by 0.0440 s: the machine"),
            "{said}"
        );
        let said = over(0.1, &choice(0.144), "a GPU").expect("over");
        assert!(
            said.contains("measured on a CPU, this was rendered on a GPU"),
            "{said}"
        );
    }
}
