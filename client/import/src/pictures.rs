//! Pictures of a capture, and their decoding.

use crate::capture_frames::CaptureFrames;
#[cfg(feature = "hdf5")]
use crate::source::hdf5::MaskStack;
use image::{GrayImage, ImageReader, Limits, RgbImage};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use yoto_client::ClientError;
use yoto_formats::npy;
use yoto_formats::rle::RunLengths;
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
    /// Frames of a capture, with their masks.
    Capture(CaptureFrames),
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
pub(crate) fn image_size(path: &Path, frame: u32) -> Result<[u32; 2], ClientError> {
    let (width, height) = reader(path, frame)?
        .into_dimensions()
        .map_err(|error| undecodable(path, frame, error.to_string()))?;
    Ok([width, height])
}

/// An image of `size` (width, height), 8 bits per channel.
pub(crate) fn read_image(path: &Path, size: [u32; 2], frame: u32) -> Result<RgbImage, ClientError> {
    sized(path, size, frame, image_size(path, frame)?)?;
    let image = reader(path, frame)?.decode();
    image
        .map(image::DynamicImage::into_rgb8)
        .map_err(|error| undecodable(path, frame, error.to_string()))
}

/// The union of masks of `size`.
pub(crate) fn read_masks(
    masks: &[Mask],
    size: [u32; 2],
    frame: u32,
) -> Result<GrayImage, ClientError> {
    let mut union = GrayImage::new(size[0], size[1]);
    for mask in masks {
        let levels = read_mask(mask, size, frame)?;
        for (to, from) in union.iter_mut().zip(levels) {
            *to = from.max(*to);
        }
    }
    Ok(union)
}

fn read_mask(mask: &Mask, size: [u32; 2], frame: u32) -> Result<Vec<u8>, ClientError> {
    match mask {
        Mask::Image(path, kind) => {
            sized(path, size, frame, image_size(path, frame)?)?;
            let image = reader(path, frame)?.decode();
            let image = image.map_err(|error| undecodable(path, frame, error.to_string()))?;
            Ok(match kind {
                MaskKind::Coverage => image.into_luma8().into_raw(),
                // The first channel, since label images have three equal channels: a conversion
                // to grey may change a label.
                MaskKind::Labels => {
                    let rgb = image.into_rgb8().into_raw();
                    let any = |pixel: &[u8; 3]| 255 * u8::from(pixel[0] != 0);
                    rgb.as_chunks::<3>().0.iter().map(any).collect()
                }
            })
        }
        Mask::Colour(path, colour) => {
            let image = read_image(path, size, frame)?.into_raw();
            let same = |pixel: &[u8; 3]| 255 * u8::from(pixel == colour);
            Ok(image.as_chunks::<3>().0.iter().map(same).collect())
        }
        Mask::Runs(runs) => {
            let name = Path::new("mask");
            sized(name, size, frame, [runs.width as u32, runs.height as u32])?;
            Ok(runs.decode())
        }
        Mask::Packed(png) => {
            let image = image::load_from_memory_with_format(png, image::ImageFormat::Png);
            let name = Path::new("mask");
            let image = image.map_err(|error| undecodable(name, frame, error.to_string()))?;
            sized(name, size, frame, [image.width(), image.height()])?;
            Ok(image.into_luma8().into_raw())
        }
        Mask::Array(path) => {
            let bytes = std::fs::read(path).map_err(ClientError::file("reading", path))?;
            let array = npy::read(&bytes)
                .map_err(|error| undecodable(path, frame, error.to_string()))?
                .numbers();
            let array = array
                .ok_or_else(|| undecodable(path, frame, "the array is not of numbers".into()))?;
            let [height, width] = array.shape[..] else {
                let message = format!("the shape is {:?}, [height, width] is needed", array.shape);
                return Err(undecodable(path, frame, message));
            };
            sized(path, size, frame, [width as u32, height as u32])?;
            let level = |value: &f64| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
            Ok(array.values.iter().map(level).collect())
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
) -> Result<ImageReader<std::io::BufReader<std::fs::File>>, ClientError> {
    let reader = ImageReader::open(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => {
            at_fault("MISSING", path, frame, "there is no such file".into())
        }
        _ => ClientError::file("reading", path)(error),
    })?;
    let mut reader = reader
        .with_guessed_format()
        .map_err(ClientError::file("reading", path))?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(MAX_ALLOCATION);
    reader.limits(limits);
    Ok(reader)
}

fn sized(path: &Path, size: [u32; 2], frame: u32, found: [u32; 2]) -> Result<(), ClientError> {
    if size == found {
        return Ok(());
    }
    let message = format!(
        "{}x{} pixels, the capture's images have {}x{}",
        found[0], found[1], size[0], size[1]
    );
    Err(at_fault("SIZE_MISMATCH", path, frame, message))
}

fn undecodable(path: &Path, frame: u32, message: String) -> ClientError {
    at_fault("UNDECODABLE", path, frame, message)
}

fn at_fault(code: &str, path: &Path, frame: u32, message: String) -> ClientError {
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    let folder = path.parent().unwrap_or(Path::new(""));
    ClientError::BadCapture {
        place: folder.display().to_string(),
        violations: vec![violation(code, &file, Some(frame), "", message)],
    }
}
