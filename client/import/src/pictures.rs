//! Pictures of a capture, and their decoding.

use crate::ImportError;
use crate::capture_frames::CaptureFrames;
#[cfg(feature = "hdf5")]
use crate::source::hdf5::MaskStack;
use image::{GrayImage, ImageReader, Limits, RgbImage};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use yoto_formats::npy;
use yoto_formats::rle::RunLengths;
use yoto_media::video::{Ffmpeg, Hdr};
use yoto_proto::pose_track::{MAX_SIDE, violation};

/// Largest allocation of a decoder, bytes: a 16-bit image with alpha of the largest size.
const MAX_ALLOCATION: u64 = 8 * (MAX_SIDE as u64) * (MAX_SIDE as u64);

/// The pictures of a capture.
#[derive(Clone, Debug)]
pub enum Pictures {
    /// One image with its masks per frame.
    Files(Vec<PictureFiles>),
    /// A video, kept as it is, and the masks of each frame.
    Video {
        /// The file.
        video: PathBuf,
        /// In the track's order.
        masks: Vec<Vec<Mask>>,
    },
    /// Frames of a video with a wrong declaration of its light: they are decoded here, since the file tells nothing to other decoders.
    Decoded {
        /// The video.
        clip: DecodedClip,
        /// In the track's order.
        masks: Vec<Vec<Mask>>,
    },
    /// Frames of a capture, with their masks.
    Capture(CaptureFrames),
}

/// A video that is decoded for a capture.
#[derive(Clone, Debug)]
pub struct DecodedClip {
    pub(crate) path: PathBuf,
    pub(crate) ffmpeg: Ffmpeg,
    /// The light of its levels.
    pub(crate) hdr: Hdr,
}

/// The files of a frame.
#[derive(Clone, Debug)]
pub struct PictureFiles {
    /// The image.
    pub image: PathBuf,
    /// Masks whose union is the person.
    pub masks: Vec<Mask>,
    /// Whether the image shows the person over black already.
    pub over_black: bool,
}

/// A mask.
#[derive(Clone, Debug)]
pub enum Mask {
    /// An image.
    Image(PathBuf, MaskKind),
    /// A `.npy` of `[height, width]`, from 0 to 1.
    Array(PathBuf),
    /// One of a stack in an HDF5 file.
    #[cfg(feature = "hdf5")]
    Stack(MaskStack, usize),
    /// The alpha channel of an image.
    Alpha(PathBuf),
    /// The pixels of one colour of an image that gives every person a colour.
    Colour(PathBuf, [u8; 3]),
    /// Runs of pixels, as pose tools store them.
    Runs(Arc<RunLengths>),
    /// A frame of a video of masks: a grey PNG of coverage.
    Packed(Arc<[u8]>),
}

/// Meaning of a mask's levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaskKind {
    /// All levels but 0 are the person.
    Labels,
    /// 0 is background, the highest level the person, in between is both.
    Coverage,
}

/// Width and height of an image, by its header.
pub(crate) fn image_size(path: &Path, frame: u32) -> Result<[u32; 2], ImportError> {
    let (width, height) = reader(path, frame)?
        .into_dimensions()
        .map_err(|error| undecodable(path, frame, error.to_string()))?;
    Ok([width, height])
}

/// An image of `size` (width, height), 8 bits per channel.
pub(crate) fn read_image(path: &Path, size: [u32; 2], frame: u32) -> Result<RgbImage, ImportError> {
    sized(path, size, frame, image_size(path, frame)?)?;
    let image = reader(path, frame)?.decode();
    image
        .map(image::DynamicImage::into_rgb8)
        .map_err(|error| undecodable(path, frame, error.to_string()))
}

/// Whether the image has an alpha channel that is not the same everywhere, by which the person is cut out.
pub(crate) fn is_cut_out(path: &Path, frame: u32) -> Result<bool, ImportError> {
    let image = reader(path, frame)?.decode();
    let image = image.map_err(|error| undecodable(path, frame, error.to_string()))?;
    if !image.color().has_alpha() {
        return Ok(false);
    }
    let image = image.into_rgba8();
    let mut levels = image.pixels().map(|pixel| pixel.0[3]);
    let first = levels.next();
    Ok(levels.any(|level| Some(level) != first))
}

/// The union of masks of `size`.
pub(crate) fn read_masks(
    masks: &[Mask],
    size: [u32; 2],
    frame: u32,
) -> Result<GrayImage, ImportError> {
    let mut union = GrayImage::new(size[0], size[1]);
    for mask in masks {
        let levels = read_mask(mask, size, frame)?;
        for (to, from) in union.iter_mut().zip(levels) {
            *to = from.max(*to);
        }
    }
    Ok(union)
}

