//! Pictures of splats in double precision, by the equations: one pixel after the other, without tensors and without
//! tiles.

use yoto_ops::splat::{LOW_PASS, MAX_ALPHA, MIN_ALPHA, NEAR, View};

/// Numbers per splat: transform, mean, rotation, scales, opacity, colour.
pub(crate) const ROW: usize = 26;

type V3 = [f64; 3];

fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A projected splat.
struct Projected {
    depth: f64,
    at: [f64; 2],
    /// xx, xy, yy.
    covariance: V3,
    determinant: f64,
    opacity: f64,
    colour: V3,
}

impl Projected {
    /// Whether it is in front of the camera, opaque enough to show, and finite.
    fn is_drawn(&self) -> bool {
        let numbers = self.at.iter().chain(&self.covariance).chain(&self.colour);
        self.depth > f64::from(NEAR)
            && self.opacity > f64::from(MIN_ALPHA)
            && numbers.copied().all(f64::is_finite)
    }

    /// Opacity at a pixel.
    fn alpha(&self, pixel: [f64; 2]) -> f64 {
        let [dx, dy] = [0, 1].map(|axis| pixel[axis] - self.at[axis]);
        let [xx, xy, yy] = self.covariance;
        let power = (dx * dx * yy - 2.0 * dx * dy * xy + dy * dy * xx) / self.determinant;
        let alpha = (self.opacity * (-0.5 * power).exp()).min(f64::from(MAX_ALPHA));
        if alpha < f64::from(MIN_ALPHA) {
            0.0
        } else {
            alpha
        }
    }
}

/// The projection of the splat with the numbers `row`.
fn project(row: &[f64], light: &[f64], view: &View) -> Projected {
    let (t, rest) = row.split_at(12);
    let linear = |r: usize| -> V3 { [t[4 * r], t[4 * r + 1], t[4 * r + 2]] };
    let mean = [rest[0], rest[1], rest[2]];
    let to_camera = |v: V3, shift: f64| -> V3 {
        std::array::from_fn(|r| {
            let [a, b, c, d] = view.e[r].map(f64::from);
            dot([a, b, c], v) + shift * d
        })
    };
    let body = std::array::from_fn(|r| dot(linear(r), mean) + t[4 * r + 3]);
    let [x, y, depth] = to_camera(body, 1.0);
    let rotation = &rest[3..7];
    // A quaternion without length turns nothing.
    let length = rotation.iter().map(|v| v * v).sum::<f64>().sqrt();
    let length = length.max(f64::MIN_POSITIVE);
    let [w, i, j, k] = [0, 1, 2, 3].map(|at| rotation[at] / length);
    let axes = [
        [
            1.0 - 2.0 * (j * j + k * k),
            2.0 * (i * j + w * k),
            2.0 * (i * k - w * j),
        ],
        [
            2.0 * (i * j - w * k),
            1.0 - 2.0 * (i * i + k * k),
            2.0 * (j * k + w * i),
        ],
        [
            2.0 * (i * k + w * j),
            2.0 * (j * k - w * i),
            1.0 - 2.0 * (i * i + j * j),
        ],
    ];
    let in_body = |axis: V3| -> V3 { std::array::from_fn(|r| dot(linear(r), axis)) };
    let [[fx, skew, cx], [_, fy, cy]] = view.k.map(|row| row.map(f64::from));
    // The three axes in the picture, pixels.
    let arms = [0, 1, 2].map(|axis: usize| {
        let [a, b, c] = to_camera(in_body(axes[axis]), 0.0);
        let deviation = rest[7 + axis].exp();
        let across = (fx * a + skew * b) / depth - (fx * x + skew * y) / (depth * depth) * c;
        let down = fy * b / depth - fy * y / (depth * depth) * c;
        [across * deviation, down * deviation]
    });
    let sum = |p: usize, q: usize| arms.iter().map(|arm| arm[p] * arm[q]).sum::<f64>();
    let low_pass = f64::from(LOW_PASS);
    let [xx, xy, yy] = [sum(0, 0) + low_pass, sum(0, 1), sum(1, 1) + low_pass];
    // The sum of squared minors: even in double precision, the difference of two products loses a needle's.
    let minor = |p: usize, q: usize| arms[p][0] * arms[q][1] - arms[p][1] * arms[q][0];
    let minors = [minor(0, 1), minor(1, 2), minor(2, 0)];
    let trace = sum(0, 0) + sum(1, 1);
    let determinant = dot(minors, minors) + low_pass * trace + low_pass * low_pass;
    let normal = in_body(axes[2]);
    let long = dot(normal, normal).sqrt();
    let [nx, ny, nz]: V3 =
        std::array::from_fn(|r| dot(view.world[r].map(f64::from), normal) / long);
    let terms = [
        nx,
        ny,
        nz,
        nx * ny,
        ny * nz,
        nz * nx,
        nx * nx - ny * ny,
        3.0 * nz * nz - 1.0,
    ];
    let lit = |c: usize| 1.0 + (0..8).map(|at| light[8 * c + at] * terms[at]).sum::<f64>();
    Projected {
        depth,
        at: [(fx * x + skew * y) / depth + cx, fy * y / depth + cy],
        covariance: [xx, xy, yy],
        determinant,
        opacity: 1.0 / (1.0 + (-rest[10]).exp()),
        colour: std::array::from_fn(|c| rest[11 + c] * lit(c)),
    }
}

/// The picture `[H W, 4]` of the splats with these numbers.
pub(crate) fn picture(rows: &[f64], light: &[f64], view: &View) -> Vec<f64> {
    let projected = rows.chunks(ROW).map(|row| project(row, light, view));
    let mut projected: Vec<Projected> = projected.filter(Projected::is_drawn).collect();
    projected.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    let pixels = (0..view.width * view.height).flat_map(|pixel| {
        let centre = [pixel % view.width, pixel / view.width].map(|v| v as f64 + 0.5);
        let (mut transmittance, mut seen) = (1.0, [0.0; 4]);
        for splat in &projected {
            let alpha = splat.alpha(centre);
            for (seen, colour) in seen.iter_mut().zip(splat.colour.into_iter().chain([1.0])) {
                *seen += transmittance * alpha * colour;
            }
            transmittance *= 1.0 - alpha;
        }
        seen
    });
    pixels.collect()
}

/// The sum over the picture, weighted by `towards` `[H W, 4]`.
pub(crate) fn sum(rows: &[f64], light: &[f64], view: &View, towards: &[f32]) -> f64 {
    let seen = picture(rows, light, view);
    let products = seen.iter().zip(towards).map(|(a, b)| a * f64::from(*b));
    products.sum()
}
