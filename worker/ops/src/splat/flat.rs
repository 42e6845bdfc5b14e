//! One splat in the picture, and the gradient back from there.

use super::light::{LIGHTS, pull, terms};
use super::{LEAST, LOW_PASS, NEAR, Sight};

type Vec3 = [f32; 3];
type Mat3 = [[f32; 3]; 3];

/// Smallest determinant of a covariance, pixels⁴.
pub(super) const MIN_DETERMINANT: f32 = 1e-8;

/// A splat's numbers.
#[derive(Clone, Copy)]
pub(super) struct Splat<'a> {
    pub transform: &'a [f32; 12],
    pub mean: Vec3,
    pub turn: [f32; 4],
    pub scale: Vec3,
    pub opacity: f32,
    pub colour: Vec3,
}

/// A splat in the picture. One that is behind the camera or too clear has no opacity.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Flat {
    /// Centre, pixels.
    pub centre: [f32; 2],
    /// Inverse covariance: xx, xy, yy, 1/pixels².
    pub conic: Vec3,
    /// Opacity at the centre.
    pub opacity: f32,
    /// Lit colour.
    pub colour: Vec3,
    /// Distance along the camera's axis, metres.
    pub depth: f32,
    /// Farthest offsets along x and y with an opacity of [`LEAST`], pixels.
    pub reach: [f32; 2],
}

/// Gradient to a [`Flat`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FlatGradient {
    pub centre: [f32; 2],
    pub conic: Vec3,
    pub opacity: f32,
    pub colour: Vec3,
}

impl FlatGradient {
    /// Adds another.
    pub fn add(&mut self, other: &Self) {
        for a in 0..2 {
            self.centre[a] += other.centre[a];
        }
        for a in 0..3 {
            self.conic[a] += other.conic[a];
            self.colour[a] += other.colour[a];
        }
        self.opacity += other.opacity;
    }
}

/// Gradient to a splat's numbers, and to the light.
pub(super) struct SplatGradient {
    pub transform: [f32; 12],
    pub mean: Vec3,
    pub turn: [f32; 4],
    pub scale: Vec3,
    pub opacity: f32,
    pub colour: Vec3,
    pub light: [[f32; LIGHTS]; 3],
}

/// What both directions compute.
struct Lifted {
    /// Body frame to camera of the splat: rows of E A.
    place: [[f32; 4]; 3],
    /// Camera coordinates, metres.
    at: Vec3,
    turn: Mat3,
    unit: [f32; 4],
    length: f32,
    deviations: Vec3,
    /// E A R S.
    axes: Mat3,
    jacobian: [Vec3; 2],
    /// J E A R S.
    flat: [Vec3; 2],
    /// A R e₃, not normalised, in the body frame, and its length.
    normal: Vec3,
    normal_length: f32,
    /// Unit normal in the world.
    world: Vec3,
    conic: Vec3,
}

