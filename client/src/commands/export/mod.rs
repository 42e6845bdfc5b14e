//! `yoto export`: one person of a trained model in a file that other programs play.

mod form;

use super::Server;
use super::whole_file::{folder_of, keep};
use crate::api::YotoClient;
use crate::output;
use crate::progress::count;
use crate::studio::clips::{ChosenFrame, clip, read_track, tell_apart};
use crate::studio::trained;
use anyhow::{Context, bail, ensure};
use clap::Args;
use form::{Form, Format, MeshFile, SplatFile};
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::{NamedTempFile, TempDir};
use yoto_avatar::render::SkinnedSplats;
use yoto_capture::skeleton::Pose;
use yoto_capture::skeleton::transform::inverse;
use yoto_export::clip::Clip;
use yoto_export::mesh::{self, MeshOptions};
use yoto_export::{gaussians, page};
use yoto_formats::splats;
use yoto_proto::pose_track::PoseTrack;

const AFTER_HELP: &str = "\
The name of the file says its form:
  .html  a page that plays the person in any browser with WebGL2, in one file: drag to
         turn, play the captures' motions, bend joints
  .ply   Gaussian splats of one pose (the rest pose, or --frame of a capture), for
         viewers of 3D Gaussian splatting; no motion
  .spz   the same in a twelfth of the bytes
  .glb   a mesh with a texture and bones, which plays the captures' motions in programs
         that read glTF; with --format splats, the splats of one pose
  .obj   the mesh in one pose, with a material (.mtl) and a texture (.png) beside it;
         with --format mesh, a .ply is the mesh with a colour per vertex
The model has the tier splat; other tiers have no splats to export. Of a capture only
poses.json is read; `yoto subject poses --refined` writes one with refined poses.

Examples:
  yoto export duo --subject ada --capture captures/ada --out ada.html
  yoto export duo --subject ada --capture captures/ada --capture captures/bob --out ada.html
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
    /// A model of the service, by name, or the folder of a checkpoint.
    #[arg(value_name = "MODEL|DIR")]
    model: String,
    /// The person, by name, in a model of the service.
    #[arg(long, value_name = "NAME", conflicts_with = "slot")]
    subject: Option<String>,
    /// Identity slot in the folder of a checkpoint [default: 0].
    #[arg(long, value_name = "N")]
    slot: Option<usize>,
    /// Step of the checkpoint, in a model of the service [default: the best one by held-out PSNR].
    #[arg(long, value_name = "STEP")]
    checkpoint: Option<u64>,
    /// Folder of a capture whose motion the person takes; may be given several times.
    #[arg(long = "capture", value_name = "DIR")]
    captures: Vec<PathBuf>,
    /// Number of the frame of the capture whose pose a file without motion has.
    #[arg(long, value_name = "N", requires = "captures")]
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
    #[command(flatten)]
    server: Server,
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
        let tracks: Vec<PoseTrack> = self
            .captures
            .iter()
            .map(|dir| read_track(dir))
            .collect::<anyhow::Result<_>>()?;
        let frame = self.chosen_frame(&tracks)?;
        let folder = PathBuf::from(&self.model);
        let (person, title) = if folder.is_dir() {
            ensure!(
                self.subject.is_none() && self.checkpoint.is_none(),
                "{} is a folder: --subject and --checkpoint belong to a model of the service; --slot \
                 chooses the person",
                self.model
            );
            let slot = self.slot.unwrap_or(0);
            (
                trained::person(&folder, slot, &self.model)?,
                format!("slot {slot}"),
            )
        } else {
            ensure!(
                self.slot.is_none(),
                "--slot belongs to the folder of a checkpoint: --subject chooses the person of a model of \
                 the service"
            );
            let subject = self
                .subject
                .as_deref()
                .context("--subject is needed: the person, by name")?;
            let client = self.server.connect().await?;
            let (files, slot, title) = self.fetch(&client, subject).await?;
            (trained::person(files.path(), slot, &self.model)?, title)
        };
        let said = match form {
            Form::Page => self.page(&person, &title, &tracks)?,
            Form::Splats(file) => self.splats(&person, file, frame.as_ref())?,
            Form::Mesh(file) => self.mesh(&person, &title, file, &tracks, frame.as_ref())?,
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
                self.captures.is_empty() || self.frame.is_some(),
                "{} has one pose: choose one of the capture's with --frame",
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
        Ok(form)
    }

    /// The frame of `--frame`, found before anything is fetched.
    fn chosen_frame<'a>(
        &'a self,
        tracks: &'a [PoseTrack],
    ) -> anyhow::Result<Option<ChosenFrame<'a>>> {
        let Some(number) = self.frame else {
            return Ok(None);
        };
        let ([dir], [track]) = (self.captures.as_slice(), tracks) else {
            bail!("--frame needs one --capture");
        };
        let frame = track.frames.iter().find(|frame| frame.index == number);
        let frame = frame.with_context(|| {
            format!(
                "{}: no frame {number} among its {}",
                dir.display(),
                track.frames.len()
            )
        })?;
        Ok(Some(ChosenFrame { dir, track, frame }))
    }

    /// The checkpoint's files, and the slot and the name of `subject`.
    async fn fetch(
        &self,
        client: &YotoClient,
        subject: &str,
    ) -> anyhow::Result<(TempDir, usize, String)> {
        let model = client.find_model(&self.model).await?;
        let found = client.find_subject(subject).await?;
        let slot = model.slots.iter().find(|slot| slot.subject == found.name);
        let slot = slot.with_context(|| format!("{} has no slot for {subject}", self.model))?;
        let files = trained::fetch(client, &model, self.checkpoint).await?;
        Ok((files, slot.slot as usize, found.display_name))
    }

    /// Writes a page, and says what is in it.
    fn page(
        &self,
        person: &SkinnedSplats,
        title: &str,
        tracks: &[PoseTrack],
    ) -> anyhow::Result<String> {
        let clips = self.clips(person, tracks)?;
        let page = page::page(title, person, &clips).context("the motion of a capture")?;
        self.write(page.as_bytes())?;
        Ok(splats(person.splats.len()))
    }

    /// Writes one pose of the person, standing where their body does at rest, and says what is in it.
    fn splats(
        &self,
        person: &SkinnedSplats,
        file: SplatFile,
        frame: Option<&ChosenFrame<'_>>,
    ) -> anyhow::Result<String> {
        let skeleton = &person.skeleton;
        let pose = match frame {
            Some(chosen) => chosen.pose(skeleton)?,
            None => Pose::rest(skeleton.joints()),
        };
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
        tracks: &[PoseTrack],
        frame: Option<&ChosenFrame<'_>>,
    ) -> anyhow::Result<String> {
        let skeleton = &person.skeleton;
        let still = frame.map(|chosen| chosen.pose(skeleton)).transpose()?;
        let clips = match still {
            Some(_) => Vec::new(),
            None => self.clips(person, tracks)?,
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

    /// The motions of the captures on the person's body.
    fn clips(&self, person: &SkinnedSplats, tracks: &[PoseTrack]) -> anyhow::Result<Vec<Clip>> {
        let captures = self.captures.iter().zip(tracks);
        let mut clips = captures
            .map(|(dir, track)| clip(dir, track, &person.skeleton))
            .collect::<anyhow::Result<Vec<Clip>>>()?;
        tell_apart(&mut clips);
        Ok(clips)
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
