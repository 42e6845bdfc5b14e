//! The scene file, as users write it.

use crate::args::frame_range::FrameRange;
use crate::scene::camera::{FileCamera, FileTurntable, one_path};
use anyhow::Context;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// People in one picture or film, with mutual occlusion.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneFile {
    /// Width and height of the pictures, pixels. Matrices of a camera have their own.
    #[serde(default = "default_size")]
    pub size: [u32; 2],
    /// Length of the film; left out: until the last motion ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// Frames per second; left out: the rate of the first actor who moves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fps: Option<f32>,
    /// Pictures of the film that are rendered, counted from 0, e.g. "50..100" or "..:5" for every fifth; left out: all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<String>,
    /// Quality, as of `yoto render --quality`: full, balanced, fast, draft or realtime; left out: the model's own
    /// settings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quality: Option<String>,
    /// Red, green and blue from 0 to 1; left out: black.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub background: Option<[f32; 3]>,
    /// Picture behind everybody (PNG or JPEG), relative to the scene file, in place of a colour: scaled to
    /// cover the pictures, and cropped at their edges.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub backdrop: Option<PathBuf>,
    /// Whether people darken the ground below them.
    #[serde(default, skip_serializing_if = "is_false")]
    pub shadow: bool,
    /// Whether the background of the pictures is transparent.
    #[serde(default, skip_serializing_if = "is_false")]
    pub transparent: bool,
    /// The people.
    pub actors: Vec<FileActor>,
    /// The camera's path.
    #[serde(default, deserialize_with = "one_path")]
    pub camera: FileCamera,
}

/// A person of a scene.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FileActor {
    /// Name of the person.
    pub subject: String,
    /// Name of a model that has the person; left out: the model that the command names.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// How they move; left out: as in their own capture.
    #[serde(default)]
    pub motion: FileMotion,
    /// Position on the ground at the beginning of the motion: to the right and towards the default
    /// camera, metres.
    #[serde(default)]
    pub at: Placed,
    /// Facing at the beginning of the motion, degrees: 0 towards the default camera, 90 to the person's
    /// left.
    #[serde(default)]
    pub heading: f64,
    /// Seconds until the motion begins.
    #[serde(default)]
    pub start: f64,
    /// Speed of the motion: 2 is twice as fast.
    #[serde(default = "one")]
    pub speed: f64,
    /// Whether the motion begins again when it has ended.
    #[serde(default)]
    pub repeat: bool,
    /// Light on the person; left out: the light of their own capture. Only models of splats have a light.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light: Option<FileLight>,
}

/// A position on the ground.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
pub(crate) struct Placed(pub [f64; 2]);

/// A motion: of a capture or of a file.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FileMotion {
    /// Person whose capture has the motion; left out: the actor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub capture: Option<String>,
    /// Motion file (BVH, AMASS-style .npz, or a pose track), relative to the scene file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// A single frame: the actor stands still.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<u32>,
    /// Range of frame numbers of the motion (a file's count from 0), with an optional step over the stored frames,
    /// e.g. "0..60:2"; left out: all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<String>,
}

/// Light on a person.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum FileLight {
    /// Colours without light and shade.
    None,
    /// The light of the capture of this person, who must be in the actor's model.
    Of(String),
}

impl FileActor {
    /// An actor with the motion of their own capture.
    pub(crate) fn of(subject: String) -> Self {
        Self {
            subject,
            model: None,
            motion: FileMotion::default(),
            at: Placed::default(),
            heading: 0.0,
            start: 0.0,
            speed: one(),
            repeat: false,
            light: None,
        }
    }
}

impl SceneFile {
    /// One person who moves as in their capture, in square pictures of `size` pixels; the camera goes around
    /// them once.
    pub(crate) fn turntable(subject: String, size: u32) -> Self {
        let mut scene = Self::of(vec![FileActor::of(subject)]);
        scene.size = [size; 2];
        scene.camera = FileCamera::Turntable(FileTurntable::default());
        scene
    }

    /// A scene of `actors` with default values.
    pub(crate) fn of(actors: Vec<FileActor>) -> Self {
        Self {
            size: default_size(),
            seconds: None,
            fps: None,
            range: None,
            quality: None,
            background: None,
            backdrop: None,
            shadow: false,
            transparent: false,
            actors,
            camera: FileCamera::default(),
        }
    }

    /// Reads a scene file.
    ///
    /// # Errors
    /// If it can't be read, with the path of the value that is wrong.
    pub(crate) fn read(path: &Path) -> anyhow::Result<Self> {
        let json = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
        let reader = &mut serde_json::Deserializer::from_slice(&json);
        serde_path_to_error::deserialize(reader)
            .map_err(|error| anyhow::anyhow!("{}: {error}", path.display()))
    }

    /// The people that the scene names, once each.
    pub(crate) fn people(&self) -> Vec<&str> {
        let mut people: Vec<&str> = Vec::new();
        for actor in &self.actors {
            let light = match &actor.light {
                Some(FileLight::Of(name)) => Some(name),
                Some(FileLight::None) | None => None,
            };
            let named = [Some(&actor.subject), actor.motion.capture.as_ref(), light];
            people.extend(named.into_iter().flatten().map(String::as_str));
        }
        people.sort_unstable();
        people.dedup();
        people
    }

    /// The models that actors name, once each, with the field that names it first.
    pub(crate) fn models(&self) -> Vec<(String, &str)> {
        let mut models: Vec<(String, &str)> = Vec::new();
        for (i, actor) in self.actors.iter().enumerate() {
            if let Some(model) = actor.model.as_deref()
                && models.iter().all(|(_, known)| *known != model)
            {
                models.push((format!("actors[{i}].model"), model));
            }
        }
        models
    }
}

impl FileMotion {
    /// The frames of the motion.
    pub(crate) fn frames(&self) -> Result<FrameRange, String> {
        match (self.frame, &self.range) {
            (Some(_), Some(_)) => Err("either a frame or a range".into()),
            (Some(frame), None) => Ok(FrameRange {
                first: frame,
                end: frame.saturating_add(1),
                step: 1,
            }),
            (None, Some(range)) => range.parse(),
            (None, None) => Ok(FrameRange::ALL),
        }
    }
}

fn default_size() -> [u32; 2] {
    [512, 512]
}

fn one() -> f64 {
    1.0
}

fn is_false(value: &bool) -> bool {
    !value
}