fn read_mask(mask: &Mask, size: [u32; 2], frame: u32) -> Result<Vec<u8>, ImportError> {
    match mask {
        Mask::Image(path, kind) => {
            let found = image_size(path, frame)?;
            alike(path, size, frame, found)?;
            let image = reader(path, frame)?.decode();
            let image = image.map_err(|error| undecodable(path, frame, error.to_string()))?;
            let levels = match kind {
                MaskKind::Coverage => image.into_luma8().into_raw(),
                // The first channel, since label images have three equal channels: a conversion
                // to grey may change a label.
                MaskKind::Labels => {
                    let rgb = image.into_rgb8().into_raw();
                    let any = |pixel: &[u8; 3]| 255 * u8::from(pixel[0] != 0);
                    rgb.as_chunks::<3>().0.iter().map(any).collect()
                }
            };
            Ok(resized(levels, found, size))
        }
        Mask::Alpha(path) => {
            let found = image_size(path, frame)?;
            alike(path, size, frame, found)?;
            let image = reader(path, frame)?.decode();
            let image = image.map_err(|error| undecodable(path, frame, error.to_string()))?;
            let levels = image
                .into_rgba8()
                .pixels()
                .map(|pixel| pixel.0[3])
                .collect();
            Ok(resized(levels, found, size))
        }
        Mask::Colour(path, colour) => {
            let found = image_size(path, frame)?;
            alike(path, size, frame, found)?;
            let image = read_image(path, found, frame)?.into_raw();
            let same = |pixel: &[u8; 3]| 255 * u8::from(pixel == colour);
            let levels = image.as_chunks::<3>().0.iter().map(same).collect();
            Ok(resized(levels, found, size))
        }
        Mask::Runs(runs) => {
            let found = [runs.width as u32, runs.height as u32];
            alike(Path::new("mask"), size, frame, found)?;
            Ok(resized(runs.decode(), found, size))
        }
        Mask::Packed(png) => {
            let image = image::load_from_memory_with_format(png, image::ImageFormat::Png);
            let name = Path::new("mask");
            let image = image.map_err(|error| undecodable(name, frame, error.to_string()))?;
            let found = [image.width(), image.height()];
            alike(name, size, frame, found)?;
            Ok(resized(image.into_luma8().into_raw(), found, size))
        }
        Mask::Array(path) => {
            let bytes = std::fs::read(path).map_err(ImportError::file("reading", path))?;
            let array = npy::read(&bytes)
                .map_err(|error| undecodable(path, frame, error.to_string()))?
                .numbers();
            let array = array
                .ok_or_else(|| undecodable(path, frame, "the array is not of numbers".into()))?;
            let [height, width] = array.shape[..] else {
                let message = format!("the shape is {:?}, [height, width] is needed", array.shape);
                return Err(undecodable(path, frame, message));
            };
            let found = [width as u32, height as u32];
            alike(path, size, frame, found)?;
            let level = |value: &f64| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
            Ok(resized(
                array.values.iter().map(level).collect(),
                found,
                size,
            ))
        }
        #[cfg(feature = "hdf5")]
        Mask::Stack(stack, at) => {
            sized(Path::new(stack.file()), size, frame, stack.size())?;
            stack
                .read(*at)
                .map_err(|message| undecodable(Path::new(stack.file()), frame, message))
        }
    }
}

fn reader(
    path: &Path,
    frame: u32,
) -> Result<ImageReader<std::io::BufReader<std::fs::File>>, ImportError> {
    let reader = ImageReader::open(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => {
            at_fault("MISSING", path, frame, "there is no such file".into())
        }
        _ => ImportError::file("reading", path)(error),
    })?;
    let mut reader = reader
        .with_guessed_format()
        .map_err(ImportError::file("reading", path))?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(MAX_ALLOCATION);
    reader.limits(limits);
    Ok(reader)
}

fn sized(path: &Path, size: [u32; 2], frame: u32, found: [u32; 2]) -> Result<(), ImportError> {
    if size == found {
        return Ok(());
    }
    let message = format!(
        "{}x{} pixels, the capture's images have {}x{}",
        found[0], found[1], size[0], size[1]
    );
    Err(at_fault("SIZE_MISMATCH", path, frame, message))
}

/// Largest difference of two shapes that are the same but for rounding, as a share.
const SAME_SHAPE: f64 = 0.01;

/// Whether masks of `found` (width, height) are of pictures of `size`, but for their resolution.
pub(crate) fn are_alike(found: [u32; 2], size: [u32; 2]) -> bool {
    let shape = |[width, height]: [u32; 2]| f64::from(width.max(1)) / f64::from(height.max(1));
    let ratio = shape(found) / shape(size);
    (ratio - 1.0).abs() <= SAME_SHAPE && found.iter().all(|side| *side > 0)
}

/// Checks that a mask has the shape of the capture's images.
fn alike(path: &Path, size: [u32; 2], frame: u32, found: [u32; 2]) -> Result<(), ImportError> {
    if are_alike(found, size) {
        return Ok(());
    }
    sized(path, size, frame, found)
}

/// Levels of `found` (width, height) at the resolution `size`, each of the nearest pixel: masks have sharp edges and labels.
fn resized(levels: Vec<u8>, found: [u32; 2], size: [u32; 2]) -> Vec<u8> {
    if found == size {
        return levels;
    }
    let [from_width, from_height] = found.map(|side| side as usize);
    let [width, height] = size.map(|side| side as usize);
    let from = |at: usize, of: usize, to: usize| (2 * at + 1) * of / (2 * to);
    let mut made = Vec::with_capacity(width * height);
    for y in 0..height {
        let row = from(y, from_height, height) * from_width;
        let level = |x: usize| levels.get(row + from(x, from_width, width)).copied();
        made.extend((0..width).map(|x| level(x).unwrap_or_default()));
    }
    made
}

fn undecodable(path: &Path, frame: u32, message: String) -> ImportError {
    at_fault("UNDECODABLE", path, frame, message)
}

fn at_fault(code: &str, path: &Path, frame: u32, message: String) -> ImportError {
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    let folder = path.parent().unwrap_or(Path::new(""));
    ImportError::BadCapture {
        place: folder.display().to_string(),
        violations: vec![violation(code, &file, Some(frame), "", message)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_of_another_resolution_are_made_as_large() {
        let made = resized(vec![0, 255], [2, 1], [4, 2]);
        assert_eq!(made, [0, 0, 255, 255, 0, 0, 255, 255]);
        assert_eq!(resized(made, [4, 2], [2, 1]), [0, 255]);
        assert!(are_alike([360, 640], [720, 1280]) && are_alike([719, 1279], [720, 1280]));
        assert!(!are_alike([1280, 720], [720, 1280]) && !are_alike([0, 0], [720, 1280]));
    }
}
