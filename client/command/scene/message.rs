//! A scene file as the request that the service takes.

use crate::args::frame_range::FrameRange;
use crate::args::motion::MotionArgs;
use crate::args::render_tier;
use crate::scene::camera::FileCamera;
use crate::scene::file::{FileActor, FileLight, FileMotion, SceneFile};
use anyhow::{Context, anyhow, ensure};
use std::collections::HashMap;
use std::path::Path;
use yoto_proto::checks::scene::LARGEST_BACKDROP;
use yoto_proto::v1::actor::Motion;
use yoto_proto::v1::render_quality::Want;
use yoto_proto::v1::{
    Actor, CaptureMotion, Light, MotionClip, RenderQuality, Scene, SceneCamera, light,
};

/// Resource names of the people and the models that a scene names.
#[derive(Debug, Default)]
pub(crate) struct Names {
    pub people: HashMap<String, String>,
    pub models: HashMap<String, String>,
}

impl Names {
    fn person(&self, name: &String) -> anyhow::Result<String> {
        let known = self.people.get(name).cloned();
        known.ok_or_else(|| anyhow!("there is no person called '{name}'"))
    }

    /// Empty for none.
    fn model(&self, name: Option<&String>) -> anyhow::Result<String> {
        let Some(name) = name else {
            return Ok(String::new());
        };
        let known = self.models.get(name).cloned();
        known.ok_or_else(|| anyhow!("model: there is no model called '{name}'"))
    }
}

impl SceneFile {
    /// The scene, with resource names of `names` and motion files beside the scene's `file`.
    ///
    /// # Errors
    /// A value that makes no sense, or a motion file that can't be read.
    pub(crate) fn to_message(
        &self,
        file: &Path,
        names: &Names,
        reading: &MotionArgs,
    ) -> anyhow::Result<Scene> {
        let in_file = |field: &str| format!("{}: {field}", file.display());
        let folder = file.parent().unwrap_or(Path::new(""));
        let actors = self.actors.iter().enumerate().map(|(i, actor)| {
            let message = to_actor(actor, folder, names, reading);
            message.with_context(|| in_file(&format!("actors[{i}]")))
        });
        let backdrop = match &self.backdrop {
            Some(picture) => read_backdrop(file, picture).with_context(|| in_file("backdrop"))?,
            None => Vec::new(),
        };
        let range = self.range.as_deref().map(str::parse::<FrameRange>);
        let range = range
            .transpose()
            .map_err(|message| anyhow!("{}: {message}", in_file("range")))?;
        let matrices = matches!(self.camera, FileCamera::Matrices(_));
        let [width, height] = if matrices { [0, 0] } else { self.size };
        Ok(Scene {
            actors: actors.collect::<anyhow::Result<_>>()?,
            camera: Some(SceneCamera {
                path: Some(self.path(folder).with_context(|| in_file("camera"))?),
            }),
            width,
            height,
            seconds: self.seconds.unwrap_or_default(),
            backdrop,
            shadow: self.shadow,
            pictures: range.map(FrameRange::of_film),
        })
    }

    /// The quality that the scene in `file` asks for.
    ///
    /// # Errors
    /// A quality that is not known.
    pub(crate) fn wish(&self, file: &Path) -> anyhow::Result<Option<RenderQuality>> {
        let Some(quality) = &self.quality else {
            return Ok(None);
        };
        let tier = render_tier(quality)
            .map_err(|message| anyhow!("{}: quality '{quality}': {message}", file.display()))?;
        Ok(Some(RenderQuality {
            want: Some(Want::Tier(tier)),
        }))
    }
}

/// The bytes of the `picture` beside the scene's `file`.
fn read_backdrop(file: &Path, picture: &Path) -> anyhow::Result<Vec<u8>> {
    let path = file.parent().unwrap_or(Path::new("")).join(picture);
    let bytes = std::fs::read(&path).with_context(|| format!("reading {}", path.display()))?;
    let large = bytes.len();
    ensure!(
        large <= LARGEST_BACKDROP,
        "{} has {large} bytes: at most {LARGEST_BACKDROP} are allowed",
        path.display()
    );
    Ok(bytes)
}

