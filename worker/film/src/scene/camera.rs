//! The camera of a scene.

use super::actor::AnimatedActor;
use crate::error::PlanError;
use crate::level::UP;
use yoto_capture::camera::Camera;
use yoto_capture::skeleton::transform::{Vec3, add, cross, dot, normalised, scale, sub};
use yoto_proto::checks::scene::FOV;
use yoto_proto::v1::scene_camera::Path;
use yoto_proto::v1::{self, CameraKey, Scene, SceneOrbit};

/// Space around the joints, as a share of their height: a head with hair reaches 0.15 of it above its joint where a fit to a film
/// has placed the joint low, and hands less far beyond theirs.
const MARGIN: f64 = 0.16;
/// Least distance from the camera to a joint that it shows, metres.
const NEAREST: f64 = 0.3;

/// The cameras of the frames at `times` of a scene with these `actors`.
pub(super) fn cameras(
    scene: &Scene,
    actors: &[AnimatedActor],
    times: &[f64],
) -> Result<Vec<Camera>, PlanError> {
    let size = [scene.width, scene.height];
    let path = scene
        .camera
        .as_ref()
        .and_then(|camera| camera.path.as_ref());
    match path {
        None => Ok(orbit(&SceneOrbit::default(), size, actors, times)),
        Some(Path::Orbit(path)) => Ok(orbit(path, size, actors, times)),
        Some(Path::Keys(keys)) => {
            let keyed = times
                .iter()
                .map(|time| between_keys(&keys.keys, size, *time));
            keyed.collect()
        }
        Some(Path::Cameras(list)) => listed(&list.cameras, times.len()),
        Some(Path::Capture(capture)) => {
            let actor = actors.get(capture.actor as usize);
            let filmed = times.iter().map(|time| {
                let camera = actor.and_then(|actor| actor.camera(*time));
                let camera = camera.map(|camera| letterboxed(camera, size));
                camera.ok_or_else(|| invalid("capture.actor", "has no capture's motion"))
            });
            filmed.collect()
        }
        Some(Path::HeldOut(held_out)) => {
            let camera = held_out.camera.as_ref().map(Camera::from_proto);
            let camera = camera.ok_or_else(|| invalid("held_out.camera", "is missing"))?;
            let camera = camera.map_err(|error| {
                invalid(&format!("held_out.camera.{}", error.field), error.message)
            })?;
            let actor = actors.get(held_out.actor as usize);
            let actor = actor.ok_or_else(|| invalid("held_out.actor", "is not there"))?;
            Ok(vec![letterboxed(&actor.placed(&camera), size); times.len()])
        }
    }
}

fn invalid(field: &str, message: impl Into<String>) -> PlanError {
    PlanError::invalid(&format!("scene.camera.{field}"), message.into())
}

/// Focal length of a vertical field of view in degrees, 0 being [`FOV`], in a picture of the given height.
fn focal(fov: f64, height: u32) -> f64 {
    let fov = if fov == 0.0 { FOV } else { fov };
    0.5 * f64::from(height) / (0.5 * fov.to_radians()).tan()
}

/// A camera with an upright picture, also if it looks straight up or down.
fn look(eye: Vec3, target: Vec3, focal: f64, [width, height]: [u32; 2]) -> Camera {
    let ahead = normalised(sub(target, eye));
    // Seen from above, the ground's far side is at the picture's top.
    let up = if dot(ahead, UP).abs() > 0.9999 {
        [0.0, 0.0, -1.0]
    } else {
        UP
    };
    Camera::look_at(eye, target, up, focal, width, height)
}

fn orbit(
    path: &SceneOrbit,
    size: [u32; 2],
    actors: &[AnimatedActor],
    times: &[f64],
) -> Vec<Camera> {
    let points: Vec<Vec<(Vec3, f64)>> = times
        .iter()
        .map(|time| {
            let reach = |actor: &AnimatedActor| {
                let margin = MARGIN * actor.height();
                let joints = actor.joints(*time).into_iter();
                joints.map(move |joint| (joint, margin)).collect::<Vec<_>>()
            };
            actors.iter().flat_map(reach).collect()
        })
        .collect();
    let middle = middle(points.iter().flatten().map(|(joint, _)| *joint));
    let focal = focal(path.fov, size[1]);
    let slopes = size.map(|side| 0.5 * f64::from(side) / focal);
    let count = times.len() as f64;
    let directions: Vec<Vec3> = (0..times.len())
        .map(|frame| {
            let azimuth = (path.azimuth + path.sweep * frame as f64 / count).to_radians();
            let (rise, level) = path.elevation.to_radians().sin_cos();
            [azimuth.sin() * level, rise, azimuth.cos() * level]
        })
        .collect();
    let distance = if path.distance > 0.0 {
        path.distance
    } else {
        let seen = directions.iter().zip(&points);
        let fits = seen.map(|(direction, points)| fitting(*direction, middle, points, slopes));
        fits.fold(NEAREST, f64::max)
    };
    let cameras = directions
        .into_iter()
        .map(|direction| look(add(middle, scale(direction, distance)), middle, focal, size));
    cameras.collect()
}

