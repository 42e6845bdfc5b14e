//! Files of Gaussian splats.
//!
//! - [`ply`]: the format of the original 3D Gaussian splatting; every viewer reads it.
//! - [`spz`]: a sixteenth of that size, or a larger share for splats with harmonics.
//! - [`glb`]: glTF, with which splats can be part of scenes.

pub mod glb;
pub mod ply;
pub mod spz;

/// A Gaussian in space, in metres, with x to the right, y up and z towards the viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Mean.
    pub mean: [f32; 3],
    /// Rotation as a unit quaternion, real part first.
    pub rotation: [f32; 4],
    /// Standard deviations along the rotated axes.
    pub deviations: [f32; 3],
    /// Opacity at the mean, 0 to 1.
    pub opacity: f32,
    /// sRGB colour, 0 to 1 each, without the view-dependent part.
    pub colour: [f32; 3],
    /// Coefficients of the spherical harmonics of degree 1 and 2 in the direction from the camera, with the signs and
    /// the order of 3D Gaussian splatting.
    pub harmonics: [[f32; 3]; HARMONICS],
}

/// Number of spherical harmonics of degree 1 and 2.
pub const HARMONICS: usize = 8;

/// The spherical harmonic of degree 0: a colour is 0.5 plus this times its coefficient.
const HARMONIC: f32 = 0.282_094_8;

impl Gaussian {
    /// Coefficients of the spherical harmonic of degree 0.
    fn harmonic(&self) -> [f32; 3] {
        self.colour.map(|value| (value - 0.5) / HARMONIC)
    }
}

/// Number of harmonics above degree 0 that a file of `splats` needs: 0, 3 or 8.
fn harmonics(splats: &[Gaussian]) -> usize {
    let last = |splat: &Gaussian| splat.harmonics.iter().rposition(|it| *it != [0.0; 3]);
    match splats.iter().filter_map(last).max() {
        None => 0,
        Some(0..3) => 3,
        Some(_) => HARMONICS,
    }
}
