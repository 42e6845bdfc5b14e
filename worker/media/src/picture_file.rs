//! 8-bit colour pictures on disk, with errors that name the file: for pictures of this program, not for uploads.

use image::{ImageFormat, RgbImage};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The reason why a picture can't be read or written.
#[derive(Debug, Error)]
pub enum PictureError {
    /// The file could not be decoded or encoded.
    #[error("{action} {path}")]
    File {
        /// E.g. "reading".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The error of the codec or the system.
        source: image::ImageError,
    },
    /// Pixels and size don't match, which is a defect of the caller.
    #[error("{what} has {found} bytes, a {width}x{height} picture needs {expected}")]
    Size {
        /// The picture.
        what: String,
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
        /// Bytes needed.
        expected: usize,
        /// Bytes found.
        found: usize,
    },
}

/// A picture of `rgb` (`height * width * 3`, row by row).
///
/// # Errors
/// When the pixels don't fit the size.
pub fn rgb(what: &str, width: usize, height: usize, rgb: &[u8]) -> Result<RgbImage, PictureError> {
    let found = rgb.len();
    RgbImage::from_raw(width as u32, height as u32, rgb.to_vec()).ok_or_else(|| {
        PictureError::Size {
            what: what.to_owned(),
            width,
            height,
            expected: 3 * width * height,
            found,
        }
    })
}

/// Reads an 8-bit colour picture.
///
/// # Errors
/// When the file can't be read or decoded.
pub fn read(path: &Path) -> Result<RgbImage, PictureError> {
    let file_error = |source| PictureError::File {
        action: "reading",
        path: path.to_owned(),
        source,
    };
    Ok(image::open(path).map_err(file_error)?.into_rgb8())
}

/// Writes a colour picture as PNG, and creates its folder.
///
/// # Errors
/// When the file can't be written.
pub fn write(path: &Path, picture: &RgbImage) -> Result<(), PictureError> {
    let file_error = |source| PictureError::File {
        action: "writing",
        path: path.to_owned(),
        source,
    };
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)
            .map_err(|error| file_error(image::ImageError::IoError(error)))?;
    }
    picture
        .save_with_format(path, ImageFormat::Png)
        .map_err(file_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_survive_the_disk() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let path = dir.path().join("a/b.png");
        let picture = rgb("noise", 3, 2, &(0..18).collect::<Vec<u8>>()).expect("fits");
        write(&path, &picture).expect("writes");
        assert_eq!(read(&path).expect("reads"), picture);
    }

    #[test]
    fn a_file_that_is_no_picture_is_named() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let path = dir.path().join("x.png");
        std::fs::write(&path, b"no picture").expect("writes");
        assert!(
            read(&path)
                .expect_err("no picture")
                .to_string()
                .contains("x.png")
        );
        assert!(rgb("r", 3, 2, &[0; 17]).is_err());
    }
}
