//! Files of Gaussian splats.
//!
//! - [`ply`]: as the program of 3D Gaussian splatting writes them; every viewer reads them.
//! - [`spz`]: a twelfth of the size.
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
    /// 0 to 1 each, as a screen shows them.
    pub colour: [f32; 3],
}

/// The spherical harmonic of degree 0: a colour is 0.5 plus this times its coefficient.
const HARMONIC: f32 = 0.282_094_8;

impl Gaussian {
    /// Coefficients of the spherical harmonic of degree 0.
    fn harmonic(&self) -> [f32; 3] {
        self.colour.map(|value| (value - 0.5) / HARMONIC)
    }
}
