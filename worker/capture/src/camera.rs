//! Pinhole cameras.
//!
//! The convention of all crates: OpenCV axes (x right, y down, z forward), world to camera, pixel
//! centres at +0.5, metres. Conversions from the wire and from a pose track check lengths and values,
//! so the code behind them need not.

pub use crate::skeleton::Pose;

use crate::skeleton::transform::{Mat34, Vec3, cross, dot, normalised, sub};
use crate::view_error::{ViewError, finite, fixed};
use serde::{Deserialize, Serialize};
use yoto_proto::{pose_track, v1};

/// A pinhole camera without distortion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Intrinsics, pixels: `[[fx, skew, cx], [0, fy, cy], [0, 0, 1]]`.
    pub k: [[f64; 3]; 3],
    /// World to camera, metres: `x_cam = e * x_world`.
    pub e: [[f64; 4]; 4],
}

/// The size of a `width` x `height` image after its longest side is reduced to `longest_side`. The size
/// stays the same if `longest_side` is 0 or not shorter than the image's.
///
/// Images and cameras share this rule: two different roundings would shift every ray.
pub fn fitted_size(width: u32, height: u32, longest_side: u32) -> (u32, u32) {
    let longest = width.max(height);
    if longest_side == 0 || longest_side >= longest {
        return (width, height);
    }
    let scale = f64::from(longest_side) / f64::from(longest);
    let fit = |side: u32| ((f64::from(side) * scale).round() as u32).max(1);
    (fit(width), fit(height))
}

impl Camera {
    /// A checked camera; `field` prefixes the names in errors (empty for none).
    fn checked(self, field: &str) -> Result<Self, ViewError> {
        let path = |name: &str| format!("{field}{name}");
        let side = 1..=pose_track::MAX_SIDE;
        if !side.contains(&self.width) || !side.contains(&self.height) {
            return Err(ViewError::new(
                path("size"),
                format!(
                    "{}x{}: each side must be 1 to {}",
                    self.width,
                    self.height,
                    pose_track::MAX_SIDE
                ),
            ));
        }
        finite(&path("intrinsics"), self.k.as_flattened(), 1e7)?;
        finite(
            &path("extrinsics"),
            self.e.as_flattened(),
            pose_track::MAX_METRES,
        )?;
        if !(self.k[0][0] > 0.0 && self.k[1][1] > 0.0) {
            return Err(ViewError::new(
                path("intrinsics"),
                "focal lengths must be above 0",
            ));
        }
        let rows: [Vec3; 3] = std::array::from_fn(|i| self.rotation_row(i));
        for i in 0..3 {
            for j in 0..3 {
                let expected = if i == j { 1.0 } else { 0.0 };
                let off = (dot(rows[i], rows[j]) - expected).abs();
                if off > 1e-3 {
                    return Err(ViewError::new(
                        path("extrinsics"),
                        format!("the upper 3x3 part is off orthonormal by {off:.3}"),
                    ));
                }
            }
        }
        Ok(self)
    }

    /// The camera of a request.
    ///
    /// # Errors
    /// A list of the wrong length, a value that is not a number, a focal length of 0 or less, a size out
    /// of range, or extrinsics that are not a rigid motion.
    pub fn from_proto(camera: &v1::Camera) -> Result<Self, ViewError> {
        let k: [f64; 9] = fixed("camera.intrinsics", &camera.intrinsics)?;
        let e: [f64; 16] = fixed("camera.extrinsics", &camera.extrinsics)?;
        Self {
            width: camera.width,
            height: camera.height,
            k: std::array::from_fn(|i| std::array::from_fn(|j| k[3 * i + j])),
            e: std::array::from_fn(|i| std::array::from_fn(|j| e[4 * i + j])),
        }
        .checked("camera.")
    }

    /// The message that [`Camera::from_proto`] reads back.
    pub fn to_proto(&self) -> v1::Camera {
        v1::Camera {
            width: self.width,
            height: self.height,
            intrinsics: self.k.as_flattened().to_vec(),
            extrinsics: self.e.as_flattened().to_vec(),
        }
    }

    /// The camera of `frame`, for images of `image_size` (width, height).
    ///
    /// # Errors
    /// The same errors as [`Camera::from_proto`].
    pub fn from_frame(frame: &pose_track::Frame, image_size: [u32; 2]) -> Result<Self, ViewError> {
        Self::from_matrices(image_size, frame.k, frame.e)
    }

