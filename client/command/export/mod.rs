//! `yoto export`: one person of a trained model in a file that other programs play.

mod form;
mod motions;
#[cfg(feature = "embedded")]
mod on_disk;
mod service;
mod written;

use crate::args::frame_range::FrameRange;
use crate::args::motion::MotionArgs;
use crate::args::person::{ModelSource, PersonArgs};
use crate::args::{QueueArgs, distillation_seconds, distillation_sizes};
use anyhow::ensure;
use clap::Args;
use form::{Format, form};
use motions::Numbered;
use std::path::PathBuf;
use written::Written;
use yoto_proto::v1::{ExportForm, ExportMotion};

const AFTER_HELP: &str = "\
The extension of the file tells its format:
  .html  a page that plays the person in any browser with WebGL2, in one file: drag to
         turn, play motions, bend joints
  .ply   Gaussian splats of one pose (the rest pose, or --frame of a motion), for
         viewers of 3D Gaussian splatting; no motion
  .spz   the same in a sixteenth of the bytes; harmonics of the first or second degree
         add up to 9 or 24 bytes to the 15 of a splat
  .glb   a mesh with a texture and bones, which plays motions in programs that read
         glTF; with --format splats, the splats of one pose
  .obj   the mesh in one pose, with a material (.mtl) and a texture (.png) beside it;
         with --format ply-mesh, a .ply is the mesh with a colour per vertex
A worker of the service makes the files for a model of the service. Motions come from captures on
this disk, from people in the service, and from files, in this order; without any, from the
person's own capture. Only poses.json of a capture on this disk is read; `yoto subject poses
--refined` writes one with refined poses. A model of another tier than splat is a field: splats are
made from it first, in --seconds, as `yoto-lab distill --frames` does. The folder of a checkpoint is
read on this machine; it needs splats, and its people move only as --capture and --motion-file say.

Examples:
  yoto export duo --subject ada --out ada.html
  yoto export duo --subject ada --motion ada --motion bob --out ada.html
  yoto export duo --subject ada --capture captures/ada --capture captures/bob --out ada.html
  yoto export duo --subject ada --motion-file walk.bvh --motion-file jump.npz --out ada.glb
  yoto export duo --subject ada --no-motion --out ada.glb
  yoto export duo --subject ada --out ada.ply
  yoto export duo --subject ada --max-bytes 200000 --out ada.html
  yoto export duo --subject ada --frame 30 --out ada.obj
  yoto export duo --subject ada --format ply-mesh --out ada.ply
  yoto export fog --subject ada --seconds 120 --out ada.spz
  yoto export checkpoints/000000002000 --slot 1 --capture captures/bob --frame 30 --out bob.ply";

/// Write one person of a trained model to a file that other programs play.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Export {
    #[command(flatten)]
    person: PersonArgs,
    /// Folder of a capture whose motion is used; may be given several times.
    #[arg(long = "capture", value_name = "DIR")]
    captures: Vec<PathBuf>,
    /// Person of the service whose captured motion is used, by name; may be given several times.
    #[arg(long = "motion", value_name = "DRIVER")]
    drivers: Vec<String>,
    /// Motion file to use: BVH, AMASS-style .npz, or a pose track (.json, .pb); may be given several times. `yoto
    /// motion` shows its contents.
    #[arg(long = "motion-file", value_name = "FILE")]
    motion_files: Vec<PathBuf>,
    /// Export the rest pose, without the motion of the person's own capture.
    #[arg(long, conflicts_with_all = ["captures", "drivers", "motion_files", "frame"])]
    no_motion: bool,
    #[command(flatten)]
    reading: MotionArgs,
    /// Frames to use, every STEP-th stored one: of --motion by their numbers, of --motion-file counted from 0, e.g.
    /// 0..240:4 [default: all].
    #[arg(long, value_name = "A..B:STEP")]
    range: Option<FrameRange>,
    /// Frame whose pose a file without motion gets, by its number in the capture or motion file, or, without one, in
    /// the person's own capture.
    #[arg(long, value_name = "N")]
    frame: Option<u32>,
    /// File to write: .html, .ply, .spz, .glb or .obj.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Content of the file, or its exact format, where the extension of --out allows several [default: mesh in .glb
    /// and .obj, splats in .ply and .spz].
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// Largest number of triangles in a mesh, as far as its holes and handles allow [default: 20000].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    triangles: Option<u32>,
    /// Side of a mesh's texture, pixels [default: 1024].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(64..=8192))]
    texture: Option<u32>,
    /// Largest size of a page or a file of splats, bytes: nearby splats are merged until it fits [default: no limit].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1000..))]
    max_bytes: Option<u64>,
    /// Time to make splats from a field, seconds [default: 60].
    #[arg(long, value_name = "S", value_parser = distillation_seconds)]
    seconds: Option<f64>,
    /// Shorter side of the pictures from which splats of a field learn, pixels, at most the side of the capture's
    /// frames [default: 256].
    #[arg(long, value_name = "PX", value_parser = distillation_sizes())]
    size: Option<u32>,
    /// Learn splats of a field from its pictures alone, without the frames of the person's capture.
    #[arg(long)]
    field_only: bool,
    /// Overwrite an existing file.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    queue: QueueArgs,
}

