//! Scenes, and the limits of pictures.

use super::{SpecFault, SpecFaults};
use crate::names::Collection;
use crate::v1::actor::Motion;
use crate::v1::scene_camera::Path;
use crate::v1::{Actor, CameraKeys, Light, Scene, SceneCamera, SceneOrbit, light};
use std::ops::RangeInclusive;

/// Actors of a scene.
pub const ACTORS: RangeInclusive<usize> = 1..=16;
/// Maximum number of pictures of a render, and of poses of a motion: 11 minutes at 15 frames per second. A render's
/// order and list of files must fit into one answer.
pub const MAX_PICTURES: u32 = 10_000;
/// Longest side of a rendered picture, pixels.
pub const MAX_SIDE: u32 = 4096;
/// Sides of a picture, pixels.
pub const SIDES: RangeInclusive<u32> = 8..=MAX_SIDE;
/// Default vertical field of view, degrees.
pub const FOV: f64 = 35.0;
/// Bytes of the picture behind a scene: it must fit in one message with the rest of the request.
pub const LARGEST_BACKDROP: usize = 3 << 20;
/// Maximum side of the backdrop, pixels: as large as a frame of a capture may be.
pub const BACKDROP_SIDE: u32 = crate::pose_track::MAX_SIDE;
/// Maximum number of pixels of the backdrop: as many as the largest rendered picture has. Scaling needs 16 bytes of
/// memory per pixel.
pub const BACKDROP_PIXELS: u64 = MAX_SIDE as u64 * MAX_SIDE as u64;
/// Farthest position from the middle of a scene, metres.
const FARTHEST: f64 = 1000.0;
/// Length of a scene, seconds.
const LONGEST: f64 = 10_000.0;
/// Speeds of a motion, where 1 is its own.
const SPEEDS: RangeInclusive<f64> = 0.01..=100.0;
/// Frame rates of a motion.
pub(super) const RATES: RangeInclusive<f64> = 0.01..=1000.0;
/// Fields of view, degrees.
const FOVS: RangeInclusive<f64> = 1.0..=150.0;
/// Angles that a camera passes in one film, degrees.
const SWEEP: f64 = 36_000.0;

/// All faults of a scene.
pub fn faults(scene: &Scene) -> Vec<SpecFault> {
    let mut found = SpecFaults::default();
    let count = scene.actors.len();
    let (least, most) = (ACTORS.start(), ACTORS.end());
    found.unless(ACTORS.contains(&count), "actors", || {
        format!("{count} actors: {least} to {most} are allowed")
    });
    for (i, actor) in scene.actors.iter().enumerate() {
        check_actor(&mut found, &format!("actors[{i}]"), actor);
    }
    found.between("seconds", scene.seconds, &(0.0..=LONGEST));
    let large = scene.backdrop.len();
    found.unless(large <= LARGEST_BACKDROP, "backdrop", || {
        format!("{large} bytes: at most {LARGEST_BACKDROP} are allowed")
    });
    let listed = check_camera(&mut found, scene);
    for (field, side) in [("width", scene.width), ("height", scene.height)] {
        if listed {
            found.unless(side == 0, field, || {
                format!("{side} pixels: a list of cameras has its own sizes")
            });
        } else {
            found.unless(SIDES.contains(&side), field, || {
                let (least, most) = (SIDES.start(), SIDES.end());
                format!("{side} pixels: {least} to {most} are allowed")
            });
        }
    }
    found.0
}

impl SpecFaults {
    /// A light, at `field`.
    pub(super) fn light(&mut self, field: &str, light: &Light) {
        match &light.of {
            None => self.add(field, "must be neutral or name a subject"),
            Some(light::Of::Neutral(neutral)) => {
                let field = format!("{field}.neutral");
                self.unless(*neutral, &field, || "false: leave the light out".into());
            }
            Some(light::Of::Subject(_)) => (),
        }
    }

