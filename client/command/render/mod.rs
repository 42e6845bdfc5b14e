//! `yoto render`: pictures of a person, rendered by a trained model.

mod between;
mod choice;
mod film;
mod spec;
mod views;

use crate::args;
use crate::args::frame_range::FrameRange;
use crate::args::motion::MotionArgs;
use crate::args::version::Version;
use crate::args::{QueueArgs, Server};
use crate::files::{OutFolder, is_rendered};
use crate::waiting::wait_for_new;
use anyhow::Context;
use between::BetweenTwo;
use choice::{as_they_are, kept, over};
use clap::{ArgGroup, Args};
use spec::MAX_FPS;
use std::path::PathBuf;
use yoto_client::YotoClient;
use yoto_proto::tiers::RENDER_TIERS;
use yoto_proto::v1::{RenderResult, job_result};
use yoto_terminal::output;
use yoto_terminal::progress::{ProgressDisplay, count};

const AFTER_HELP: &str = "\
A view list is a JSON file with the fields of poses.json:
  {\"views\": [{\"pose\": […], \"translation\": […], \"K\": […], \"E\": […], \"image_size\": [256, 256]}]}

Examples:
  yoto render duo --subject ada --orbit 0 --views 36 --animate --out out/ada
  yoto render duo --subject bob --motion ada --range 0..60:2 --animate --out out/dance
  yoto render duo --subject bob --motion-file walk.bvh --range 0..240:4 --animate --out out/walk
  yoto render duo --subject bob --motion ada --out dance.mp4    # or dance.webp, dance.gif
  yoto render duo --subject ada --turntable --out ada.mp4
  yoto render duo --subject ada --motion ada --compare truth --out ada.mp4
  yoto render duo --subject ada --orbit 0 --max-seconds-per-frame 0.1 --out out/quick
  yoto render duo --subject ada --view-list views.json --out out/views
  yoto render duo --subject ada --orbit 0 --light none --out out/neutral
  yoto render duo --between ada,bob:0.5 --orbit 0 --out out/between
  yoto render duo --between ada,bob:0..1:10 --orbit 0 --views 1 --out out/strip
  yoto render duo --scene scene.json --out scene.mp4    # yoto scene --help";

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
        args::explained(&tiers)
    )
}

/// Render a person from all around, in motion or from given views, or a scene of several people.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
#[command(group = ArgGroup::new("what").required(true).args(["orbit", "motion", "motion_file", "view_list", "turntable", "scene"]))]
pub(crate) struct Render {
    /// The trained model, by name.
    model: String,
    /// The person to render, by name.
    #[arg(
        long,
        required_unless_present_any = ["scene", "between"],
        conflicts_with_all = ["scene", "between"],
        value_name = "NAME"
    )]
    subject: Option<String>,
    /// Mixture of two people of the model, in place of a person: A,B:0.3 is mostly A; A,B:0..1:10 shows ten
    /// mixtures, from A to B.
    #[arg(long, value_name = "A,B:SHARE", conflicts_with_all = ["scene", "turntable", "compare", "light"])]
    between: Option<BetweenTwo>,
    /// Show the person with the bone lengths of another one, by name.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["scene", "between", "turntable", "compare"])]
    bones: Option<String>,
    /// Render this frame of the person's own capture from all around.
    #[arg(long, value_name = "FRAME")]
    orbit: Option<u32>,
    /// Views around the circle [default: 24].
    #[arg(long, conflicts_with_all = ["motion", "motion_file", "view_list", "turntable", "scene"], value_name = "N", value_parser = clap::value_parser!(u32).range(1..=3600))]
    views: Option<u32>,
    /// Use the motion in this person's capture.
    #[arg(long, value_name = "DRIVER")]
    motion: Option<String>,
    /// Use the motion in a file: BVH, AMASS-style .npz, or a pose track (.json, .pb).
    #[arg(long, value_name = "FILE")]
    motion_file: Option<PathBuf>,
    #[command(flatten)]
    reading: MotionArgs,
    /// Frame of the person's own capture that gives the motion file its position and camera [default: the first].
    #[arg(long, requires = "motion_file", value_name = "FRAME")]
    start: Option<u32>,
    /// Frames to render, every STEP-th stored one, e.g. 0..60:2 or 100..: frames of a capture's motion by their
    /// numbers; frames of a motion file, and pictures of a scene or turntable, counted from 0 [default: all].
    #[arg(long = "range", alias = "frames", conflicts_with_all = ["orbit", "view_list"], value_name = "A..B:STEP")]
    frames: Option<FrameRange>,
    /// Move the camera with the person, who otherwise may walk out of the picture.
    #[arg(long, conflicts_with_all = ["orbit", "view_list", "turntable", "scene"])]
    follow: bool,
    /// Poses and cameras from a JSON file.
    #[arg(long, value_name = "FILE")]
    view_list: Option<PathBuf>,
    /// Go around the person once while they move as in their capture.
    #[arg(long)]
    turntable: bool,
    /// JSON file of a scene: several people in one picture, of this model or others, with size and background. The
    /// file may set --fps, --range and --quality; the options override it. `yoto scene example` writes one to start
    /// from.
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Light on the person: `own`, as filmed; `none`, for colours without light and shade (spherical harmonics still
    /// depend on the view); or the name of another person of the model, for the light of their capture. Only models
    /// of splats have a light.
    #[arg(
        long,
        default_value = "own",
        conflicts_with = "scene",
        value_name = "LIGHT"
    )]
    light: String,
    /// Step or alias of the checkpoint to render with [default: the best one by held-out PSNR].
    #[arg(long, value_name = "STEP|ALIAS")]
    checkpoint: Option<Version>,
    /// Longest side of the pictures, pixels; a view list has its own.
    #[arg(
        long,
        default_value_t = 256,
        conflicts_with = "scene",
        value_name = "PX"
    )]
    size: u32,
    /// Also write one animated PNG, for browsers.
    #[arg(long)]
    animate: bool,
    /// Frames per second of the animation or the film; for a scene or turntable, before --range leaves pictures out
    /// [default: the rate of the motion, or 15 without one].
    #[arg(long, value_name = "N", value_parser = fps)]
    fps: Option<f32>,
    /// Background colour as red, green, blue from 0 to 1.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "0,0,0",
        conflicts_with = "scene",
        value_name = "R,G,B"
    )]
    background: Vec<f32>,
    /// Transparent pictures: no background.
    #[arg(long, conflicts_with_all = ["background", "scene"])]
    transparent: bool,
    /// Show depth (near is bright) or opacity in grey in place of colours.
    #[arg(long, value_name = "LAYER", value_parser = ["depth", "opacity"])]
    layer: Option<String>,
    /// Put the filmed picture to the left of each rendered one; only for a person's own motion (--motion
    /// with their own name).
    #[arg(long, value_name = "WITH", value_parser = ["truth"], requires = "motion")]
    compare: Option<String>,
    /// Choose the settings of best quality that take at most this many seconds per frame, as measured by `yoto
    /// tradeoff`.
    #[arg(long, value_name = "S", value_parser = args::seconds, group = "wish")]
    max_seconds_per_frame: Option<f64>,
    /// Choose the fastest settings with at least this held-out PSNR, dB, as measured by `yoto tradeoff`.
    #[arg(long, value_name = "DB", value_parser = args::decibels, group = "wish")]
    min_psnr: Option<f64>,
    /// Choose a named point on the curve measured by `yoto tradeoff`.
    #[arg(long, value_name = "NAME", value_parser = args::render_tier, group = "wish", long_help = quality_help())]
    quality: Option<String>,
    #[command(flatten)]
    folder: OutFolder,
    #[command(flatten)]
    queue: QueueArgs,
    #[command(flatten)]
    server: Server,
}

