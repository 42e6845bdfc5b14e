//! Poses, cameras and motions of orders.

use super::SpecFaults;
use super::scene::{MAX_PICTURES, SIDES};
use crate::pose_track::{MAX_JOINTS, Skeleton};
use crate::v1::{BodyPose, Camera, MotionClip, View};
use std::fmt::Display;

/// A number of either width.
trait Number: Copy + Display + Into<f64> {}
impl<T: Copy + Display + Into<f64>> Number for T {}

impl SpecFaults {
    /// 1 to [`MAX_PICTURES`] pictures.
    pub(super) fn count(&mut self, field: &str, count: usize) {
        let good = (1..=MAX_PICTURES as usize).contains(&count);
        self.unless(good, field, || {
            format!("{count} pictures; 1 to {MAX_PICTURES} are allowed")
        });
    }

    /// A side of a picture, pixels.
    pub(super) fn side(&mut self, field: &str, side: u32) {
        self.unless(SIDES.contains(&side), field, || {
            let (least, most) = (SIDES.start(), SIDES.end());
            format!("{side} pixels: {least} to {most} are allowed")
        });
    }

    pub(super) fn view(&mut self, field: &str, view: &View) {
        let (Some(pose), Some(camera)) = (&view.pose, &view.camera) else {
            return self.add(field, "a view needs a pose and a camera");
        };
        self.pose(&format!("{field}.pose"), pose);
        self.camera(&format!("{field}.camera"), camera);
    }

    pub(super) fn camera(&mut self, field: &str, camera: &Camera) {
        self.side(&format!("{field}.width"), camera.width);
        self.side(&format!("{field}.height"), camera.height);
        self.numbers(&format!("{field}.intrinsics"), &camera.intrinsics, 9);
        self.numbers(&format!("{field}.extrinsics"), &camera.extrinsics, 16);
    }

    /// Checks the skeleton and the poses of a motion; their number is checked where the use of the motion is
    /// known.
    pub(super) fn motion(&mut self, field: &str, clip: &MotionClip) {
        let message = clip.skeleton.clone().unwrap_or_default();
        let mut skeleton = match Skeleton::from_proto(message) {
            Ok(skeleton) => skeleton,
            Err(fault) => return self.add(&format!("{field}.{}", fault.field), fault.message),
        };
        let joints = skeleton.parents.len();
        // A motion may come without bones: the person's own are used.
        if skeleton.rest_joints.is_empty() {
            skeleton.rest_joints = vec![[0.0; 3]; joints];
        }
        if let Some(fault) = skeleton.check().into_iter().next() {
            return self.add(&format!("{field}.{}", fault.field), fault.message);
        }
        for (i, pose) in clip.poses.iter().enumerate() {
            let field = format!("{field}.poses[{i}]");
            self.pose(&field, pose);
            let numbers = pose.rotations.len();
            self.unless(numbers == 3 * joints, &format!("{field}.rotations"), || {
                format!("{numbers} numbers for {joints} joints")
            });
        }
    }

    fn pose(&mut self, field: &str, pose: &BodyPose) {
        let numbers = pose.rotations.len();
        let whole = numbers > 0 && numbers.is_multiple_of(3) && numbers <= 3 * MAX_JOINTS;
        self.unless(whole, &format!("{field}.rotations"), || {
            format!("{numbers} numbers; a pose has 3 for each of 1 to {MAX_JOINTS} joints")
        });
        self.finite(&format!("{field}.rotations"), &pose.rotations);
        self.numbers(&format!("{field}.translation"), &pose.translation, 3);
    }

    fn numbers<T: Number>(&mut self, field: &str, values: &[T], count: usize) {
        let found = values.len();
        self.unless(found == count, field, || {
            format!("{found} numbers, not {count}")
        });
        self.finite(field, values);
    }

    fn finite<T: Number>(&mut self, field: &str, values: &[T]) {
        let odd = values.iter().position(|value| !(*value).into().is_finite());
        if let Some(i) = odd {
            self.add(
                &format!("{field}[{i}]"),
                format!("{} is not finite", values[i]),
            );
        }
    }
}