    /// A camera from its size (width, height), intrinsics and extrinsics.
    ///
    /// # Errors
    /// The same errors as [`Camera::from_proto`].
    pub fn from_matrices(
        size: [u32; 2],
        k: [[f64; 3]; 3],
        e: [[f64; 4]; 4],
    ) -> Result<Self, ViewError> {
        let [width, height] = size;
        Self {
            width,
            height,
            k,
            e,
        }
        .checked("")
    }

    /// The pose-track entry of frame `index`, with this camera and `pose`.
    pub fn to_frame(&self, index: u32, pose: &Pose) -> pose_track::Frame {
        pose_track::Frame {
            index,
            pose: pose
                .rotations
                .as_flattened()
                .iter()
                .map(|&v| f64::from(v))
                .collect(),
            translation: pose.translation.map(f64::from),
            k: self.k,
            e: self.e,
        }
    }

    /// A camera at `eye` that looks at `target`, with `up` (world) upwards in the image and
    /// the principal point in the image's middle. `focal_px` in pixels.
    ///
    /// `eye` and `target` must differ and `up` must not point along the line between them.
    pub fn look_at(
        eye: Vec3,
        target: Vec3,
        up: Vec3,
        focal_px: f64,
        width: u32,
        height: u32,
    ) -> Self {
        let forward = normalised(sub(target, eye));
        let right = normalised(cross(forward, up));
        let down = cross(forward, right);
        let row = |axis: Vec3| [axis[0], axis[1], axis[2], -dot(axis, eye)];
        Self {
            width,
            height,
            k: [
                [focal_px, 0.0, f64::from(width) / 2.0],
                [0.0, focal_px, f64::from(height) / 2.0],
                [0.0, 0.0, 1.0],
            ],
            e: [row(right), row(down), row(forward), [0.0, 0.0, 0.0, 1.0]],
        }
    }

