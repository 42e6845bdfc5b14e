//! The order of a render: what the service is asked to render, by the options.

use super::Render;
use super::views::read_views;
use crate::args::frame_range::FrameRange;
use crate::scene::{FileLight, Names, SceneFile};
use crate::show::note_capture_end;
use anyhow::Context;
use std::path::Path;
use yoto_client::YotoClient;
use yoto_proto::v1::render_quality::Want;
use yoto_proto::v1::{
    Between, Layer, Light, Model, MotionClip, MotionTransfer, Orbit, RenderQuality, RenderSpec,
    light, render_spec,
};
use yoto_terminal::progress::count;

/// Fastest animation of the service, frames per second.
pub(super) const MAX_FPS: f64 = 120.0;

impl Render {
    /// The order of these options: of the `scene` or the motion `clip` with its frame rate if there is one.
    pub(super) async fn spec(
        &self,
        client: &YotoClient,
        model: &Model,
        scene: Option<SceneFile>,
        (clip, fps): (Option<MotionClip>, f32),
        transparent: bool,
    ) -> anyhow::Result<RenderSpec> {
        let other = match &self.between {
            Some(it) => Some(Between {
                subject: client.find_subject(&it.other).await?.name,
                shares: it.shares(),
            }),
            None => None,
        };
        let bones = match &self.bones {
            Some(name) => client.find_subject(name).await?.name,
            None => String::new(),
        };
        let subject = match self.person() {
            // A turntable is a scene.
            Some(name) if scene.is_none() => client.find_subject(name).await?.name,
            _ => String::new(),
        };
        let checkpoint = self.checkpoint.as_ref().map(|it| it.of(&model.name));
        let mut spec = RenderSpec {
            checkpoint: checkpoint.unwrap_or_default(),
            bones,
            model: model.name.clone(),
            subject,
            what: None,
            background: self.background.clone(),
            animate: self.animate,
            fps: self.fps.unwrap_or(fps),
            quality: self.wish(scene.as_ref())?,
            transparent,
            light: match &scene {
                Some(_) => None,
                None => self.light(client).await?,
            },
            layer: self.layer().into(),
            compare: self.compare.is_some(),
            between: other,
        };
        spec.what = Some(match (scene, clip) {
            (Some(scene), _) => {
                spec.background = scene.background.map(Vec::from).unwrap_or_default();
                spec.fps = self.fps.or(scene.fps).unwrap_or_default();
                self.scene(client, &scene).await?
            }
            (None, Some(clip)) => render_spec::What::Clip(clip),
            (None, None) => self.what(client).await?,
        });
        Ok(spec)
    }

    /// The person to render, or the first of the two to mix.
    pub(super) fn person(&self) -> Option<&str> {
        let first = self.between.as_ref().map(|it| &*it.one);
        self.subject.as_deref().or(first)
    }

    fn layer(&self) -> Layer {
        match self.layer.as_deref() {
            Some("depth") => Layer::Depth,
            Some("opacity") => Layer::Opacity,
            _ => Layer::Unspecified,
        }
    }

    /// The scene of the options: from a file, or a turntable.
    pub(super) fn scene_file(&self) -> anyhow::Result<Option<SceneFile>> {
        let (true, Some(subject)) = (self.turntable, &self.subject) else {
            return self.scene.as_deref().map(SceneFile::read).transpose();
        };
        let mut scene = SceneFile::turntable(subject.clone(), self.size);
        scene.background = self.background.as_slice().try_into().ok();
        scene.actors[0].light = match self.light.as_str() {
            "own" => None,
            "none" => Some(FileLight::None),
            name => Some(FileLight::Of(name.into())),
        };
        Ok(Some(scene))
    }

    /// The light that is wanted instead of the person's own.
    async fn light(&self, client: &YotoClient) -> anyhow::Result<Option<Light>> {
        let of = match self.light.as_str() {
            "own" => return Ok(None),
            "none" => light::Of::Neutral(true),
            name => light::Of::Subject(client.find_subject(name).await.context("--light")?.name),
        };
        Ok(Some(Light { of: Some(of) }))
    }

    /// The scene of a file, with the people that the service knows.
    async fn scene(
        &self,
        client: &YotoClient,
        scene: &SceneFile,
    ) -> anyhow::Result<render_spec::What> {
        let path = self.scene.as_deref().unwrap_or(Path::new("--turntable"));
        let mut names = Names::default();
        for person in scene.people() {
            let subject = client.find_subject(person).await?;
            names.people.insert(person.to_owned(), subject.name);
        }
        for (field, model) in scene.models() {
            let context = || format!("{}: {field}", path.display());
            let found = client.find_model(model).await.with_context(context)?;
            names.models.insert(model.to_owned(), found.name);
        }
        let mut scene = scene.to_message(path, &names, &self.reading)?;
        if let Some(range) = self.frames {
            scene.pictures = Some(range.of_film());
        }
        Ok(render_spec::What::Scene(scene))
    }

    /// The requested quality, if any: of the options, or of the `scene`.
    fn wish(&self, scene: Option<&SceneFile>) -> anyhow::Result<Option<RenderQuality>> {
        let seconds = self.max_seconds_per_frame.map(Want::MaxSecondsPerFrame);
        let psnr = self.min_psnr.map(Want::MinPsnrDb);
        let tier = self.quality.clone().map(Want::Tier);
        match (seconds.or(psnr).or(tier), scene, &self.scene) {
            (None, Some(scene), Some(file)) => scene.wish(file),
            (want, ..) => Ok(want.map(|want| RenderQuality { want: Some(want) })),
        }
    }

    /// The motion of a file, and its frame rate; 0 is the service's default.
    pub(super) fn clip(&self) -> anyhow::Result<(Option<MotionClip>, f32)> {
        let Some(path) = &self.motion_file else {
            anyhow::ensure!(
                self.scene.is_some() || !self.reading.any(),
                "--joint-map and --up belong to --motion-file or --scene"
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
            let range = self.frames.unwrap_or(FrameRange::ALL);
            note_capture_end(client, &driver, range).await;
            let part = range.of_capture();
            let transfer = MotionTransfer {
                driver: driver.name,
                first_frame: part.first_frame,
                frame_count: part.frame_count,
                frame_step: part.frame_step,
                end_frame: part.end_frame,
                size: self.size,
                follow: self.follow,
            };
            return Ok(render_spec::What::Motion(transfer));
        }
        let path = self.view_list.as_deref().context(
            "nothing to render: give --orbit, --turntable, --motion, --motion-file, --view-list or --scene",
        )?;
        Ok(render_spec::What::Views(read_views(path)?))
    }
}
