//! The camera of a scene file as the path that the service takes.

use crate::scene::camera::{CameraName, FileCamera, FileDolly, FileHeldOut, FileKey, FileMatrices};
use crate::scene::file::SceneFile;
use anyhow::{Context, ensure};
use std::path::Path;
use yoto_capture::CaptureFolder;
use yoto_proto::v1::scene_camera::Path as Track;
use yoto_proto::v1::{
    Camera, CameraKey, CameraKeys, CameraList, CaptureCamera, HeldOutCamera, SceneOrbit,
};

/// Default height of a dolly's target above the ground, metres: an adult's waist.
const WAIST: f64 = 1.0;

impl SceneFile {
    /// The camera's path, with capture folders relative to `folder`.
    ///
    /// # Errors
    /// With the field of the camera that makes no sense.
    pub(crate) fn path(&self, folder: &Path) -> anyhow::Result<Track> {
        Ok(match &self.camera {
            FileCamera::Orbit(orbit) => Track::Orbit(SceneOrbit {
                azimuth: orbit.azimuth,
                elevation: orbit.elevation,
                sweep: orbit.sweep,
                distance: orbit.distance,
                fov: orbit.fov,
            }),
            FileCamera::Turntable(turntable) => Track::Orbit(SceneOrbit {
                azimuth: 0.0,
                elevation: turntable.elevation,
                sweep: 360.0,
                distance: turntable.distance,
                fov: turntable.fov,
            }),
            FileCamera::Keys(keys) => {
                let key = |key: &FileKey| CameraKey {
                    seconds: key.seconds,
                    eye: key.eye.to_vec(),
                    target: key.target.to_vec(),
                    fov: key.fov,
                };
                let keys = keys.iter().map(key).collect();
                Track::Keys(CameraKeys { keys })
            }
            FileCamera::Dolly(dolly) => Track::Keys(self.dolly(dolly)?),
            FileCamera::Matrices(list) => {
                let camera = |camera: &FileMatrices| Camera {
                    width: camera.image_size[0],
                    height: camera.image_size[1],
                    intrinsics: camera.k.concat(),
                    extrinsics: camera.e.concat(),
                };
                let cameras = list.iter().map(camera).collect();
                Track::Cameras(CameraList { cameras })
            }
            FileCamera::Capture(actor) => Track::Capture(CaptureCamera { actor: *actor }),
            FileCamera::HeldOut(held_out) => Track::HeldOut(HeldOutCamera {
                actor: held_out.actor,
                camera: Some(find(held_out, folder)?),
            }),
        })
    }

    /// Two keys: where the camera begins, and where it ends.
    fn dolly(&self, dolly: &FileDolly) -> anyhow::Result<CameraKeys> {
        let end = dolly.seconds.or(self.seconds);
        let end = end.context(
            "dolly.seconds: say when the camera arrives, here or in the \"seconds\" of the scene",
        )?;
        ensure!(end > 0.0, "dolly.seconds: {end} is not above 0");
        let target = dolly.target.unwrap_or_else(|| self.middle());
        for (field, eye) in [("from", dolly.from), ("to", dolly.to)] {
            ensure!(
                eye != target,
                "dolly.{field}: is where the target is, {target:?}"
            );
        }
        let key = |(seconds, eye): (f64, [f64; 3])| CameraKey {
            seconds,
            eye: eye.to_vec(),
            target: target.to_vec(),
            fov: dolly.fov,
        };
        let keys = [(0.0, dolly.from), (end, dolly.to)];
        Ok(CameraKeys {
            keys: keys.map(key).to_vec(),
        })
    }

    /// The middle of the actors' positions, at the height of a waist.
    fn middle(&self) -> [f64; 3] {
        let count = self.actors.len().max(1) as f64;
        let along = |axis: usize| self.actors.iter().map(|it| it.at.0[axis]).sum::<f64>() / count;
        [along(0), WAIST, along(1)]
    }
}