fn to_actor(
    actor: &FileActor,
    folder: &Path,
    names: &Names,
    reading: &MotionArgs,
) -> anyhow::Result<Actor> {
    let named = |name: &String| names.person(name);
    ensure!(actor.speed > 0.0, "speed: {} is not above 0", actor.speed);
    let motion = &actor.motion;
    let frames = motion.frames();
    let frames = frames.map_err(|message| anyhow!("motion: {message}"))?;
    let part = frames.of_capture();
    let motion = match (&motion.capture, &motion.file) {
        (Some(_), Some(_)) => anyhow::bail!("motion: either a capture or a file"),
        (None, Some(_)) => Motion::Clip(to_clip(motion, frames, folder, reading)?),
        (driver, None) => Motion::Capture(CaptureMotion {
            driver: driver.as_ref().map(named).transpose()?.unwrap_or_default(),
            // A frame is that of its number also if it is 0.
            first_frame: motion.frame.or(part.first_frame),
            ..part
        }),
    };
    let light = match &actor.light {
        None => None,
        Some(FileLight::None) => Some(light::Of::Neutral(true)),
        Some(FileLight::Of(name)) => Some(light::Of::Subject(named(name)?)),
    };
    Ok(Actor {
        subject: named(&actor.subject)?,
        motion: Some(motion),
        at: actor.at.0.to_vec(),
        heading: actor.heading,
        start: actor.start,
        speed: actor.speed,
        repeat: actor.repeat,
        light: light.map(|of| Light { of: Some(of) }),
        model: names.model(actor.model.as_ref())?,
    })
}

