//! `yoto export`: one person of a trained model in a file that other programs play.

use super::Server;
use super::model_export::best_checkpoint;
use crate::api::{ClientError, YotoClient};
use crate::output;
use crate::progress::count;
use anyhow::{Context, bail, ensure};
use clap::Args;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use yoto_avatar::render::{Renderer, SkinnedSplats};
use yoto_capture::skeleton::transform::inverse;
use yoto_capture::skeleton::{Pose, Skeleton, retarget};
use yoto_export::clip::Clip;
use yoto_export::{gaussians, page};
use yoto_formats::splat_ply;
use yoto_proto::names;
use yoto_proto::pose_track::{self, PoseTrack};

const AFTER_HELP: &str = "\
The name of the file says its form:
  .html  a page that plays the person in any browser with WebGL2, in one file: drag to
         turn, play the captures' motions, bend joints
  .ply   Gaussian splats of one pose (the rest pose, or --frame of a capture), for
         viewers of 3D Gaussian splatting; no motion
The model has the tier splat; other tiers have no splats to export. Of a capture only
poses.json is read; `yoto subject poses --refined` writes one with refined poses.

Examples:
  yoto export duo --subject ada --capture captures/ada --out ada.html
  yoto export duo --subject ada --capture captures/ada --capture captures/bob --out ada.html
  yoto export duo --subject ada --out ada.ply
  yoto export checkpoints/000000002000 --slot 1 --capture captures/bob --frame 30 --out bob.ply";

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
    /// Number of the frame of the capture whose pose a .ply has.
    #[arg(long, value_name = "N", requires = "captures")]
    frame: Option<u32>,
    /// File to write: .html or .ply.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Write over a file that is there already.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    server: Server,
}

/// What the file's name asks for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    Page,
    Ply,
}

impl Export {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        let form = self.form()?;
        ensure!(
            self.force || !self.out.exists(),
            "{} is there already: choose another file (--out), or write over it (--force)",
            self.out.display()
        );
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
            (person(&folder, slot, &self.model)?, format!("slot {slot}"))
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
            (person(files.path(), slot, &self.model)?, title)
        };
        match form {
            Form::Page => self.page(&person, &title, &tracks)?,
            Form::Ply => self.ply(&person, frame.as_ref())?,
        }
        let bytes = std::fs::metadata(&self.out)
            .with_context(|| format!("reading {}", self.out.display()))?
            .len();
        say!(
            "{}: {}, {bytes} bytes",
            self.out.display(),
            count(person.splats.len(), "splat")
        );
        output::put("files", output::paths(&[&self.out]));
        output::put("splats", person.splats.len());
        output::put("bytes", bytes);
        Ok(())
    }

    /// Checks the file's name and the options that belong to it before anything is fetched.
    fn form(&self) -> anyhow::Result<Form> {
        match self
            .out
            .extension()
            .and_then(|extension| extension.to_str())
        {
            Some("html") => {
                ensure!(
                    self.frame.is_none(),
                    "--frame belongs to .ply: a page plays all frames"
                );
                Ok(Form::Page)
            }
            Some("ply") => {
                ensure!(
                    self.captures.is_empty() || self.frame.is_some(),
                    "a .ply has one pose: choose one of the capture's with --frame"
                );
                Ok(Form::Ply)
            }
            _ => bail!("--out {}: neither .html nor .ply", self.out.display()),
        }
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
        let checkpoint = match self.checkpoint {
            Some(step) => names::checkpoint(&model.name, step),
            None => best_checkpoint(client, &model).await?,
        };
        let files = tempfile::tempdir().context("making a temporary folder")?;
        let objects = client.list_objects(&checkpoint).await?;
        client
            .fetch_objects(&objects, files.path(), &mut |_| ())
            .await?;
        Ok((files, slot.slot as usize, found.display_name))
    }

    fn page(
        &self,
        person: &SkinnedSplats,
        title: &str,
        tracks: &[PoseTrack],
    ) -> anyhow::Result<()> {
        let captures = self.captures.iter().zip(tracks);
        let mut clips = captures
            .map(|(dir, track)| clip(dir, track, &person.skeleton))
            .collect::<anyhow::Result<Vec<Clip>>>()?;
        tell_apart(&mut clips);
        let page = page::page(title, person, &clips).context("the motion of a capture")?;
        self.write(page.as_bytes())
    }

    /// Writes one pose of the person, standing where their body does at rest.
    fn ply(&self, person: &SkinnedSplats, frame: Option<&ChosenFrame<'_>>) -> anyhow::Result<()> {
        let skeleton = &person.skeleton;
        let pose = match frame {
            Some(chosen) => moved(
                chosen.dir,
                &driver(chosen.dir, chosen.track)?,
                skeleton,
                chosen.frame,
            )?,
            None => Pose::rest(skeleton.joints()),
        };
        let to_rest = inverse(&skeleton.body_to_world(&pose));
        let splats = gaussians::posed(person, &pose, &to_rest)?;
        let mut bytes = Vec::new();
        splat_ply::write(&mut bytes, &splats).context("the splats")?;
        self.write(&bytes)
    }

    /// Writes the file whole or not at all.
    fn write(&self, bytes: &[u8]) -> anyhow::Result<()> {
        let writing = || format!("writing {}", self.out.display());
        let folder = self
            .out
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
        let part = self.out.with_added_extension("part");
        std::fs::write(&part, bytes)
            .and_then(|()| std::fs::rename(&part, &self.out))
            .with_context(writing)?;
        Ok(())
    }
}

