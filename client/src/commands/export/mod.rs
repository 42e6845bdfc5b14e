//! `yoto export`: one person of a trained model in a file that other programs play.

mod form;

use super::motion::MotionArgs;
use super::person_args::PersonArgs;
use super::render_what::FrameRange;
use super::whole_file::{folder_of, keep};
use crate::output;
use crate::progress::count;
use crate::studio::clips::{Source, clips};
use crate::studio::trained;
use anyhow::{Context, bail, ensure};
use clap::Args;
use form::{Form, Format, MeshFile, SplatFile};
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;
use yoto_avatar::render::SkinnedSplats;
use yoto_capture::skeleton::Pose;
use yoto_capture::skeleton::transform::inverse;
use yoto_export::mesh::{self, MeshOptions};
use yoto_export::{gaussians, page};
use yoto_formats::splats;

const AFTER_HELP: &str = "\
The name of the file says its form:
  .html  a page that plays the person in any browser with WebGL2, in one file: drag to
         turn, play motions, bend joints
  .ply   Gaussian splats of one pose (the rest pose, or --frame of a motion), for
         viewers of 3D Gaussian splatting; no motion
  .spz   the same in a twelfth of the bytes
  .glb   a mesh with a texture and bones, which plays motions in programs that read
         glTF; with --format splats, the splats of one pose
  .obj   the mesh in one pose, with a material (.mtl) and a texture (.png) beside it;
         with --format mesh, a .ply is the mesh with a colour per vertex
Motions are those of captures and of files, each a clip by the name of its folder or file.
The model has the tier splat; of other tiers, `yoto distill` makes splats. Of a capture only
poses.json is read; `yoto subject poses --refined` writes one with refined poses.

Examples:
  yoto export duo --subject ada --capture captures/ada --out ada.html
  yoto export duo --subject ada --capture captures/ada --capture captures/bob --out ada.html
  yoto export duo --subject ada --motion-file walk.bvh --motion-file jump.npz --out ada.glb
  yoto export duo --subject ada --out ada.ply
  yoto export duo --subject ada --capture captures/ada --out ada.glb
  yoto export duo --subject ada --capture captures/ada --frame 30 --out ada.obj
  yoto export checkpoints/000000002000 --slot 1 --capture captures/bob --frame 30 --out bob.ply";

/// Most poses whose mean light a texture has.
const LIGHT_POSES: usize = 50;

/// Write one person of a trained model to a file that other programs play.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct Export {
    #[command(flatten)]
    person: PersonArgs,
    /// Folder of a capture whose motion the person takes; may be given several times.
    #[arg(long = "capture", value_name = "DIR")]
    captures: Vec<PathBuf>,
    /// Motion file that the person takes, after those of captures: BVH, AMASS-style .npz, or a pose track
    /// (.json, .pb); may be given several times. `yoto motion` shows what is in it.
    #[arg(long = "motion-file", value_name = "FILE")]
    motion_files: Vec<PathBuf>,
    #[command(flatten)]
    reading: MotionArgs,
    /// Frames of motion files, e.g. 0..240:4 for every fourth [default: all].
    #[arg(long, value_name = "A..B:STEP", requires = "motion_files")]
    range: Option<FrameRange>,
    /// Number of the frame of the capture or motion file whose pose a file without motion has.
    #[arg(long, value_name = "N")]
    frame: Option<u32>,
    /// File to write: .html, .ply, .spz, .glb or .obj.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// What a .glb or .ply has [default: mesh for .glb, splats for .ply].
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// Most triangles of a mesh [default: 20000].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    triangles: Option<u32>,
    /// Pixels along a side of a mesh's texture [default: 1024].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(64..=8192))]
    texture: Option<u32>,
    /// Write over a file that is there already.
    #[arg(long)]
    force: bool,
}