impl Render {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        anyhow::ensure!(
            self.background.len() == 3,
            "--background takes three numbers, e.g. 1,1,1"
        );
        self.ensure_free()?;
        let scene = self.scene_file()?;
        let transparent = self.transparent || scene.as_ref().is_some_and(|it| it.transparent);
        self.ensure_film(transparent)?;
        let clip = self.clip()?;
        let client = self.queue.apply(self.server.connect().await?);
        let model = client.find_model(&self.model).await?;
        let spec = self.spec(&client, &model, scene, clip, transparent).await?;
        let wished = spec.quality.is_some();
        let job = client.create_render(spec).await?;
        output::put("job", output::message(&job));
        let shown = self.person().unwrap_or("a scene");
        let mut display = ProgressDisplay::new(format!("{shown} by {}", model.display_name));
        let job = wait_for_new(&client, &job.name, &mut display).await?;
        output::put("job", output::message(&job));
        let result = match job.result.and_then(|it| it.kind) {
            Some(job_result::Kind::Render(result)) => result,
            _ => RenderResult::default(),
        };
        let paths = if film::is_film(&self.folder.out) {
            self.fetch_film(&client, &job.name, result.fps).await?
        } else {
            let out = &self.folder.out;
            let objects = client.list_objects(&job.name).await?;
            let paths = client.fetch_objects(&objects, out, &mut |_| ()).await?;
            self.folder.remove_others(is_rendered, &paths)?;
            paths
        };
        let written = match film::is_film(&self.folder.out) {
            true => "a film".to_owned(),
            false => count(paths.len(), "file"),
        };
        display.finish(&format!("{written} in {}", self.folder.out.display()));
        if let (Some(near), Some(far)) = (result.depth_near, result.depth_far) {
            tell!("depth: 255 is {near:.3} m, 1 is {far:.3} m, and 0 is the background");
        }
        if let Some(choice) = &result.choice {
            tell!("{}", kept(choice));
            if let Some(over) = self
                .max_seconds_per_frame
                .and_then(|it| over(it, choice, &result.device))
            {
                tell!("{over}");
            }
        } else if wished {
            tell!("{}", as_they_are(result.seconds_per_frame));
        }
        self.folder.show(&paths);
        Ok(())
    }

    /// Checks the options of the output, and that no file of the user would be replaced.
    fn ensure_free(&self) -> anyhow::Result<()> {
        film::ensure_known(&self.folder.out)?;
        let film = film::is_film(&self.folder.out);
        anyhow::ensure!(
            film || self.animate || self.fps.is_none(),
            "--fps belongs to --animate or to a film (--out FILE.mp4, FILE.webp or FILE.gif)"
        );
        if film {
            return film::ensure_free(&self.folder.out, self.folder.force);
        }
        self.folder.ensure_free(is_rendered)
    }

    /// Checks that a film is requested without options that films lack.
    fn ensure_film(&self, transparent: bool) -> anyhow::Result<()> {
        let out = &self.folder.out;
        anyhow::ensure!(
            !film::is_film(out) || !self.animate,
            "--animate belongs to a folder of pictures: an .mp4, .webp or .gif is one film"
        );
        anyhow::ensure!(
            !transparent || film::may_be_transparent(out),
            "{}: an .mp4 or .gif has no transparency; a .webp or a folder of pictures can have it",
            out.display()
        );
        Ok(())
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
            film::write(&pictures, f64::from(fps), &out).map(|()| vec![out])
        });
        written.await.context("writing the film")?
    }
}