    /// Checks the end of the capture motion at `field`, which begins with the frame `first`.
    pub(super) fn end_frame(&mut self, field: &str, first: Option<u32>, end: Option<u32>) {
        if let Some(end) = end {
            let first = first.unwrap_or_default();
            self.unless(end > first, &format!("{field}.end_frame"), || {
                format!("{end} is not above the first frame, {first}")
            });
        }
    }

    /// `N` numbers, none farther from 0 than [`FARTHEST`].
    fn position<const N: usize>(&mut self, field: &str, position: &[f64]) {
        let near = |value: &f64| value.abs() <= FARTHEST;
        let good = position.len() == N && position.iter().all(near);
        self.unless(good, field, || {
            format!("{position:?}: {N} numbers from -{FARTHEST} to {FARTHEST}, metres")
        });
    }
}

fn check_actor(found: &mut SpecFaults, at: &str, actor: &Actor) {
    let field = |name: &str| format!("{at}.{name}");
    match &actor.motion {
        None => found.add(&field("motion"), "is missing"),
        Some(Motion::Capture(motion)) => {
            let count = motion.frame_count;
            // With an end, this is only an upper limit.
            let few = count <= MAX_PICTURES || motion.end_frame.is_some();
            found.unless(few, &field("capture.frame_count"), || {
                format!("{count} frames: at most {MAX_PICTURES} are allowed")
            });
            found.end_frame(&field("capture"), motion.first_frame, motion.end_frame);
        }
        Some(Motion::Clip(clip)) => {
            let count = clip.poses.len();
            let fits = (1..=MAX_PICTURES as usize).contains(&count);
            found.unless(fits, &field("clip.poses"), || {
                format!("{count} poses: 1 to {MAX_PICTURES} are allowed")
            });
            found.between(&field("clip.fps"), clip.fps, &RATES);
            found.motion(&field("clip"), clip);
        }
    }
    if !actor.at.is_empty() {
        found.position::<2>(&field("at"), &actor.at);
    }
    if !actor.model.is_empty()
        && let Err(error) = Collection::Models.parse(&actor.model)
    {
        found.add(&field("model"), error.to_string());
    }
    found.between(&field("heading"), actor.heading, &(-SWEEP..=SWEEP));
    found.between(&field("start"), actor.start, &(0.0..=LONGEST));
    if actor.speed != 0.0 {
        found.between(&field("speed"), actor.speed, &SPEEDS);
    }
    if let Some(light) = &actor.light {
        found.light(&field("light"), light);
    }
}

/// Checks the camera's path. Returns whether it is a list of cameras.
fn check_camera(found: &mut SpecFaults, scene: &Scene) -> bool {
    let Some(SceneCamera { path }) = &scene.camera else {
        return false;
    };
    match path {
        None => found.add("camera", "has no path"),
        Some(Path::Orbit(orbit)) => check_orbit(found, orbit),
        Some(Path::Keys(keys)) => check_keys(found, keys),
        Some(Path::Cameras(list)) => {
            found.unless(!list.cameras.is_empty(), "camera.cameras", || {
                "the list is empty".into()
            });
            for (i, camera) in list.cameras.iter().enumerate() {
                found.camera(&format!("camera.cameras.cameras[{i}]"), camera);
            }
            return true;
        }
        Some(Path::Capture(capture)) => {
            check_filmed(found, "camera.capture.actor", scene, capture.actor);
        }
        Some(Path::HeldOut(held_out)) => {
            check_filmed(found, "camera.held_out.actor", scene, held_out.actor);
            match &held_out.camera {
                Some(camera) => found.camera("camera.held_out.camera", camera),
                None => found.add("camera.held_out.camera", "is missing"),
            }
        }
    }
    false
}