fn to_clip(
    motion: &FileMotion,
    frames: FrameRange,
    folder: &Path,
    reading: &MotionArgs,
) -> anyhow::Result<MotionClip> {
    let path = folder.join(motion.file.as_deref().unwrap_or(Path::new("")));
    let motion = reading.read(&path).context("motion.file")?;
    let [first, end, step] = [frames.first, frames.end, frames.step].map(|it| it as usize);
    let clip = motion.clip(first, end, step, 0);
    let count = motion.frames.len();
    ensure!(
        !clip.poses.is_empty(),
        "motion: {} has {count} frames, none of them chosen",
        path.display()
    );
    Ok(clip)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::example;
    use yoto_proto::v1::FilmRange;

    const SCENE: &str = r#"{
        "size": [640, 360], "seconds": 4, "fps": 25, "range": "10..20:3", "quality": "fast", "background": [1, 1, 1],
        "actors": [
            {"subject": "ada", "motion": {"capture": "bob", "range": "4..20:2"}, "at": [-0.5, 1],
             "heading": 30, "start": 0.5, "speed": 2, "repeat": true, "light": {"of": "bob"}},
            {"subject": "bob", "model": "fog", "motion": {"frame": 7}, "light": "none"}
        ],
        "camera": {"keys": [{"seconds": 0, "eye": [0, 1, 4], "target": [0, 1, 0]}]}
    }"#;

    fn names() -> Names {
        Names {
            people: ["ada", "bob"]
                .map(|it| (it.to_owned(), format!("subjects/{it}")))
                .into(),
            models: [("fog".to_owned(), "models/fog".to_owned())].into(),
        }
    }

    fn read(json: &str) -> anyhow::Result<Scene> {
        let dir = tempfile::tempdir()?;
        let path = dir.path().join("scene.json");
        std::fs::write(&path, json)?;
        let scene = SceneFile::read(&path)?;
        scene.wish(&path)?;
        scene.to_message(&path, &names(), &MotionArgs::none())
    }

    #[test]
    fn a_file_says_everything_that_a_request_takes() {
        let scene = read(SCENE).expect("reads");
        assert_eq!((scene.width, scene.height, scene.seconds), (640, 360, 4.0));
        let pictures = FilmRange {
            first: 10,
            count: 4,
            step: 3,
        };
        assert_eq!(scene.pictures, Some(pictures));
        let [ada, bob] = scene.actors.as_slice() else {
            panic!("two actors");
        };
        assert_eq!((ada.subject.as_str(), ada.heading), ("subjects/ada", 30.0));
        assert_eq!((ada.start, ada.speed, ada.repeat), (0.5, 2.0, true));
        assert_eq!(ada.at, [-0.5, 1.0]);
        let motion = CaptureMotion {
            driver: "subjects/bob".into(),
            first_frame: Some(4),
            frame_count: 8,
            frame_step: 2,
            end_frame: Some(20),
        };
        assert_eq!(ada.motion, Some(Motion::Capture(motion)));
        let light = |actor: &Actor| actor.light.clone().and_then(|light| light.of);
        let bob_s = light::Of::Subject("subjects/bob".into());
        assert_eq!(light(ada), Some(bob_s));
        let still = CaptureMotion {
            driver: String::new(),
            first_frame: Some(7),
            frame_count: 1,
            frame_step: 1,
            end_frame: Some(8),
        };
        assert_eq!(bob.motion, Some(Motion::Capture(still)));
        assert_eq!(light(bob), Some(light::Of::Neutral(true)));
        assert_eq!([&*ada.model, &*bob.model], ["", "models/fog"]);
        assert_eq!(yoto_proto::checks::scene::faults(&scene), []);
    }

    #[test]
    fn each_model_is_asked_for_once() {
        let mut scene = example(["ada", "bob", "eve", "ian"].map(String::from).into());
        for (actor, model) in
            scene
                .actors
                .iter_mut()
                .zip([None, Some("fog"), Some("fog"), Some("ice")])
        {
            actor.model = model.map(str::to_owned);
        }
        let models = [
            ("actors[1].model".to_owned(), "fog"),
            ("actors[3].model".to_owned(), "ice"),
        ];
        assert_eq!(scene.models(), models);
    }

    #[test]
    fn the_example_is_a_good_scene() {
        let json = serde_json::to_string(&example(vec!["ada".into(), "bob".into()]));
        let scene = read(&json.expect("writes")).expect("reads");
        assert_eq!(yoto_proto::checks::scene::faults(&scene), []);
        assert_eq!(scene.actors[1].at, [0.6, 0.0]);
    }

    #[test]
    fn the_schema_knows_every_field_of_a_scene() {
        let schema = serde_json::to_string(&schemars::schema_for!(SceneFile)).expect("writes");
        let fields = "size seconds fps range quality background backdrop shadow transparent actors camera subject model motion at heading \
             start speed repeat light capture file frame range none of orbit turntable keys dolly matrices \
             held_out azimuth elevation sweep distance fov eye target from to K E image_size folder";
        for field in fields.split(' ') {
            assert!(schema.contains(&format!("\"{field}\"")), "{field}");
        }
    }

    #[test]
    fn what_is_wrong_is_named_by_its_place() {
        let cases = [
            (
                SCENE.replace("\"heading\"", "\"haeding\""),
                "actors[0].haeding",
            ),
            (
                SCENE.replace("\"seconds\": 4", "\"seconds\": \"4\""),
                "seconds",
            ),
            (SCENE.replace("\"4..20:2\"", "\"4..2\""), "actors[0]"),
            (SCENE.replace("\"10..20:3\"", "\"10-20\""), "range: '10-20'"),
            (SCENE.replace("\"fast\"", "\"paper\""), "quality 'paper'"),
            (
                SCENE.replace("\"keys\"", "\"capture\": 0, \"keys\""),
                "camera: 2 paths, capture, keys",
            ),
            (SCENE.replace("\"ada\"", "\"eve\""), "actors[0]"),
            (SCENE.replace("\"fog\"", "\"ice\""), "actors[1]: model"),
            (SCENE.replace("\"speed\": 2", "\"speed\": 0"), "speed"),
            (
                SCENE.replace("\"frame\": 7", "\"file\": \"walk.xyz\""),
                "motion.file",
            ),
            (
                SCENE.replace("\"frame\": 7", "\"frame\": 7, \"range\": \"1..2\""),
                "either a frame or a range",
            ),
        ];
        for (json, expected) in cases {
            let error = read(&json).expect_err(expected);
            assert!(format!("{error:#}").contains(expected), "{error:#}");
        }
    }
}
