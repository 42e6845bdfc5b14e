//! The camera of a scene file, as users write it.

use schemars::JsonSchema;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use std::path::PathBuf;

/// The path of the camera: one of these.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum FileCamera {
    /// Around the middle of all motions.
    Orbit(FileOrbit),
    /// Once around everybody during the film.
    Turntable(FileTurntable),
    /// From key to key in straight lines.
    Keys(Vec<FileKey>),
    /// In a straight line, with the same point in the middle of the picture.
    Dolly(FileDolly),
    /// Matrices: one camera for all pictures, or one per picture of the film.
    Matrices(Vec<FileMatrices>),
    /// The camera that filmed the motion of an actor, by the actor's index, from 0.
    Capture(u32),
    /// Another camera that filmed the motion of an actor.
    HeldOut(FileHeldOut),
}

/// A camera around the middle of all motions, which shows everybody.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct FileOrbit {
    /// Angle to the right of the front at the beginning, degrees.
    pub azimuth: f64,
    /// Angle above the ground, degrees.
    pub elevation: f64,
    /// Angle that the camera passes during the film, degrees: 360 is once around.
    pub sweep: f64,
    /// Distance from the middle, metres; 0: the smallest at which everybody is in the picture.
    pub distance: f64,
    /// Vertical field of view, degrees; 0: 35.
    pub fov: f64,
}

/// A camera that goes around everybody once.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct FileTurntable {
    /// Angle above the ground, degrees.
    pub elevation: f64,
    /// Distance from the middle of all motions, metres; 0: the smallest at which everybody is in the
    /// picture.
    pub distance: f64,
    /// Vertical field of view, degrees; 0: 35.
    pub fov: f64,
}

/// A camera at a moment.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FileKey {
    /// Time since the beginning of the scene, seconds.
    pub seconds: f64,
    /// Position, metres.
    pub eye: [f64; 3],
    /// The point in the middle of the picture, metres.
    pub target: [f64; 3],
    /// Vertical field of view, degrees; left out: 35.
    #[serde(default)]
    pub fov: f64,
}

/// A camera that moves from one position to another.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FileDolly {
    /// Position at the beginning, metres.
    pub from: [f64; 3],
    /// Position at the end, metres.
    pub to: [f64; 3],
    /// The point in the middle of the picture, metres; left out: 1 m above the middle of the actors'
    /// positions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target: Option<[f64; 3]>,
    /// Time at which the camera arrives and stays, seconds; left out: the `seconds` of the scene, which must then be
    /// set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// Vertical field of view, degrees; left out: 35.
    #[serde(default)]
    pub fov: f64,
}

/// A camera by its matrices, in the world of the scene (OpenCV axes, metres).
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FileMatrices {
    /// Intrinsics, pixels.
    #[serde(rename = "K")]
    pub k: [[f64; 3]; 3],
    /// World to camera.
    #[serde(rename = "E")]
    pub e: [[f64; 4]; 4],
    /// Width and height, pixels.
    pub image_size: [u32; 2],
}

/// A camera of a capture folder whose pictures are held out from training. It keeps its place relative to the actor's
/// motion.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FileHeldOut {
    /// Index, from 0, of the actor whose motion the camera filmed.
    pub actor: u32,
    /// The camera's name, or its index among the sorted names, from 0.
    pub camera: CameraName,
    /// Folder of the capture that has the motion, relative to the scene file: the service does not keep held-out
    /// cameras, so they are read from poses.json in this folder.
    pub folder: PathBuf,
}

/// Which of the cameras of a capture.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum CameraName {
    /// By its name.
    Name(String),
    /// By its place among the sorted names, from 0.
    Index(usize),
}

impl Default for FileCamera {
    fn default() -> Self {
        Self::Orbit(FileOrbit::default())
    }
}

impl Default for FileTurntable {
    /// From a little above.
    fn default() -> Self {
        Self {
            elevation: 10.0,
            distance: 0.0,
            fov: 0.0,
        }
    }
}

/// Reads the path of a camera, which has exactly one.
pub(crate) fn one_path<'de, D: Deserializer<'de>>(reader: D) -> Result<FileCamera, D::Error> {
    let paths = serde_json::Map::deserialize(reader)?;
    if paths.len() != 1 {
        let names: Vec<&str> = paths.keys().map(String::as_str).collect();
        let (count, names) = (names.len(), names.join(", "));
        return Err(D::Error::custom(match count {
            0 => "a path is missing".to_owned(),
            _ => format!("{count} paths, {names}: a camera has one"),
        }));
    }
    serde_path_to_error::deserialize(serde_json::Value::Object(paths)).map_err(D::Error::custom)
}
