//! A rigged mesh as an actor: posed by linear blend skinning and rendered with a depth buffer.

use rayon::prelude::*;
use yoto_body::learn::BodyMesh;
use yoto_capture::FrameImage;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::transform::{apply, sub};
use yoto_capture::skeleton::{Skeleton, Vec3};

/// Samples per pixel and axis.
const SAMPLES: usize = 3;

/// The picture of `mesh` in `pose`, premultiplied by coverage. `skeleton` has the mesh's joints.
pub(super) fn render(
    mesh: &BodyMesh,
    skeleton: &Skeleton,
    pose: &Pose,
    camera: &Camera,
) -> FrameImage {
    let transforms = skeleton.world_transforms(pose);
    let skinned = |i: usize| -> Vec3 {
        // x' = Σ w (R (x − rest) + t)
        let at = mesh.vertices[i].map(f64::from);
        let mut sum = [0.0; 3];
        for (bone, weight) in mesh.bones[i].iter().zip(mesh.weights[i]) {
            let bone = usize::from(*bone);
            let moved = apply(&transforms[bone], sub(at, skeleton.rest[bone]));
            for (sum, moved) in sum.iter_mut().zip(moved) {
                *sum += f64::from(weight) * moved;
            }
        }
        sum
    };
    let fine = camera.resized(
        camera.width * SAMPLES as u32,
        camera.height * SAMPLES as u32,
    );
    let project = |i: usize| -> Option<[f32; 3]> {
        let at = skinned(i);
        let depth: f64 = (0..3).map(|c| fine.e[2][c] * at[c]).sum::<f64>() + fine.e[2][3];
        let [u, v] = fine.project(at)?;
        Some([u as f32, v as f32, depth as f32])
    };
    let placed: Vec<Option<[f32; 3]>> = (0..mesh.vertices.len())
        .into_par_iter()
        .map(project)
        .collect();
    let (width, height) = (fine.width as usize, fine.height as usize);
    let mut buffer = Buffer {
        width,
        depth: vec![f32::INFINITY; width * height],
        rgb: vec![[0.0; 3]; width * height],
    };
    for face in &mesh.faces {
        let [a, b, c] = face.map(|vertex| placed[vertex as usize]);
        if let (Some(a), Some(b), Some(c)) = (a, b, c) {
            let colours = face.map(|vertex| mesh.colours[vertex as usize]);
            buffer.add([a, b, c], colours);
        }
    }
    buffer.picture(camera.width as usize, camera.height as usize)
}

/// The nearest surface at each sample.
struct Buffer {
    width: usize,
    depth: Vec<f32>,
    rgb: Vec<[f32; 3]>,
}

impl Buffer {
    /// Draws a triangle with the `[u, v, depth]` and colours of its corners.
    fn add(&mut self, [a, b, c]: [[f32; 3]; 3], colours: [[f32; 3]; 3]) {
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area.abs() < 1e-9 {
            return;
        }
        let height = self.depth.len() / self.width.max(1);
        let range = |axis: usize, size: usize| {
            let least = a[axis].min(b[axis]).min(c[axis]);
            let most = a[axis].max(b[axis]).max(c[axis]);
            (least - 0.5).max(0.0) as usize..((most + 0.5).max(0.0) as usize).min(size)
        };
        for row in range(1, height) {
            for column in range(0, self.width) {
                let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
                let share = |p: [f32; 3], q: [f32; 3]| {
                    ((p[0] - x) * (q[1] - y) - (p[1] - y) * (q[0] - x)) / area
                };
                let shares = [share(b, c), share(c, a), share(a, b)];
                if shares.iter().any(|share| *share < 0.0) {
                    continue;
                }
                let depth = shares[0] * a[2] + shares[1] * b[2] + shares[2] * c[2];
                let sample = row * self.width + column;
                if depth < self.depth[sample] {
                    self.depth[sample] = depth;
                    self.rgb[sample] = std::array::from_fn(|k| {
                        (0..3)
                            .map(|corner| shares[corner] * colours[corner][k])
                            .sum()
                    });
                }
            }
        }
    }

    /// The mean of the samples of each pixel.
    fn picture(&self, width: usize, height: usize) -> FrameImage {
        let mut picture = FrameImage::empty(width, height);
        let samples = (SAMPLES * SAMPLES) as f32;
        for pixel in 0..width * height {
            let (x, y) = (pixel % width * SAMPLES, pixel / width * SAMPLES);
            let (mut sum, mut covered) = ([0f32; 3], 0f32);
            for (dy, dx) in (0..SAMPLES).flat_map(|dy| (0..SAMPLES).map(move |dx| (dy, dx))) {
                let sample = (y + dy) * self.width + x + dx;
                if self.depth[sample].is_finite() {
                    covered += 1.0;
                    for (sum, value) in sum.iter_mut().zip(self.rgb[sample]) {
                        *sum += value;
                    }
                }
            }
            let byte = |value: f32| (255.0 * value / samples).round().clamp(0.0, 255.0) as u8;
            picture.mask[pixel] = byte(covered);
            for (to, value) in picture.rgb[3 * pixel..3 * pixel + 3].iter_mut().zip(sum) {
                *to = byte(value);
            }
        }
        picture
    }
}
