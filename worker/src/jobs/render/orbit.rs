//! One pose from all around: the camera circles the subject's root at the capture camera's
//! distance and height, and looks at it.

use super::{
    RenderView,
    views::{Stage, capture_camera, find_frame, pose},
};
use crate::jobs::JobFailure;
use std::f64::consts::TAU;
use yoto_capture::{
    camera::Camera,
    skeleton::transform::{Vec3, add, apply, cross, dot, length, rigid, rodrigues, scale, sub},
};
use yoto_proto::{pose_track::PoseTrack, v1::Orbit};

/// The views of `orbit` around the pose of its frame; the first is from the capture camera's
/// side.
pub(super) fn views(
    stage: &Stage,
    orbit: &Orbit,
    track: &PoseTrack,
) -> Result<Vec<RenderView>, JobFailure> {
    let frame = find_frame(track, orbit.frame, "orbit.frame")?;
    let rest = track
        .skeleton
        .rest_joints
        .first()
        .copied()
        .unwrap_or_default();
    let root = add(rest, frame.translation);
    let capture = capture_camera(track, frame)?;
    (0..orbit.views)
        .map(|view| {
            let angle = TAU * f64::from(view) / f64::from(orbit.views);
            stage.view(pose(frame)?, circled(&capture, root, angle, orbit.size))
        })
        .collect()
}

/// `capture` after a turn by `angle` about `root`, `size` square. The longest side of the
/// capture's image becomes `size`, so that the person is framed as in the capture.
fn circled(capture: &Camera, root: Vec3, angle: f64, size: u32) -> Camera {
    let [x, y, z, _] = capture.e[1];
    let up = world_up([-x, -y, -z]);
    let mut arm = sub(capture.centre(), root);
    if length(sub(arm, scale(up, dot(arm, up)))) < 1e-6 {
        // A camera above or at the root has no horizontal direction: move it aside.
        arm = add(
            arm,
            scale(cross(up, [up[1], up[2], up[0]]), length(arm).max(1.0)),
        );
    }
    let turned = apply(&rigid(rodrigues(scale(up, angle)), [0.0; 3]), arm);
    let zoom = f64::from(size) / f64::from(capture.width.max(capture.height));
    let focal = capture.k[1][1] * zoom;
    let mut camera = Camera::look_at(add(root, turned), root, up, focal, size, size);
    camera.k[0][0] = capture.k[0][0] * zoom;
    camera
}

/// The world's up: the axis nearest to the capture camera's up, since people stand upright
/// in pictures while a pose track does not say which axis that is.
pub(super) fn world_up(camera_up: Vec3) -> Vec3 {
    let axis = (0..3).fold(0, |best, i| {
        if camera_up[i].abs() > camera_up[best].abs() {
            i
        } else {
            best
        }
    });
    std::array::from_fn(|i| {
        if i == axis {
            camera_up[axis].signum()
        } else {
            0.0
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::render::views::tests::{STAGE, track};

    fn root(track: &PoseTrack) -> Vec3 {
        add(track.skeleton.rest_joints[0], track.frames[0].translation)
    }

    fn orbit(views: u32, size: u32) -> Orbit {
        Orbit {
            frame: 5,
            views,
            size,
        }
    }

    #[test]
    fn every_camera_keeps_the_root_in_the_middle_at_the_same_distance_and_height() {
        let track = track();
        let root = root(&track);
        let capture = capture_camera(&track, &track.frames[0]).expect("a camera");
        let arm = sub(capture.centre(), root);
        let views = views(&STAGE, &orbit(8, 100), &track).expect("views");
        assert_eq!(views.len(), 8);
        for view in &views {
            let [x, y] = view.camera.project(root).expect("in front");
            assert!(
                (x - 50.0).abs() < 1e-9 && (y - 50.0).abs() < 1e-9,
                "{x} {y}"
            );
            let here = sub(view.camera.centre(), root);
            assert!((length(here) - length(arm)).abs() < 1e-9);
            assert!((here[1] - arm[1]).abs() < 1e-9);
            assert_eq!(view.pose, pose(&track.frames[0]).expect("a pose"));
        }
        let first = views[0].camera.centre();
        assert!(
            length(sub(first, capture.centre())) < 1e-9,
            "begins at the capture camera"
        );
        let opposite = sub(views[4].camera.centre(), root);
        assert!((opposite[0] + arm[0]).abs() < 1e-9 && (opposite[2] + arm[2]).abs() < 1e-9);
    }

    #[test]
    fn heads_stay_up_and_framing_follows_the_size() {
        let track = track();
        for view in views(&STAGE, &orbit(4, 128), &track).expect("views") {
            let [_, y] = view
                .camera
                .project(add(root(&track), [0.0, 0.5, 0.0]))
                .expect("in front");
            assert!(y < 64.0, "up in the world is up in the picture: {y}");
            assert!((view.camera.k[0][0] - 160.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_camera_at_the_root_itself_still_gets_a_circle() {
        let mut track = track();
        let [x, y, z] = root(&track);
        // Upright as before (its rows are x, -y, -z), but standing in the root.
        for (row, offset) in track.frames[0].e.iter_mut().zip([-x, y, z]) {
            row[3] = offset;
        }
        for view in views(&STAGE, &orbit(6, 64), &track).expect("views") {
            let [x, y] = view.camera.project(root(&track)).expect("in front");
            assert!(
                (x - 32.0).abs() < 1e-6 && (y - 32.0).abs() < 1e-6,
                "{x} {y}"
            );
        }
    }

    #[test]
    fn a_frame_that_is_not_there_is_named() {
        let asked = Orbit {
            frame: 99,
            ..orbit(1, 64)
        };
        let Err(JobFailure::Invalid(found)) = views(&STAGE, &asked, &track()) else {
            panic!("refused");
        };
        assert_eq!(found[0].field, "orbit.frame");
    }
}