impl Export {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        let form = self.form()?;
        for file in self.files(form) {
            ensure!(
                self.force || !file.exists(),
                "{} is there already: choose another file (--out), or write over it (--force)",
                file.display()
            );
        }
        let motions = self.motions()?;
        let frame = self.chosen_frame(&motions)?;
        let chosen = self.person.fetch().await?;
        let person = trained::person(chosen.folder(), chosen.slot, &chosen.model)?;
        let still = frame.map(|(motion, at)| motion.pose(at, &person.skeleton));
        let still = still.transpose()?;
        let said = match form {
            Form::Page => self.page(&person, &chosen.name, &motions)?,
            Form::Splats(file) => self.splats(&person, file, still)?,
            Form::Mesh(file) => self.mesh(&person, &chosen.name, file, &motions, still)?,
        };
        let bytes = std::fs::metadata(&self.out)
            .with_context(|| format!("reading {}", self.out.display()))?
            .len();
        say!("{}: {said}, {bytes} bytes", self.out.display());
        output::put("files", output::paths(&self.files(form)));
        output::put("bytes", bytes);
        Ok(())
    }

    /// The files to write: an .obj has its material and its texture beside it.
    fn files(&self, form: Form) -> Vec<PathBuf> {
        let mut files = vec![self.out.clone()];
        if form == Form::Mesh(MeshFile::Obj) {
            files.extend(["mtl", "png"].map(|it| self.out.with_extension(it)));
        }
        files
    }

    /// Checks the file's name and the options that belong to it before anything is fetched.
    fn form(&self) -> anyhow::Result<Form> {
        let form = Form::of(&self.out, self.format)?;
        if form.is_still() {
            ensure!(
                (self.captures.is_empty() && self.motion_files.is_empty()) || self.frame.is_some(),
                "{} has one pose: choose one of the motion's with --frame",
                self.out.display()
            );
        } else {
            ensure!(
                self.frame.is_none(),
                "--frame belongs to files of one pose: pages and .glb meshes play all frames"
            );
        }
        ensure!(
            matches!(form, Form::Mesh(_)) || (self.triangles.is_none() && self.texture.is_none()),
            "--triangles and --texture belong to a mesh"
        );
        ensure!(
            !self.motion_files.is_empty() || !self.reading.any(),
            "--joint-map and --up belong to --motion-file"
        );
        Ok(form)
    }

    /// The motions of captures and files, before anything is fetched.
    fn motions(&self) -> anyhow::Result<Vec<Source>> {
        let range = self.range.unwrap_or(FrameRange::ALL);
        let range = [range.first, range.end, range.step].map(|it| it as usize);
        let captures = self.captures.iter().map(|dir| Source::capture(dir));
        let files = self.motion_files.iter();
        let files = files.map(|file| Source::file(file, &self.reading.read(file)?, range));
        captures.chain(files).collect()
    }

    /// The motion and the place in it of `--frame`, found before anything is fetched.
    fn chosen_frame<'a>(
        &self,
        motions: &'a [Source],
    ) -> anyhow::Result<Option<(&'a Source, usize)>> {
        let Some(number) = self.frame else {
            return Ok(None);
        };
        let [motion] = motions else {
            bail!("--frame needs one --capture or one --motion-file");
        };
        Ok(Some((motion, motion.find(number)?)))
    }

    /// Writes a page, and says what is in it.
    fn page(
        &self,
        person: &SkinnedSplats,
        title: &str,
        motions: &[Source],
    ) -> anyhow::Result<String> {
        let clips = clips(motions, &person.skeleton)?;
        let page = page::page(title, person, &clips).context("the motions")?;
        self.write(page.as_bytes())?;
        Ok(splats(person.splats.len()))
    }

    /// Writes one pose of the person, standing where their body does at rest, and says what is in it.
    fn splats(
        &self,
        person: &SkinnedSplats,
        file: SplatFile,
        still: Option<Pose>,
    ) -> anyhow::Result<String> {
        let skeleton = &person.skeleton;
        let pose = still.unwrap_or_else(|| Pose::rest(skeleton.joints()));
        let to_rest = inverse(&skeleton.body_to_world(&pose));
        let gaussians = gaussians::posed(person, &pose, &to_rest)?;
        let mut bytes = Vec::new();
        match file {
            SplatFile::Ply => splats::ply::write(&mut bytes, &gaussians),
            SplatFile::Spz => splats::spz::write(&mut bytes, &gaussians),
            SplatFile::Glb => splats::glb::write(&mut bytes, &gaussians),
        }
        .context("the splats")?;
        self.write(&bytes)?;
        Ok(splats(gaussians.len()))
    }

    /// Writes a mesh, and says what is in it.
    fn mesh(
        &self,
        person: &SkinnedSplats,
        title: &str,
        file: MeshFile,
        motions: &[Source],
        still: Option<Pose>,
    ) -> anyhow::Result<String> {
        let skeleton = &person.skeleton;
        let clips = match still {
            Some(_) => Vec::new(),
            None => clips(motions, skeleton)?,
        };
        let standard = MeshOptions::default();
        let options = MeshOptions {
            triangles: self.triangles.map_or(standard.triangles, |n| n as usize),
            texture: self.texture.unwrap_or(standard.texture),
        };
        let all = || clips.iter().flat_map(|clip| &clip.poses);
        let every = all().count().div_ceil(LIGHT_POSES).max(1);
        let poses = all().step_by(every).chain(&still).cloned();
        let poses: Vec<Pose> = poses.collect();
        let mut mesh = mesh::mesh(person, &poses, &options).context("the surface of the person")?;
        if let Some(pose) = &still {
            let to_rest = inverse(&skeleton.body_to_world(pose));
            mesh = mesh::still::posed(&mesh, skeleton, pose, &to_rest)?;
        }
        let mut bytes = Vec::new();
        match file {
            MeshFile::Glb => mesh::glb::write(&mut bytes, title, &mesh, skeleton, &clips)?,
            MeshFile::Ply => mesh::ply::write(&mut bytes, &mesh)?,
            MeshFile::Obj => {
                let stem = self.out.file_stem().and_then(|stem| stem.to_str());
                let stem = stem.with_context(|| format!("{}: not a name", self.out.display()))?;
                let files = mesh::obj::files(&mesh, stem).context("the texture")?;
                self.write_to(&self.out.with_extension("mtl"), files.mtl.as_bytes())?;
                self.write_to(&self.out.with_extension("png"), &files.texture)?;
                bytes = files.obj.into_bytes();
            }
        }
        self.write(&bytes)?;
        let triangles = mesh.triangles.len();
        output::put("triangles", triangles);
        Ok(format!(
            "{}, texture {} x {}",
            count(triangles, "triangle"),
            mesh.side,
            mesh.side
        ))
    }

    fn write(&self, bytes: &[u8]) -> anyhow::Result<()> {
        self.write_to(&self.out, bytes)
    }

    /// Writes a file whole or not at all.
    fn write_to(&self, out: &Path, bytes: &[u8]) -> anyhow::Result<()> {
        let writing = || format!("writing {}", out.display());
        let folder = folder_of(out);
        std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
        let mut part = NamedTempFile::new_in(folder).with_context(writing)?;
        part.write_all(bytes).with_context(writing)?;
        keep(part, out).with_context(writing)
    }
}

/// "12 splats", which are also told to programs.
fn splats(number: usize) -> String {
    output::put("splats", number);
    count(number, "splat")
}