/// The motions of an export.
pub(crate) struct ChosenMotions {
    motions: Vec<ExportMotion>,
    /// The frame whose pose a still form gets, of the one motion or else of the person's own capture.
    frame: Option<u32>,
}

impl Export {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let form = self.form()?;
        let source = self.person.source()?;
        let written = Written::new(&self.out, form);
        for file in written.files() {
            ensure!(
                self.force || !file.exists(),
                "{} is there already: choose another file (--out), or overwrite it (--force)",
                file.display()
            );
        }
        match source {
            ModelSource::Folder(folder) => {
                ensure!(
                    self.drivers.is_empty()
                        && self.seconds.is_none()
                        && self.size.is_none()
                        && !self.field_only,
                    "{} is a folder: --motion, --seconds, --size and --field-only belong to a model of the \
                     service",
                    folder.display()
                );
                let chosen = self.chosen(Vec::new(), form)?;
                self.on_disk(folder, form, chosen, &written)
            }
            ModelSource::Service { model, subject } => {
                self.by_service(model, subject, form, &written).await
            }
        }
    }

    /// Checks the file's name and the options that belong to it before anything is asked for.
    fn form(&self) -> anyhow::Result<ExportForm> {
        let form = form(&self.out, self.format)?;
        let moves = [
            self.captures.len(),
            self.drivers.len(),
            self.motion_files.len(),
        ];
        let moves: usize = moves.iter().sum();
        if form.is_still() {
            ensure!(
                moves == 0 || self.frame.is_some(),
                "{} has one pose: choose one of the motion's with --frame",
                self.out.display()
            );
            ensure!(
                moves < 2,
                "--frame needs one --capture, one --motion or one --motion-file"
            );
            ensure!(
                !self.no_motion,
                "--no-motion belongs to files with motion: {} has none",
                self.out.display()
            );
        } else {
            ensure!(
                self.frame.is_none(),
                "--frame belongs to files of one pose: pages and .glb meshes play all frames"
            );
        }
        ensure!(
            form.is_mesh() || (self.triangles.is_none() && self.texture.is_none()),
            "--triangles and --texture belong to a mesh"
        );
        ensure!(
            !form.is_mesh() || self.max_bytes.is_none(),
            "--max-bytes belongs to pages and files of splats"
        );
        ensure!(
            !self.motion_files.is_empty() || !self.reading.any(),
            "--joint-map and --up belong to --motion-file"
        );
        ensure!(
            !self.motion_files.is_empty() || !self.drivers.is_empty() || self.range.is_none(),
            "--range belongs to --motion and --motion-file"
        );
        Ok(form)
    }

    /// The motions of captures, of `drivers`, and of files.
    fn chosen(&self, drivers: Vec<Numbered>, form: ExportForm) -> anyhow::Result<ChosenMotions> {
        let range = self.range.unwrap_or(FrameRange::ALL);
        let captures = self.captures.iter().map(|dir| Numbered::capture(dir));
        let files = self.motion_files.iter();
        let files = files.map(|file| Numbered::file(file, &self.reading.read(file)?, range));
        let all = captures.chain(drivers.into_iter().map(Ok)).chain(files);
        let all: Vec<Numbered> = all.collect::<anyhow::Result<_>>()?;
        let Some(number) = self.frame.filter(|_| form.is_still()) else {
            let motions = all.into_iter().map(|it| it.motion).collect();
            return Ok(ChosenMotions {
                motions,
                frame: None,
            });
        };
        let one = all.into_iter().next().map(|motion| motion.still(number));
        Ok(match one.transpose()? {
            Some((motion, frame)) => ChosenMotions {
                motions: vec![motion],
                frame: Some(frame),
            },
            None => ChosenMotions {
                motions: Vec::new(),
                frame: Some(number),
            },
        })
    }

    /// The folder of a checkpoint needs the model.
    #[cfg(not(feature = "embedded"))]
    fn on_disk(
        &self,
        folder: PathBuf,
        _: ExportForm,
        _: ChosenMotions,
        _: &Written,
    ) -> anyhow::Result<()> {
        anyhow::bail!(
            "{} is a folder: this program was built without the model (feature `embedded`), and exports \
             only from models of a service",
            folder.display()
        )
    }
}
