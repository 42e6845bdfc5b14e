//! Views that a request lists.

use crate::error::PlanError;
use crate::shot::Shot;
use yoto_capture::ViewError;
use yoto_capture::camera::{Camera, Pose};
use yoto_proto::pose_track::violation;
use yoto_proto::v1::{BodyPose, ViewList};

/// Most violations reported of one list.
const MAX_VIOLATIONS: usize = 20;

/// The shots of `list`, of a body of that many `joints`, or all of its faults.
pub(crate) fn shots(list: &ViewList, joints: usize) -> Result<Vec<Shot>, PlanError> {
    let mut violations = Vec::new();
    let mut shots = Vec::new();
    for (index, view) in list.views.iter().enumerate() {
        let pose = view
            .pose
            .as_ref()
            .map_or_else(|| Err(missing("pose")), |pose| read_pose(pose, joints));
        let camera = view
            .camera
            .as_ref()
            .map_or_else(|| Err(missing("camera")), Camera::from_proto);
        for error in [pose.as_ref().err(), camera.as_ref().err()]
            .into_iter()
            .flatten()
        {
            let field = format!("views.views[{index}].{}", error.field);
            let message = &error.message;
            violations.push(violation("INVALID", "render", None, field, message));
        }
        if let (Ok(pose), Ok(camera)) = (pose, camera) {
            shots.push(Shot { pose, camera });
        }
        if violations.len() >= MAX_VIOLATIONS {
            break;
        }
    }
    match violations.is_empty() {
        true => Ok(shots),
        false => Err(PlanError::Invalid(violations)),
    }
}

fn read_pose(pose: &BodyPose, joints: usize) -> Result<Pose, ViewError> {
    let (numbers, needed) = (pose.rotations.len(), 3 * joints);
    if numbers == needed {
        return Pose::from_proto(pose);
    }
    Err(ViewError {
        field: "pose.rotations".into(),
        message: format!("{numbers} numbers, a body of {joints} joints needs {needed}"),
    })
}

fn missing(field: &str) -> ViewError {
    ViewError {
        field: field.into(),
        message: "missing".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::track;
    use crate::track::{capture_camera, pose};
    use yoto_proto::v1::{self, View};

    fn good() -> View {
        let track = track();
        let frame = &track.frames[0];
        View {
            pose: Some(v1::BodyPose {
                rotations: frame.pose.iter().map(|&v| v as f32).collect(),
                translation: vec![0.0, 1.0, 2.0],
            }),
            camera: Some(v1::Camera {
                width: 64,
                height: 48,
                intrinsics: frame.k.concat(),
                extrinsics: frame.e.concat(),
            }),
        }
    }

    #[test]
    fn a_listed_view_is_rendered_as_listed() {
        let list = ViewList {
            views: vec![good()],
        };
        let views = shots(&list, 2).expect("views");
        let track = track();
        assert_eq!(
            views[0].camera,
            capture_camera(&track, &track.frames[0]).expect("a camera")
        );
        assert_eq!(
            views[0].pose.rotations,
            pose(&track.frames[0]).expect("a pose").rotations
        );
        assert_eq!(views[0].pose.translation, [0.0, 1.0, 2.0]);
    }

    #[test]
    fn each_bad_view_is_named_by_index_and_field() {
        type Break = fn(&mut v1::BodyPose, &mut v1::Camera);
        let cases: [(Break, &str); 6] = [
            (
                |pose, _| pose.rotations.truncate(5),
                "views.views[1].pose.rotations",
            ),
            (
                |pose, _| pose.translation[2] = f32::NAN,
                "views.views[1].translation[2]",
            ),
            (
                |_, camera| camera.intrinsics[4] = 0.0,
                "views.views[1].camera.intrinsics",
            ),
            (
                |_, camera| camera.intrinsics.clear(),
                "views.views[1].camera.intrinsics",
            ),
            (
                |_, camera| camera.extrinsics[0] = 2.0,
                "views.views[1].camera.extrinsics",
            ),
            (
                |_, camera| camera.extrinsics[3] = f64::INFINITY,
                "views.views[1].camera.extrinsics[3]",
            ),
        ];
        for (break_it, field) in cases {
            let mut bad = good();
            break_it(
                bad.pose.as_mut().expect("a pose"),
                bad.camera.as_mut().expect("a camera"),
            );
            let list = ViewList {
                views: vec![good(), bad],
            };
            let Err(PlanError::Invalid(violations)) = shots(&list, 2) else {
                panic!("{field} is refused");
            };
            let fields: Vec<_> = violations.iter().map(|v| v.field.as_str()).collect();
            assert_eq!(fields, [field]);
        }
    }
}
