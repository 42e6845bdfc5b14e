//! Views listed by a request, and the steps that all kinds of requests share.

use crate::jobs::JobFailure;
use yoto_avatar::render::RenderView;
use yoto_capture::ViewError;
use yoto_capture::camera::{Camera, Pose};
use yoto_proto::{
    pose_track::{Frame, PoseTrack, violation},
    v1::{self, ViewList},
};

/// Most violations reported of one list.
const MAX_VIOLATIONS: usize = 20;

/// The rendered person, and the background.
pub(super) struct Stage {
    pub(super) slot: usize,
    pub(super) background: [f32; 3],
    /// Joints of the subject's skeleton.
    pub(super) joints: usize,
}

impl Stage {
    /// One view, once the pose fits the skeleton.
    pub(super) fn view(&self, pose: Pose, camera: Camera) -> Result<RenderView, JobFailure> {
        if pose.rotations.len() != self.joints {
            let message = format!(
                "a pose of {} joints for a body of {}",
                pose.rotations.len(),
                self.joints
            );
            return Err(JobFailure::Failed {
                code: "RETARGET",
                message,
            });
        }
        Ok(RenderView {
            slot: self.slot,
            pose,
            camera,
            background: self.background,
        })
    }

    /// The views of `list`, or all of their faults.
    pub(super) fn listed(&self, list: &ViewList) -> Result<Vec<RenderView>, JobFailure> {
        let mut found = Vec::new();
        let mut views = Vec::new();
        for (index, view) in list.views.iter().enumerate() {
            let pose = view
                .pose
                .as_ref()
                .map_or_else(|| Err(missing("pose")), |pose| self.read_pose(pose));
            let camera = view
                .camera
                .as_ref()
                .map_or_else(|| Err(missing("camera")), Camera::from_proto);
            for error in [pose.as_ref().err(), camera.as_ref().err()]
                .into_iter()
                .flatten()
            {
                let field = format!("views.views[{index}].{}", error.field);
                found.push(violation("INVALID", "render", None, field, &error.message));
            }
            if let (Ok(pose), Ok(camera)) = (pose, camera) {
                views.push(self.view(pose, camera)?);
            }
            if found.len() >= MAX_VIOLATIONS {
                break;
            }
        }
        if found.is_empty() {
            Ok(views)
        } else {
            Err(JobFailure::Invalid(found))
        }
    }

    fn read_pose(&self, pose: &v1::BodyPose) -> Result<Pose, ViewError> {
        let (found, needed) = (pose.rotations.len(), 3 * self.joints);
        if found == needed {
            return Pose::from_proto(pose);
        }
        Err(ViewError {
            field: "pose.rotations".into(),
            message: format!(
                "{found} numbers, a body of {} joints needs {needed}",
                self.joints
            ),
        })
    }
}

fn missing(field: &str) -> ViewError {
    ViewError {
        field: field.into(),
        message: "missing".into(),
    }
}

/// The place in `track` of the frame with `index`.
pub(super) fn find_place(track: &PoseTrack, index: u32, field: &str) -> Result<usize, JobFailure> {
    track
        .frames
        .iter()
        .position(|frame| frame.index == index)
        .ok_or_else(|| {
            let count = track.frames.len();
            JobFailure::invalid(
                "render",
                field,
                format!("none of the capture's {count} frames has the index {index}"),
            )
        })
}

/// The frame with `index` in `track`.
pub(super) fn find_frame<'a>(
    track: &'a PoseTrack,
    index: u32,
    field: &str,
) -> Result<&'a Frame, JobFailure> {
    Ok(&track.frames[find_place(track, index, field)?])
}

/// The pose of a captured frame.
pub(super) fn pose(frame: &Frame) -> Result<Pose, JobFailure> {
    Pose::from_frame(frame).map_err(|error| captured(frame, &error))
}

/// The camera of a captured frame.
pub(super) fn capture_camera(track: &PoseTrack, frame: &Frame) -> Result<Camera, JobFailure> {
    Camera::from_frame(frame, track.image_size).map_err(|error| captured(frame, &error))
}

/// Ingested captures were checked, so this is not a fault of the user.
fn captured(frame: &Frame, error: &ViewError) -> JobFailure {
    JobFailure::failed(
        "INTERNAL",
        &format!("the capture's frame {}", frame.index),
        error,
    )
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use yoto_proto::pose_track;

    /// Slot 2, whose body has the two joints of [`track`].
    pub(crate) const STAGE: Stage = Stage {
        slot: 2,
        background: [0.0; 3],
        joints: 2,
    };

    /// Frames 5 to 8 of a two-joint body, seen by a camera in front of it that stands
    /// upright in a y-up world.
    pub(crate) fn track() -> PoseTrack {
        let frame = |i: u32| Frame {
            index: 5 + i,
            pose: vec![0.0, 0.1 * f64::from(i), 0.0, 0.3, 0.0, 0.0],
            translation: [0.2, 0.1, 0.3 + 0.1 * f64::from(i)],
            k: [[80.0, 0.0, 32.0], [0.0, 80.0, 24.0], [0.0, 0.0, 1.0]],
            e: [
                [1.0, 0.0, 0.0, 0.1],
                [0.0, -1.0, 0.0, 1.2],
                [0.0, 0.0, -1.0, 3.0],
                [0.0, 0.0, 0.0, 1.0],
            ],
        };
        PoseTrack {
            skeleton: pose_track::Skeleton {
                names: vec!["root".into(), "tip".into()],
                parents: vec![-1, 0],
                rest_joints: vec![[0.0, 0.9, 0.0], [0.0, 0.1, 0.0]],
            },
            image_size: [64, 48],
            fps: 15.0,
            distortion: [0.0; 5],
            frames: (0..4).map(frame).collect(),
        }
    }

    fn good() -> v1::View {
        let track = track();
        let frame = &track.frames[0];
        v1::View {
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
        let views = STAGE
            .listed(&ViewList {
                views: vec![good()],
            })
            .expect("views");
        let track = track();
        assert_eq!(views[0].slot, 2);
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
    fn each_bad_view_is_named_by_place_and_field() {
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
            let Err(JobFailure::Invalid(found)) = STAGE.listed(&list) else {
                panic!("{field} is refused");
            };
            let fields: Vec<_> = found.iter().map(|v| v.field.as_str()).collect();
            assert_eq!(fields, [field]);
        }
    }
}