/// The person in `slot` of the model in a folder, which the user knows as `model`.
fn person(folder: &Path, slot: usize, model: &str) -> anyhow::Result<SkinnedSplats> {
    let reading = || format!("the model {model}");
    let device = yoto_device::pick().device;
    let renderer = Renderer::load(folder, &device).with_context(reading)?;
    let person = renderer.skinned_splats(slot).with_context(reading)?;
    let tier = &renderer.config().tier;
    person.with_context(|| {
        format!("the model's tier, {tier}, has no splats: train one with --tier splat")
    })
}

/// The pose track of a capture's folder.
fn read_track(dir: &Path) -> anyhow::Result<PoseTrack> {
    let path = dir.join(pose_track::FILE);
    let bytes = std::fs::read(&path).with_context(|| format!("reading {}", path.display()))?;
    PoseTrack::from_json(&bytes).map_err(|violations| {
        let place = dir.display().to_string();
        ClientError::BadCapture { place, violations }.into()
    })
}

/// The frame of a capture whose pose a file has.
struct ChosenFrame<'a> {
    dir: &'a Path,
    track: &'a PoseTrack,
    frame: &'a pose_track::Frame,
}

/// The skeleton that moves in the capture in `dir`.
fn driver(dir: &Path, track: &PoseTrack) -> anyhow::Result<Skeleton> {
    Skeleton::from_track(&track.skeleton).with_context(|| format!("{}: skeleton", dir.display()))
}

/// The pose of a frame of the capture in `dir`, on the body of `target`.
fn moved(
    dir: &Path,
    driver: &Skeleton,
    target: &Skeleton,
    frame: &pose_track::Frame,
) -> anyhow::Result<Pose> {
    let place = || format!("{}: frame {}", dir.display(), frame.index);
    let pose = Pose::from_frame(frame).with_context(place)?;
    retarget(driver, target, &pose).with_context(place)
}

/// Gives a number to each clip whose name an earlier one has.
fn tell_apart(clips: &mut [Clip]) {
    for place in 1..clips.len() {
        let (earlier, later) = clips.split_at_mut(place);
        let taken = |name: &str| earlier.iter().any(|clip| clip.name == name);
        let plain = later[0].name.clone();
        let mut number = 2;
        while taken(&later[0].name) {
            later[0].name = format!("{plain} ({number})");
            number += 1;
        }
    }
}

/// The motion of the capture in `dir` on the body of `target`.
fn clip(dir: &Path, track: &PoseTrack, target: &Skeleton) -> anyhow::Result<Clip> {
    let driver = driver(dir, track)?;
    let frames = track.frames.iter();
    let poses = frames.map(|frame| moved(dir, &driver, target, frame));
    let name = dir.file_name().unwrap_or(dir.as_os_str());
    Ok(Clip {
        name: name.to_string_lossy().into_owned(),
        fps: track.fps,
        poses: poses.collect::<anyhow::Result<_>>()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clips_of_one_name_are_numbered() {
        let named = |name: &str| Clip {
            name: name.into(),
            fps: 30.0,
            poses: Vec::new(),
        };
        let mut clips = ["walk", "run", "walk", "walk (2)", "walk"].map(named);
        tell_apart(&mut clips);
        let names = clips.map(|clip| clip.name);
        assert_eq!(
            names,
            ["walk", "run", "walk (2)", "walk (2) (2)", "walk (3)"]
        );
    }
}
