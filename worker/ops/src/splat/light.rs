//! Light on a surface: each colour channel is multiplied by 1 + Σ lᵢ bᵢ(n), where n is the unit normal in the
//! world and bᵢ are the real spherical harmonics of degree 1 and 2, not normalised. Diffuse surfaces under
//! distant light need no higher degrees (Ramamoorthi and Hanrahan, "An efficient representation for
//! irradiance environment maps", 2001). There is no constant term: the colour itself is one.

/// Number of terms bᵢ.
pub const LIGHTS: usize = 8;

/// The terms bᵢ at the unit vector n.
#[inline(always)]
pub fn terms([x, y, z]: [f32; 3]) -> [f32; LIGHTS] {
    [
        x,
        y,
        z,
        x * y,
        y * z,
        z * x,
        x * x - y * y,
        3.0 * z * z - 1.0,
    ]
}

/// Gradient to n, from the gradient `to` its terms: Σ toᵢ ∂bᵢ/∂n.
#[inline(always)]
pub(super) fn terms_backward([x, y, z]: [f32; 3], to: [f32; LIGHTS]) -> [f32; 3] {
    [
        to[0] + to[3] * y + to[5] * z + 2.0 * to[6] * x,
        to[1] + to[3] * x + to[4] * z - 2.0 * to[6] * y,
        to[2] + to[4] * y + to[5] * x + 6.0 * to[7] * z,
    ]
}
