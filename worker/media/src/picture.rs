//! A decoded picture.

/// 8-bit pixels, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `[height, width, 3]`.
    pub rgb: Vec<u8>,
    /// `[height, width]`, if the file has an alpha channel; the colours are not
    /// multiplied by it.
    pub alpha: Option<Vec<u8>>,
    /// Whether the file's compression changes colours slightly, as JPEG and video do.
    pub lossy: bool,
}

impl Picture {
    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }
}