/// Middle of the box around `points`.
fn middle(points: impl Iterator<Item = Vec3>) -> Vec3 {
    let mut ends = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for point in points {
        for axis in 0..3 {
            ends[0][axis] = ends[0][axis].min(point[axis]);
            ends[1][axis] = ends[1][axis].max(point[axis]);
        }
    }
    scale(add(ends[0], ends[1]), 0.5)
}

/// Least distance from `middle` in `direction` at which a camera whose half picture has the `slopes` sees
/// the `points` with their margins.
fn fitting(direction: Vec3, middle: Vec3, points: &[(Vec3, f64)], slopes: [f64; 2]) -> f64 {
    let right = normalised(cross(UP, direction));
    let up = cross(direction, right);
    let needed = points.iter().map(|(point, margin)| {
        let arm = sub(*point, middle);
        let aside = dot(arm, right).abs() + margin;
        let above = dot(arm, up).abs() + margin;
        let away = (aside / slopes[0]).max(above / slopes[1]).max(NEAREST);
        dot(arm, direction) + away
    });
    needed.fold(0.0, f64::max)
}

/// The camera at `time` of a path through `keys`.
fn between_keys(keys: &[CameraKey], size: [u32; 2], time: f64) -> Result<Camera, PlanError> {
    let after = keys.partition_point(|key| key.seconds <= time);
    let (from, to) = match (
        after.checked_sub(1).and_then(|it| keys.get(it)),
        keys.get(after),
    ) {
        (Some(from), Some(to)) => (from, to),
        (Some(only), None) | (None, Some(only)) => (only, only),
        (None, None) => return Err(invalid("keys", "the list is empty")),
    };
    let passed = to.seconds - from.seconds;
    let share = if passed > 0.0 {
        (time - from.seconds) / passed
    } else {
        0.0
    };
    let mix = |a: f64, b: f64| a + share * (b - a);
    let point = |from: &[f64], to: &[f64]| -> Option<Vec3> {
        let (from, to): (Vec3, Vec3) = (from.try_into().ok()?, to.try_into().ok()?);
        Some(std::array::from_fn(|axis| mix(from[axis], to[axis])))
    };
    let eye = point(&from.eye, &to.eye);
    let target = point(&from.target, &to.target);
    let (Some(eye), Some(target)) = (eye, target) else {
        return Err(invalid("keys", "an eye or a target without three numbers"));
    };
    if eye == target {
        return Err(invalid(
            "keys",
            format!("the eye meets the target at {time} s"),
        ));
    }
    let focal = mix(focal(from.fov, size[1]), focal(to.fov, size[1]));
    Ok(look(eye, target, focal, size))
}

/// One camera for all frames, or one per frame.
fn listed(list: &[v1::Camera], frames: usize) -> Result<Vec<Camera>, PlanError> {
    if list.len() != 1 && list.len() != frames {
        let count = list.len();
        let message = format!("{count} cameras for {frames} pictures: one, or one per picture");
        return Err(invalid("cameras", message));
    }
    let read = |(index, camera)| {
        Camera::from_proto(camera).map_err(|error| {
            let field = format!("cameras.cameras[{index}].{}", error.field);
            invalid(&field, error.message)
        })
    };
    let cameras: Vec<Camera> = list
        .iter()
        .enumerate()
        .map(read)
        .collect::<Result<_, _>>()?;
    Ok((0..frames)
        .map(|frame| cameras[frame % cameras.len()].clone())
        .collect())
}