    /// This view in an image of another size. Each axis has a scale of its own, since each side is
    /// rounded by itself. As pixel centres are at +0.5, the intrinsics need no shift.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let scale = [
            f64::from(width) / f64::from(self.width),
            f64::from(height) / f64::from(self.height),
            1.0,
        ];
        let k = std::array::from_fn(|i| self.k[i].map(|value| value * scale[i]));
        Self {
            width,
            height,
            k,
            e: self.e,
        }
    }

    /// This view with its longest side reduced to `longest_side` pixels, as in [`fitted_size`]: 0
    /// changes nothing, and images never grow.
    pub fn scaled_to(&self, longest_side: u32) -> Self {
        let (width, height) = fitted_size(self.width, self.height, longest_side);
        self.resized(width, height)
    }

    fn rotation_row(&self, row: usize) -> Vec3 {
        let [x, y, z, _] = self.e[row];
        [x, y, z]
    }

    /// `Rᵀ v`: from camera axes to world axes.
    fn to_world_axes(&self, v: Vec3) -> Vec3 {
        std::array::from_fn(|i| (0..3).map(|j| self.e[j][i] * v[j]).sum())
    }

    /// The camera's position in the world, metres: `-Rᵀ t`.
    pub fn centre(&self) -> Vec3 {
        self.to_world_axes(std::array::from_fn(|i| -self.e[i][3]))
    }

    /// Origin and direction of the ray through pixel coordinate (u, v), in the world. A pixel's centre is
    /// at column + 0.5, row + 0.5. The direction's camera z is 1, so distances along the ray are camera
    /// depths in metres.
    pub fn ray(&self, u: f64, v: f64) -> (Vec3, Vec3) {
        (self.centre(), self.direction(u, v))
    }

    /// The direction of [`Camera::ray`].
    pub fn direction(&self, u: f64, v: f64) -> Vec3 {
        let y = (v - self.k[1][2]) / self.k[1][1];
        let x = (u - self.k[0][2] - self.k[0][1] * y) / self.k[0][0];
        self.to_world_axes([x, y, 1.0])
    }

    /// The world axis nearest to the camera's up. A pose track does not say which axis is up, but people
    /// stand upright in pictures.
    pub fn world_up(&self) -> Vec3 {
        let down = self.e[1];
        let longest = |a: usize, b: usize| if down[b].abs() > down[a].abs() { b } else { a };
        let axis = longest(longest(0, 1), 2);
        let mut up = [0.0; 3];
        up[axis] = -down[axis].signum();
        up
    }

    /// Whether the world is this camera's: it stands on the origin, and its axes are the world's or their opposites.
    pub fn is_the_world(&self) -> bool {
        let rows = self.e.iter().take(3).enumerate();
        let mut parts =
            rows.flat_map(|(i, row)| row.iter().enumerate().map(move |(j, e)| (i == j, e.abs())));
        parts.all(|(is_diagonal, part)| (part - f64::from(u8::from(is_diagonal))).abs() < 1e-6)
    }

    /// This camera with another frame as its world; `to_world` leads from that frame to this world.
    pub fn in_frame(&self, to_world: &Mat34) -> Self {
        let e = &self.e;
        let row = |i: usize| -> [f64; 4] {
            std::array::from_fn(|j| {
                let moved: f64 = (0..3).map(|c| e[i][c] * to_world[c][j]).sum();
                if j == 3 { e[i][3] + moved } else { moved }
            })
        };
        Self {
            e: [row(0), row(1), row(2), e[3]],
            ..self.clone()
        }
    }

    /// Pixel coordinate of a world point; `None` for a point at or behind the camera.
    pub fn project(&self, point: Vec3) -> Option<[f64; 2]> {
        let [x, y, z]: Vec3 =
            std::array::from_fn(|i| dot(self.rotation_row(i), point) + self.e[i][3]);
        if z <= 1e-9 {
            return None;
        }
        let (x, y) = (x / z, y / z);
        Some([
            self.k[0][0] * x + self.k[0][1] * y + self.k[0][2],
            self.k[1][1] * y + self.k[1][2],
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera::look_at(
            [1.0, 1.5, 3.0],
            [0.0, 0.9, 0.0],
            [0.0, 1.0, 0.0],
            300.0,
            200,
            101,
        )
    }

    #[test]
    fn a_ray_through_a_projection_hits_the_point() {
        let point = [0.3, 0.5, -0.2];
        let [u, v] = camera().project(point).expect("in front");
        let (origin, direction) = camera().ray(u, v);
        let depth = dot(camera().rotation_row(2), sub(point, origin));
        for i in 0..3 {
            assert!((origin[i] + depth * direction[i] - point[i]).abs() < 1e-12);
        }
        assert!((dot(camera().rotation_row(2), direction) - 1.0).abs() < 1e-12);
        assert_eq!(camera().project([2.0, 2.1, 6.0]), None);
    }

    #[test]
    fn look_at_centres_its_target_and_shows_up_upwards() {
        let target = camera().project([0.0, 0.9, 0.0]).expect("in front");
        assert!((target[0] - 100.0).abs() < 1e-9 && (target[1] - 50.5).abs() < 1e-9);
        let above = camera().project([0.0, 1.2, 0.0]).expect("in front");
        assert!(above[1] < 40.0, "{above:?}");
        let straight = Camera::look_at([0.0, 1.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0], 9.0, 8, 8);
        let right = straight.project([1.0, 0.0, 0.0]).expect("in front");
        assert!(right[0] > 4.0, "world +x is on the right when seen from +z");
    }

    #[test]
    fn a_camera_is_the_world_only_from_its_origin_along_its_axes() {
        let mut own = camera();
        assert!(!own.is_the_world());
        own.e = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
        assert!(own.is_the_world());
        own.e[1][1] = -1.0;
        own.e[2][2] = -1.0;
        assert!(own.is_the_world(), "y and z the other way");
        own.e[2][3] = 3.0;
        assert!(!own.is_the_world(), "it stands elsewhere");
    }

    #[test]
    fn scaling_keeps_the_view() {
        let small = camera().scaled_to(77);
        assert_eq!((small.width, small.height), (77, 39));
        let (_, full) = camera().ray(200.0, 101.0);
        let (_, scaled) = small.ray(77.0, 39.0);
        for i in 0..3 {
            assert!((full[i] - scaled[i]).abs() < 1e-12);
        }
        assert_eq!(camera().scaled_to(0), camera());
        assert_eq!(camera().scaled_to(4096), camera());
    }

    #[test]
    fn messages_come_back_and_faults_are_named() {
        let camera = camera();
        assert_eq!(Camera::from_proto(&camera.to_proto()), Ok(camera.clone()));
        let pose = Pose::rest(2);
        let frame = camera.to_frame(3, &pose);
        assert_eq!(Pose::from_frame(&frame), Ok(pose.clone()));
        assert_eq!(Camera::from_frame(&frame, [200, 101]), Ok(camera.clone()));

        let mut broken = camera.to_proto();
        broken.extrinsics.pop();
        let error = Camera::from_proto(&broken).expect_err("15 numbers");
        assert_eq!(
            error.to_string(),
            "camera.extrinsics: 15 numbers, 16 are needed"
        );
        let mut broken = camera.to_proto();
        broken.extrinsics[0] = 2.0;
        assert!(Camera::from_proto(&broken).is_err());
        let mut broken = camera.to_proto();
        broken.intrinsics[4] = f64::NAN;
        let error = Camera::from_proto(&broken).expect_err("NaN");
        assert_eq!(error.field, "camera.intrinsics[4]");
    }
}
