//! Files of Gaussian splats.
//!
//! - [`ply`]: as the program of 3D Gaussian splatting writes them; every viewer reads them.
//! - [`spz`]: a sixteenth of the size, less where splats have harmonics.
//! - [`glb`]: glTF, beside meshes and scenes.

pub mod glb;
pub mod ply;
pub mod spz;

/// A Gaussian in space, in metres, with x to the right, y up and z towards the viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Its middle.
    pub mean: [f32; 3],
    /// Unit quaternion, real part first.
    pub turn: [f32; 4],
    /// Standard deviations along the turned axes.
    pub deviations: [f32; 3],
    /// 0 to 1, at the middle.
    pub opacity: f32,
    /// 0 to 1 each, as a screen shows them; without what the view adds.
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

/// Number of harmonics of the degrees above 0 that any of `splats` has: 0, 3 or 8. Files have no more than that.
fn harmonics(splats: &[Gaussian]) -> usize {
    let last = |splat: &Gaussian| splat.harmonics.iter().rposition(|it| *it != [0.0; 3]);
    match splats.iter().filter_map(last).max() {
        None => 0,
        Some(0..3) => 3,
        Some(_) => HARMONICS,
    }
}