/// All that `camera` sees, in the middle of a picture of the given size.
fn letterboxed(camera: &Camera, [width, height]: [u32; 2]) -> Camera {
    let sides = [(width, camera.width), (height, camera.height)];
    let zoom = sides.map(|(to, from)| f64::from(to) / f64::from(from));
    let zoom = zoom[0].min(zoom[1]);
    let mut boxed = camera.clone();
    for (row, (to, from)) in boxed.k.iter_mut().zip(sides) {
        *row = row.map(|value| value * zoom);
        row[2] += 0.5 * (f64::from(to) - zoom * f64::from(from));
    }
    (boxed.width, boxed.height) = (width, height);
    boxed
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(seconds: f64, eye: [f64; 3], fov: f64) -> CameraKey {
        CameraKey {
            seconds,
            eye: eye.to_vec(),
            target: vec![0.0, 1.0, 0.0],
            fov,
        }
    }

    #[test]
    fn a_camera_moves_from_key_to_key_and_stays_at_the_last() {
        let keys = [
            key(1.0, [0.0, 1.0, 4.0], 0.0),
            key(3.0, [2.0, 1.0, 4.0], 0.0),
        ];
        for (time, x) in [(0.0, 0.0), (1.0, 0.0), (2.5, 1.5), (3.0, 2.0), (9.0, 2.0)] {
            let camera = between_keys(&keys, [64, 48], time).expect("a camera");
            let eye = camera.centre();
            assert!((eye[0] - x).abs() < 1e-9 && (eye[2] - 4.0).abs() < 1e-9);
            let seen = camera.project([0.0, 1.0, 0.0]).expect("in front");
            assert!((seen[0] - 32.0).abs() < 1e-9 && (seen[1] - 24.0).abs() < 1e-9);
        }
    }

    #[test]
    fn right_in_the_scene_is_right_in_the_default_picture() {
        let camera = look([0.0, 1.0, 5.0], [0.0, 1.0, 0.0], 100.0, [64, 64]);
        let right = camera.project([1.0, 1.0, 0.0]).expect("in front");
        let above = camera.project([0.0, 2.0, 0.0]).expect("in front");
        assert!(right[0] > 32.0 && (right[1] - 32.0).abs() < 1e-9);
        assert!(above[1] < 32.0);
        let down = look([0.0, 5.0, 0.0], [0.0; 3], 100.0, [64, 64]);
        assert!(down.e.iter().flatten().all(|value| value.is_finite()));
    }

    #[test]
    fn everything_fits_and_touches_the_edge() {
        let points = [([1.0, 0.2, 0.5], 0.1), ([-1.5, 1.8, -0.3], 0.1)];
        let middle = middle(points.iter().map(|(point, _)| *point));
        let slopes = [0.4, 0.3];
        for azimuth in [0.0f64, 1.0, 2.5] {
            let direction = [azimuth.sin(), 0.0, azimuth.cos()];
            let distance = fitting(direction, middle, &points, slopes);
            let eye = add(middle, scale(direction, distance));
            let camera = look(eye, middle, 100.0, [80, 60]);
            let mut edge = f64::INFINITY;
            for (point, margin) in points {
                let [u, v] = camera.project(point).expect("in front");
                let depth = dot(sub(eye, point), direction);
                let grown = 100.0 * margin / depth;
                let free = [40.0 - (u - 40.0).abs(), 30.0 - (v - 30.0).abs()];
                edge = edge.min(free[0] - grown).min(free[1] - grown);
            }
            assert!(edge.abs() < 1e-6, "{edge} pixels are free");
        }
    }

    #[test]
    fn a_capture_s_picture_is_whole_in_another_shape() {
        let camera = look([0.0, 1.0, 5.0], [0.0, 1.0, 0.0], 100.0, [64, 64]);
        let wide = letterboxed(&camera, [200, 128]);
        let [u, v] = camera.project([0.3, 0.6, 0.4]).expect("in front");
        let [x, y] = wide.project([0.3, 0.6, 0.4]).expect("in front");
        assert!((x - (36.0 + 2.0 * u)).abs() < 1e-9 && (y - 2.0 * v).abs() < 1e-9);
    }

    #[test]
    fn a_list_of_cameras_has_one_per_picture() {
        let camera = look([0.0, 1.0, 5.0], [0.0, 1.0, 0.0], 100.0, [64, 64]).to_proto();
        assert_eq!(
            listed(std::slice::from_ref(&camera), 5).expect("one").len(),
            5
        );
        let Err(PlanError::Invalid(violations)) = listed(&vec![camera; 2], 5) else {
            panic!("two cameras for five pictures are refused");
        };
        assert_eq!(violations[0].field, "scene.camera.cameras");
    }
}