/// Whether cameras filmed the motion of actor number `actor`.
fn check_filmed(found: &mut SpecFaults, field: &str, scene: &Scene, actor: u32) {
    let motion = scene.actors.get(actor as usize);
    let motion = motion.and_then(|actor| actor.motion.as_ref());
    let filmed = matches!(motion, Some(Motion::Capture(_)));
    found.unless(filmed, field, || {
        format!("{actor}: no actor with a capture's motion")
    });
}

fn check_orbit(found: &mut SpecFaults, orbit: &SceneOrbit) {
    found.between("camera.orbit.azimuth", orbit.azimuth, &(-SWEEP..=SWEEP));
    found.between("camera.orbit.elevation", orbit.elevation, &(-89.0..=89.0));
    found.between("camera.orbit.sweep", orbit.sweep, &(-SWEEP..=SWEEP));
    found.between("camera.orbit.distance", orbit.distance, &(0.0..=FARTHEST));
    check_fov(found, "camera.orbit.fov", orbit.fov);
}

fn check_fov(found: &mut SpecFaults, field: &str, fov: f64) {
    if fov != 0.0 {
        found.between(field, fov, &FOVS);
    }
}

fn check_keys(found: &mut SpecFaults, keys: &CameraKeys) {
    found.unless(!keys.keys.is_empty(), "camera.keys", || {
        "the list is empty".into()
    });
    let mut last = None;
    for (i, key) in keys.keys.iter().enumerate() {
        let field = |name: &str| format!("camera.keys[{i}].{name}");
        found.between(&field("seconds"), key.seconds, &(0.0..=LONGEST));
        let later = last.is_none_or(|last| key.seconds > last);
        found.unless(later, &field("seconds"), || {
            format!("{} is not after the key before", key.seconds)
        });
        last = Some(key.seconds);
        found.position::<3>(&field("eye"), &key.eye);
        found.position::<3>(&field("target"), &key.target);
        found.unless(key.eye != key.target, &field("target"), || {
            "is where the eye is".into()
        });
        check_fov(found, &field("fov"), key.fov);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1::{
        BodyPose, Camera, CameraKey, CameraList, CaptureCamera, CaptureMotion, HeldOutCamera,
        MotionClip,
    };

    fn good() -> Scene {
        Scene {
            actors: vec![Actor {
                motion: Some(Motion::Capture(CaptureMotion::default())),
                ..Actor::default()
            }],
            width: 64,
            height: 64,
            ..Scene::default()
        }
    }

    fn key(seconds: f64, eye: [f64; 3]) -> CameraKey {
        CameraKey {
            seconds,
            eye: eye.to_vec(),
            target: vec![0.0, 1.0, 0.0],
            fov: 0.0,
        }
    }

    fn seen_from() -> Camera {
        Camera {
            width: 64,
            height: 64,
            intrinsics: vec![1.0; 9],
            extrinsics: vec![0.0; 16],
        }
    }

    fn by(path: Path) -> Option<SceneCamera> {
        Some(SceneCamera { path: Some(path) })
    }

    #[test]
    fn a_scene_of_default_values_is_good() {
        assert_eq!(faults(&good()), []);
        let mut scene = good();
        let keys = vec![key(0.0, [0.0, 1.0, 4.0]), key(2.0, [1.0, 1.0, 4.0])];
        scene.camera = by(Path::Keys(CameraKeys { keys }));
        assert_eq!(faults(&scene), []);
        scene.camera = by(Path::Capture(CaptureCamera { actor: 0 }));
        assert_eq!(faults(&scene), []);
        let camera = Some(seen_from());
        scene.camera = by(Path::HeldOut(HeldOutCamera { actor: 0, camera }));
        assert_eq!(faults(&scene), []);
        scene.actors[0].model = "models/fog".into();
        assert_eq!(faults(&scene), []);
    }

    #[test]
    fn each_fault_is_named_by_its_field() {
        type Break = fn(&mut Scene);
        let cases: [(Break, &str); 25] = [
            (|it| it.actors.clear(), "actors"),
            (|it| it.actors[0].motion = None, "actors[0].motion"),
            (|it| it.actors[0].at = vec![1.0], "actors[0].at"),
            (|it| it.actors[0].at = vec![1.0, f64::NAN], "actors[0].at"),
            (
                |it| it.actors[0].heading = f64::INFINITY,
                "actors[0].heading",
            ),
            (|it| it.actors[0].model = "fog".into(), "actors[0].model"),
            (
                |it| it.actors[0].model = "subjects/fog".into(),
                "actors[0].model",
            ),
            (|it| it.actors[0].start = -1.0, "actors[0].start"),
            (|it| it.actors[0].speed = -1.0, "actors[0].speed"),
            (
                |it| it.actors[0].light = Some(Light { of: None }),
                "actors[0].light",
            ),
            (
                |it| {
                    let clip = MotionClip::default();
                    it.actors[0].motion = Some(Motion::Clip(clip));
                },
                "actors[0].clip.poses",
            ),
            (
                |it| {
                    it.actors[0].motion = Some(Motion::Clip(MotionClip {
                        poses: vec![BodyPose::default()],
                        fps: 30.0,
                        ..MotionClip::default()
                    }));
                },
                "actors[0].clip.skeleton.parents",
            ),
            (
                |it| {
                    let cameras = vec![Camera::default()];
                    it.camera = by(Path::Cameras(CameraList { cameras }));
                    (it.width, it.height) = (0, 0);
                },
                "camera.cameras.cameras[0].width",
            ),
            (|it| it.width = 5000, "width"),
            (|it| it.seconds = f64::NAN, "seconds"),
            (|it| it.camera = Some(SceneCamera { path: None }), "camera"),
            (
                |it| {
                    let elevation = 90.0;
                    let orbit = SceneOrbit {
                        elevation,
                        ..SceneOrbit::default()
                    };
                    it.camera = by(Path::Orbit(orbit));
                },
                "camera.orbit.elevation",
            ),
            (
                |it| {
                    let keys = vec![key(1.0, [0.0, 1.0, 4.0]), key(1.0, [1.0, 1.0, 4.0])];
                    it.camera = by(Path::Keys(CameraKeys { keys }));
                },
                "camera.keys[1].seconds",
            ),
            (
                |it| {
                    let keys = vec![key(0.0, [0.0, 1.0, 0.0])];
                    it.camera = by(Path::Keys(CameraKeys { keys }));
                },
                "camera.keys[0].target",
            ),
            (
                |it| {
                    it.camera = by(Path::Cameras(CameraList::default()));
                    (it.width, it.height) = (0, 0);
                },
                "camera.cameras",
            ),
            (
                |it| it.camera = by(Path::Capture(CaptureCamera { actor: 1 })),
                "camera.capture.actor",
            ),
            (
                |it| {
                    let camera = Some(seen_from());
                    it.camera = by(Path::HeldOut(HeldOutCamera { actor: 1, camera }));
                },
                "camera.held_out.actor",
            ),
            (
                |it| it.camera = by(Path::HeldOut(HeldOutCamera::default())),
                "camera.held_out.camera",
            ),
            (
                |it| {
                    let mut camera = seen_from();
                    camera.extrinsics.truncate(12);
                    let camera = Some(camera);
                    it.camera = by(Path::HeldOut(HeldOutCamera { actor: 0, camera }));
                },
                "camera.held_out.camera.extrinsics",
            ),
            (
                |it| {
                    it.actors[0].motion = Some(Motion::Capture(CaptureMotion {
                        first_frame: Some(5),
                        end_frame: Some(5),
                        ..CaptureMotion::default()
                    }));
                },
                "actors[0].capture.end_frame",
            ),
        ];
        for (break_it, field) in cases {
            let mut scene = good();
            break_it(&mut scene);
            let found = faults(&scene);
            assert_eq!(found.first().map(|it| it.field.as_str()), Some(field));
        }
    }
}