/// The held-out camera in its capture's folder.
fn find(held_out: &FileHeldOut, folder: &Path) -> anyhow::Result<Camera> {
    let folder = folder.join(&held_out.folder);
    let cameras = CaptureFolder::held_out_cameras(&folder)
        .with_context(|| format!("held_out.folder: {}", folder.display()))?;
    ensure!(
        !cameras.is_empty(),
        "held_out.folder: the capture {} has no held-out cameras",
        folder.display()
    );
    let (camera, wanted) = match &held_out.camera {
        CameraName::Name(name) => (cameras.get(name), format!("'{name}'")),
        CameraName::Index(index) => (cameras.values().nth(*index), format!("number {index}")),
    };
    let camera = camera.with_context(|| {
        let known: Vec<&str> = cameras.keys().map(String::as_str).collect();
        let (known, folder) = (known.join(", "), folder.display());
        format!("held_out.camera: the capture {folder} has no camera {wanted}; cameras: {known}")
    })?;
    Ok(camera.to_proto())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn scene(camera: &Value) -> Result<SceneFile, serde_json::Error> {
        let at = |x: f64| json!({"subject": "ada", "at": [x, 2.0]});
        let actors = [at(-1.0), at(3.0)];
        serde_json::from_value(json!({"seconds": 4, "actors": actors, "camera": camera}))
    }

    fn path(camera: &Value, folder: &Path) -> anyhow::Result<Track> {
        scene(camera)?.path(folder)
    }

    fn here(camera: &Value) -> anyhow::Result<Track> {
        path(camera, Path::new(""))
    }

    #[test]
    fn a_turntable_is_an_orbit_of_one_turn() {
        let orbit = |elevation, distance| SceneOrbit {
            elevation,
            sweep: 360.0,
            distance,
            ..SceneOrbit::default()
        };
        let plain = here(&json!({"turntable": {}})).expect("a path");
        assert_eq!(plain, Track::Orbit(orbit(10.0, 0.0)));
        let far = here(&json!({"turntable": {"elevation": 0, "distance": 6}})).expect("a path");
        assert_eq!(far, Track::Orbit(orbit(0.0, 6.0)));
    }

    #[test]
    fn a_dolly_looks_at_the_middle_and_arrives_at_the_end() {
        let key = |seconds: f64, eye: [f64; 3], target: [f64; 3]| CameraKey {
            seconds,
            eye: eye.to_vec(),
            target: target.to_vec(),
            fov: 0.0,
        };
        let (from, to) = ([0.0, 1.0, 8.0], [0.0, 1.0, 5.0]);
        let mut camera = json!({"dolly": {"from": from, "to": to}});
        let middle = [1.0, 1.0, 2.0];
        let keys = vec![key(0.0, from, middle), key(4.0, to, middle)];
        assert_eq!(
            here(&camera).expect("a path"),
            Track::Keys(CameraKeys { keys })
        );
        camera["dolly"]["seconds"] = json!(2.5);
        camera["dolly"]["target"] = json!([0.0, 0.5, 0.0]);
        let target = [0.0, 0.5, 0.0];
        let keys = vec![key(0.0, from, target), key(2.5, to, target)];
        assert_eq!(
            here(&camera).expect("a path"),
            Track::Keys(CameraKeys { keys })
        );
        let refused = |camera: &Value, seconds: Option<f64>| {
            let mut scene = scene(camera).expect("reads");
            scene.seconds = seconds;
            format!("{:#}", scene.path(Path::new("")).expect_err("refused"))
        };
        camera["dolly"]["target"] = json!(to);
        assert!(refused(&camera, None).starts_with("dolly.to: "));
        camera["dolly"]["seconds"] = Value::Null;
        assert!(refused(&camera, None).starts_with("dolly.seconds: say"));
        assert!(refused(&camera, Some(0.0)).starts_with("dolly.seconds: 0"));
    }

    #[test]
    fn a_held_out_camera_is_found_in_its_capture_s_folder() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let k = [[80.0, 0.0, 32.0], [0.0, 80.0, 24.0], [0.0, 0.0, 1.0]];
        let e = |x: f64| json!([[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]]);
        let mut poses = json!({
            "skeleton": {"names": ["root"], "parents": [-1], "rest_joints": [[0, 0, 0]]},
            "image_size": [64, 48], "fps": 25,
            "frames": [{"index": 0, "pose": [0, 0, 0], "translation": [0, 0, 0], "K": k, "E": e(0.0)}]
        });
        let write = |poses: &Value| {
            std::fs::write(dir.path().join("poses.json"), poses.to_string()).expect("writes");
        };
        let wanted = |camera: Value| {
            let held_out = json!({"actor": 1, "camera": camera, "folder": "."});
            path(&json!({"held_out": held_out}), dir.path())
        };
        write(&poses);
        let error = format!("{:#}", wanted(json!("cam00")).expect_err("none"));
        assert!(error.contains("has no held-out cameras"), "{error}");
        poses["eval"] = json!({
            "cam00": {"K": k, "E": e(1.0), "frames": [0]},
            "cam01": {"K": k, "E": e(2.0), "frames": [0]},
        });
        write(&poses);
        for (camera, x) in [(json!("cam01"), 2.0), (json!(0), 1.0)] {
            let Track::HeldOut(found) = wanted(camera).expect("a path") else {
                panic!("another path");
            };
            let camera = found.camera.expect("has one");
            assert_eq!((found.actor, camera.width, camera.height), (1, 64, 48));
            assert_eq!(camera.extrinsics[3], x);
        }
        for (camera, said) in [
            (json!("cam9"), "no camera 'cam9'; cameras: cam00, cam01"),
            (json!(2), "no camera number 2"),
        ] {
            let error = format!("{:#}", wanted(camera).expect_err("none"));
            assert!(error.starts_with("held_out.camera: "), "{error}");
            assert!(error.contains(said), "{error}");
        }
    }

    #[test]
    fn a_camera_has_one_path_whose_faults_are_named() {
        for (camera, said) in [
            (json!({}), "a path is missing"),
            (
                json!({"capture": 0, "turntable": {}}),
                "2 paths, capture, turntable",
            ),
            (json!({"crane": {}}), "crane"),
            (
                json!({"dolly": {"from": [0, 0, 0]}}),
                "dolly: missing field `to`",
            ),
            (json!({"turntable": {"sweep": 3}}), "turntable.sweep"),
        ] {
            let error = scene(&camera).expect_err(said).to_string();
            assert!(error.contains(said), "{error}");
        }
    }
}
