//! PNG files: single pictures and animations, encoded quickly.

mod animation;
mod still;

pub use animation::{Animation, MAX_FPS};
pub use still::{decode, encode};

use thiserror::Error;

/// The reason why a picture could not be encoded or decoded.
#[derive(Debug, Error)]
pub enum PngError {
    /// The pixels don't fit the picture's size.
    #[error("{found} bytes of pixels for a {width}x{height} picture, which needs {expected}")]
    Size {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// Bytes needed.
        expected: usize,
        /// Bytes given.
        found: usize,
    },
    /// Frame rate out of range.
    #[error("{0} frames per second is not between 0 and {max}", max = MAX_FPS)]
    Fps(f32),
    /// The encoder refused.
    #[error("a PNG could not be written")]
    Encode(#[from] ::png::EncodingError),
    /// The bytes are no picture.
    #[error("a committed picture can't be read")]
    Decode(#[from] image::ImageError),
}

/// Kinds of pixels, 8 bits per channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pixels {
    /// Red, green, blue.
    Rgb,
    /// Red, green, blue, opacity.
    Rgba,
}

impl Pixels {
    fn colour(self) -> ::png::ColorType {
        match self {
            Self::Rgb => ::png::ColorType::Rgb,
            Self::Rgba => ::png::ColorType::Rgba,
        }
    }
}

fn check_size(kind: Pixels, width: u32, height: u32, pixels: &[u8]) -> Result<(), PngError> {
    let expected = width as usize * height as usize * kind.colour().samples();
    if pixels.len() == expected {
        return Ok(());
    }
    Err(PngError::Size {
        width,
        height,
        expected,
        found: pixels.len(),
    })
}