#[inline(always)]
fn dot(a: Vec3, b: Vec3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Column `c` of a matrix.
#[inline(always)]
fn column(m: &Mat3, c: usize) -> Vec3 {
    [m[0][c], m[1][c], m[2][c]]
}

/// Row `r` of the linear part of a 3x4 transform.
#[inline(always)]
fn row(t: &[f32; 12], r: usize) -> Vec3 {
    [t[4 * r], t[4 * r + 1], t[4 * r + 2]]
}

#[inline(always)]
fn logistic(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

#[inline(always)]
fn lift(splat: &Splat<'_>, sight: &Sight) -> Lifted {
    let t = splat.transform;
    let place: [[f32; 4]; 3] = std::array::from_fn(|i| {
        let [a, b, c, shift] = sight.e[i];
        let moved = |j: usize| a * t[j] + b * t[4 + j] + c * t[8 + j];
        [moved(0), moved(1), moved(2), moved(3) + shift]
    });
    let linear: Mat3 = place.map(|[a, b, c, _]| [a, b, c]);
    let at: Vec3 = std::array::from_fn(|i| dot(linear[i], splat.mean) + place[i][3]);
    let [a, b, c, d] = splat.turn;
    let length = (a * a + b * b + c * c + d * d).sqrt();
    let unit = splat.turn.map(|q| q / length.max(f32::MIN_POSITIVE));
    let turn = rotation(unit);
    let deviations = splat.scale.map(f32::exp);
    let axes: Mat3 = std::array::from_fn(|i| {
        std::array::from_fn(|j| deviations[j] * dot(linear[i], column(&turn, j)))
    });
    let ([x, y, _], z) = (at, at[2].max(NEAR));
    let [[fx, skew, _], [_, fy, _]] = sight.k;
    let jacobian = [
        [fx / z, skew / z, -(fx * x + skew * y) / (z * z)],
        [0.0, fy / z, -fy * y / (z * z)],
    ];
    let flat: [Vec3; 2] =
        std::array::from_fn(|i| std::array::from_fn(|k| dot(jacobian[i], column(&axes, k))));
    let xx = dot(flat[0], flat[0]) + LOW_PASS;
    let xy = dot(flat[0], flat[1]);
    let yy = dot(flat[1], flat[1]) + LOW_PASS;
    let determinant = (xx * yy - xy * xy).max(MIN_DETERMINANT);
    let outward = column(&turn, 2);
    let normal: Vec3 = std::array::from_fn(|i| dot(row(t, i), outward));
    let normal_length = dot(normal, normal).sqrt().max(1e-6);
    let world = sight.world.map(|row| dot(row, normal) / normal_length);
    Lifted {
        place,
        at,
        turn,
        unit,
        length,
        deviations,
        axes,
        jacobian,
        flat,
        normal,
        normal_length,
        world,
        conic: [yy / determinant, -xy / determinant, xx / determinant],
    }
}

/// Factors of the light on each colour channel.
#[inline(always)]
fn shades(light: &[[f32; LIGHTS]; 3], world: Vec3) -> Vec3 {
    let terms = terms(world);
    light.map(|light| {
        let mut shade = 1.0;
        for (light, term) in light.iter().zip(&terms) {
            shade += light * term;
        }
        shade
    })
}

/// The splat in the picture.
#[inline(always)]
pub(super) fn flatten(splat: &Splat<'_>, light: &[[f32; LIGHTS]; 3], sight: &Sight) -> Flat {
    let opacity = logistic(splat.opacity);
    let lifted = lift(splat, sight);
    let [x, y, z] = lifted.at;
    // Also none for a NaN.
    let visible = opacity > LEAST && z > NEAR && lifted.conic.iter().all(|c| c.is_finite());
    if !visible {
        return Flat::default();
    }
    let [[fx, skew, cx], [_, fy, cy]] = sight.k;
    let [xx, xy, yy] = lifted.conic;
    let determinant = (xx * yy - xy * xy).max(f32::MIN_POSITIVE);
    // dᵀ Σ⁻¹ d at the edge.
    let edge = 2.0 * (opacity / LEAST).ln();
    let shades = shades(light, lifted.world);
    Flat {
        centre: [(fx * x + skew * y) / z + cx, fy * y / z + cy],
        conic: lifted.conic,
        opacity,
        colour: std::array::from_fn(|c| splat.colour[c] * shades[c]),
        depth: z,
        reach: [yy, xx].map(|other| (edge * other / determinant).sqrt()),
    }
}

/// The gradient to a visible splat, from that `to` its form in the picture.
#[inline(always)]
pub(super) fn unflatten(
    splat: &Splat<'_>,
    light: &[[f32; LIGHTS]; 3],
    sight: &Sight,
    to: &FlatGradient,
) -> SplatGradient {
    let lifted = lift(splat, sight);
    let opacity = logistic(splat.opacity);
    let mut found = SplatGradient {
        transform: [0.0; 12],
        mean: [0.0; 3],
        turn: [0.0; 4],
        scale: [0.0; 3],
        opacity: to.opacity * opacity * (1.0 - opacity),
        colour: [0.0; 3],
        light: [[0.0; LIGHTS]; 3],
    };
    let to_normal = pull_light(splat, light, sight, &lifted, to, &mut found);
    let to_flat = pull_conic(&lifted, to);
    let to_at = pull_projection(&lifted, sight, to, &to_flat);
    // J: rows of the picture, columns of the camera.
    let to_axes: Mat3 = std::array::from_fn(|c| {
        let (across, down) = (lifted.jacobian[0][c], lifted.jacobian[1][c]);
        std::array::from_fn(|k| across * to_flat[0][k] + down * to_flat[1][k])
    });
    let (mean, turn, deviations) = (splat.mean, &lifted.turn, lifted.deviations);
    // To E A, then to A; and to R S.
    let scaled: Mat3 = turn.map(|row| std::array::from_fn(|k| row[k] * deviations[k]));
    let to_place: [[f32; 4]; 3] = std::array::from_fn(|a| {
        let linear = |b: usize| to_at[a] * mean[b] + dot(to_axes[a], scaled[b]);
        [linear(0), linear(1), linear(2), to_at[a]]
    });
    for (r, to_row) in found
        .transform
        .as_chunks_mut::<4>()
        .0
        .iter_mut()
        .enumerate()
    {
        let e = [sight.e[0][r], sight.e[1][r], sight.e[2][r]];
        for (b, to) in to_row.iter_mut().enumerate() {
            *to = dot(e, [to_place[0][b], to_place[1][b], to_place[2][b]]);
        }
        for (to, axes) in to_row.iter_mut().zip(turn) {
            *to += to_normal[r] * axes[2];
        }
    }
    let linear: Mat3 = lifted.place.map(|[a, b, c, _]| [a, b, c]);
    found.mean = std::array::from_fn(|b| dot(column(&linear, b), to_at));
    let to_scaled: Mat3 = std::array::from_fn(|b| {
        std::array::from_fn(|k| dot(column(&linear, b), column(&to_axes, k)))
    });
    found.scale =
        std::array::from_fn(|k| deviations[k] * dot(column(&to_scaled, k), column(turn, k)));
    let mut to_turn: Mat3 = to_scaled.map(|row| std::array::from_fn(|k| row[k] * deviations[k]));
    let t = splat.transform;
    for (b, to_row) in to_turn.iter_mut().enumerate() {
        to_row[2] += dot([t[b], t[4 + b], t[8 + b]], to_normal);
    }
    found.turn = pull_rotation(&lifted, &to_turn);
    found
}

/// Gradients to colour and light, and to the normal in the body frame before its length is 1, which
/// is returned.
#[inline(always)]
fn pull_light(
    splat: &Splat<'_>,
    light: &[[f32; LIGHTS]; 3],
    sight: &Sight,
    lifted: &Lifted,
    to: &FlatGradient,
    found: &mut SplatGradient,
) -> Vec3 {
    let (terms, shades) = (terms(lifted.world), shades(light, lifted.world));
    let mut to_terms = [0f32; LIGHTS];
    for c in 0..3 {
        found.colour[c] = to.colour[c] * shades[c];
        let to_shade = to.colour[c] * splat.colour[c];
        for k in 0..LIGHTS {
            found.light[c][k] = to_shade * terms[k];
            to_terms[k] += to_shade * light[c][k];
        }
    }
    let to_world = pull(lifted.world, to_terms);
    let turned: Vec3 = std::array::from_fn(|c| dot(column(&sight.world, c), to_world));
    let unit = lifted.normal.map(|v| v / lifted.normal_length);
    let along = dot(turned, unit);
    std::array::from_fn(|c| (turned[c] - along * unit[c]) / lifted.normal_length)
}

/// Gradient to J E A R S, from that to the inverse of its square: dΣ = −Σ⁻¹ d(Σ⁻¹) Σ⁻¹.
#[inline(always)]
fn pull_conic(lifted: &Lifted, to: &FlatGradient) -> [Vec3; 2] {
    let [xx, xy, yy] = lifted.conic;
    let conic = [[xx, xy], [xy, yy]];
    let to_conic = [
        [to.conic[0], to.conic[1] / 2.0],
        [to.conic[1] / 2.0, to.conic[2]],
    ];
    let product = |a: [[f32; 2]; 2], b: [[f32; 2]; 2]| -> [[f32; 2]; 2] {
        a.map(|[x, y]| [x * b[0][0] + y * b[1][0], x * b[0][1] + y * b[1][1]])
    };
    let to_covariance = product(product(conic, to_conic), conic);
    to_covariance.map(|[x, y]| {
        std::array::from_fn(|k| -2.0 * (x * lifted.flat[0][k] + y * lifted.flat[1][k]))
    })
}

/// Gradient to the place in the camera's frame, through the centre and the Jacobian.
#[inline(always)]
fn pull_projection(lifted: &Lifted, sight: &Sight, to: &FlatGradient, to_flat: &[Vec3; 2]) -> Vec3 {
    let to_jacobian = |i: usize, c: usize| dot(to_flat[i], lifted.axes[c]);
    let [[fx, skew, _], [_, fy, _]] = sight.k;
    let ([x, y, _], z) = (lifted.at, lifted.at[2].max(NEAR));
    let [u, v] = to.centre;
    let across = fx * x + skew * y;
    let z2 = z * z;
    let (by_across, by_down) = (to_jacobian(0, 2), to_jacobian(1, 2));
    [
        u * fx / z - by_across * fx / z2,
        u * skew / z + v * fy / z - by_across * skew / z2 - by_down * fy / z2,
        -(u * across + v * fy * y) / z2
            - (to_jacobian(0, 0) * fx + to_jacobian(0, 1) * skew + to_jacobian(1, 1) * fy) / z2
            + 2.0 * (by_across * across + by_down * fy * y) / (z2 * z),
    ]
}

/// The rotation of a unit quaternion, real part first.
#[inline(always)]
fn rotation([w, x, y, z]: [f32; 4]) -> Mat3 {
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}

/// Gradient to a quaternion of any length, from that to its rotation.
#[inline(always)]
fn pull_rotation(lifted: &Lifted, to: &Mat3) -> [f32; 4] {
    let [w, x, y, z] = lifted.unit;
    let to_unit = [
        x * (to[2][1] - to[1][2]) + y * (to[0][2] - to[2][0]) + z * (to[1][0] - to[0][1]),
        y * (to[0][1] + to[1][0]) + z * (to[0][2] + to[2][0]) + w * (to[2][1] - to[1][2])
            - 2.0 * x * (to[1][1] + to[2][2]),
        x * (to[0][1] + to[1][0]) + z * (to[1][2] + to[2][1]) + w * (to[0][2] - to[2][0])
            - 2.0 * y * (to[0][0] + to[2][2]),
        x * (to[0][2] + to[2][0]) + y * (to[1][2] + to[2][1]) + w * (to[1][0] - to[0][1])
            - 2.0 * z * (to[0][0] + to[1][1]),
    ]
    .map(|v| 2.0 * v);
    let along = to_unit[0] * w + to_unit[1] * x + to_unit[2] * y + to_unit[3] * z;
    let length = lifted.length.max(f32::MIN_POSITIVE);
    std::array::from_fn(|k| (to_unit[k] - along * lifted.unit[k]) / length)
}
