//! Writes an imported capture as a capture folder.
//!
//! `frames/%06d.png` are premultiplied by their masks (the person over black), so that training
//! can use any background; distorted ones stay distorted, for ingest to correct with the coefficients
//! in the pose track. The pose track is written last: a folder with one is complete.

use crate::clip::{Clip, for_each};
use crate::pictures::{Mask, PictureFiles, Pictures, read_image, read_masks};
use crate::{ImportError, Imported};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, GrayImage, ImageEncoder, RgbImage};
use std::borrow::Borrow;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use yoto_capture::FrameImage;
use yoto_media::video::remove_tags;
use yoto_proto::pose_track::{BINARY_FILE, FILE, FILES, Frame, PoseTrack};

/// Folders of a capture's pictures and of their masks.
const PICTURES: [&str; 2] = ["frames", "masks"];
/// Name of a video in a capture folder.
pub const VIDEO: &str = "video.mp4";

/// Form of the pose track.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TrackForm {
    /// `poses.json`.
    #[default]
    Json,
    /// `poses.pb`: protocol buffers.
    Binary,
}

/// Writes a capture folder to `out`; `progress` receives frames done, all frames, and bytes written
/// so far.
///
/// # Errors
/// [`ImportError::BadCapture`] when `out` holds a capture already or a picture can't be decoded or
/// has another size, [`ImportError::File`] when the file system fails.
pub fn write(
    imported: &Imported,
    out: &Path,
    form: TrackForm,
    mut progress: impl FnMut(usize, usize, u64),
) -> Result<u64, ImportError> {
    ensure_no_capture(out)?;
    for folder in PICTURES {
        let folder = out.join(folder);
        if folder.ends_with("masks") || !matches!(imported.pictures, Pictures::Video { .. }) {
            std::fs::create_dir_all(&folder).map_err(ImportError::file("making", folder))?;
        }
    }
    let track = &imported.track;
    let (size, total) = (track.image_size, track.frames.len());
    let mut bytes = 0;
    match &imported.pictures {
        Pictures::Files(files) => {
            for (done, (frame, files)) in track.frames.iter().zip(files).enumerate() {
                progress(done, total, bytes);
                bytes += write_frame(out, frame, files, size)?;
            }
        }
        Pictures::Video { video, masks } => {
            let to = out.join(VIDEO);
            bytes += copy(video, &to).map_err(ImportError::file("copying", video))?;
            remove_tags(&to).map_err(ImportError::file("removing the tags of", &to))?;
            for (done, (frame, masks)) in track.frames.iter().zip(masks).enumerate() {
                progress(done, total, bytes);
                if !masks.is_empty() {
                    let mask = read_masks(masks, size, frame.index)?;
                    bytes += write_mask(out, frame.index, &mask)?;
                }
            }
        }
        Pictures::Decoded { clip, masks } => {
            let wanted: Vec<usize> = track.frames.iter().map(|it| it.index as usize).collect();
            let mut each = track.frames.iter().zip(masks).enumerate();
            for_each(&Clip::again(clip)?, &wanted, |_, rgb| {
                let (Some(image), Some((done, (frame, masks)))) = (
                    RgbImage::from_raw(size[0], size[1], rgb.to_vec()),
                    each.next(),
                ) else {
                    return Ok(());
                };
                progress(done, total, bytes);
                bytes += write_picture(out, frame, image, masks, false, size)?;
                Ok(())
            })?;
        }
        Pictures::Capture(frames) => {
            let mut indices = track.frames.iter().map(|frame| frame.index);
            let mut done = 0;
            frames.for_each(|image| {
                let Some(index) = indices.next() else {
                    return Ok(());
                };
                progress(done, total, bytes);
                bytes += write_image(out, index, &image)?;
                done += 1;
                Ok(())
            })?;
        }
    }
    progress(total, total, bytes);
    Ok(bytes + write_track(track, out, form)?)
}

/// Copies a file's content. `std::fs::copy` also gives it the permissions, which the process that reads uploads may not change.
fn copy(from: &Path, to: &Path) -> std::io::Result<u64> {
    std::io::copy(&mut File::open(from)?, &mut File::create(to)?)
}

/// Writes a capture with these `images`, one for each frame of `track`, to the folder `out`, over an earlier one; the
/// paths of its files.
///
/// # Errors
/// [`ImportError::File`] when the file system fails.
pub fn write_images(
    track: &PoseTrack,
    images: impl IntoIterator<Item = impl Borrow<FrameImage>>,
    out: &Path,
) -> Result<Vec<PathBuf>, ImportError> {
    let mut paths = Vec::new();
    for folder in PICTURES {
        let folder = out.join(folder);
        std::fs::create_dir_all(&folder).map_err(ImportError::file("making", folder))?;
    }
    for (frame, image) in track.frames.iter().zip(images) {
        write_image(out, frame.index, image.borrow())?;
        paths.extend(PICTURES.map(|folder| picture(out, folder, frame.index)));
    }
    write_track(track, out, TrackForm::Json)?;
    paths.push(out.join(FILE));
    Ok(paths)
}

/// Checks that the folder `out` holds no capture.
///
/// # Errors
/// [`ImportError::Unusable`] when it does.
pub fn ensure_no_capture(out: &Path) -> Result<(), ImportError> {
    if FILES.iter().any(|name| out.join(name).exists()) {
        return Err(ImportError::Unusable(format!(
            "{} already holds a capture",
            out.display()
        )));
    }
    Ok(())
}

/// Writes the pose track of the capture in `out`; its bytes.
fn write_track(track: &PoseTrack, out: &Path, form: TrackForm) -> Result<u64, ImportError> {
    let (name, text) = match form {
        TrackForm::Json => {
            let text = serde_json::to_vec(track).map_err(std::io::Error::other);
            (
                FILE,
                text.map_err(ImportError::file("writing", out.join(FILE)))?,
            )
        }
        TrackForm::Binary => (BINARY_FILE, track.to_binary()),
    };
    let path = out.join(name);
    std::fs::write(&path, &text).map_err(ImportError::file("writing", path))?;
    Ok(text.len() as u64)
}

/// Writes a picture that is in memory, and its mask; their bytes.
fn write_image(out: &Path, index: u32, image: &FrameImage) -> Result<u64, ImportError> {
    let size = [image.width as u32, image.height as u32];
    let mut bytes = 0;
    let [frames, masks] = PICTURES;
    for (folder, pixels, colour) in [
        (frames, &image.rgb, ExtendedColorType::Rgb8),
        (masks, &image.mask, ExtendedColorType::L8),
    ] {
        let path = picture(out, folder, index);
        bytes += encode(&path, pixels, size, colour)?;
    }
    Ok(bytes)
}

fn write_frame(
    out: &Path,
    frame: &Frame,
    files: &PictureFiles,
    size: [u32; 2],
) -> Result<u64, ImportError> {
    let image = read_image(&files.image, size, frame.index)?;
    write_picture(out, frame, image, &files.masks, files.over_black, size)
}

/// Writes a picture with the union of its masks; their bytes.
fn write_picture(
    out: &Path,
    frame: &Frame,
    mut image: RgbImage,
    masks: &[Mask],
    is_over_black: bool,
    size: [u32; 2],
) -> Result<u64, ImportError> {
    let mut written = 0;
    // Without masks the picture stays as it is: the capture gets them from elsewhere.
    if !masks.is_empty() {
        let mask = read_masks(masks, size, frame.index)?;
        if !is_over_black {
            over_black(&mut image, &mask);
        }
        written += write_mask(out, frame.index, &mask)?;
    }
    let path = picture(out, PICTURES[0], frame.index);
    Ok(written + encode(&path, image.as_raw(), size, ExtendedColorType::Rgb8)?)
}

fn write_mask(out: &Path, index: u32, mask: &GrayImage) -> Result<u64, ImportError> {
    let path = picture(out, PICTURES[1], index);
    let (width, height) = mask.dimensions();
    encode(&path, mask.as_raw(), [width, height], ExtendedColorType::L8)
}

/// Each colour times its coverage, rounded to the nearest level.
fn over_black(image: &mut RgbImage, mask: &GrayImage) {
    let (pixels, _) = image.as_flat_samples_mut().samples.as_chunks_mut::<3>();
    for (pixel, coverage) in pixels.iter_mut().zip(mask.iter()) {
        for level in pixel {
            let product = u32::from(*level) * u32::from(*coverage);
            *level = ((product + 127) / 255) as u8;
        }
    }
}

/// Path of a frame's picture or mask in the capture folder `out`.
fn picture(out: &Path, folder: &str, index: u32) -> PathBuf {
    out.join(folder).join(format!("{index:06}.png"))
}

/// Writes an image as PNG; its bytes.
fn encode(
    path: &Path,
    pixels: &[u8],
    size: [u32; 2],
    colour: ExtendedColorType,
) -> Result<u64, ImportError> {
    let failed = || ImportError::file("writing", path);
    let mut file = BufWriter::new(File::create(path).map_err(failed())?);
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Adaptive)
        .write_image(pixels, size[0], size[1], colour)
        .map_err(|error| failed()(std::io::Error::other(error)))?;
    file.flush().map_err(failed())?;
    let meta = file.get_ref().metadata().map_err(failed())?;
    Ok(meta.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Findings, Options};
    use yoto_media::video::Hdr;

    /// Frames 1 and 3 of a clip that declares HLG, as they come out of a capture: none, if its video is copied.
    fn written(hdr: Hdr) -> Option<[Vec<u8>; 2]> {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let path = here.join("../../worker/media/tests/clips/hlg.mp4");
        let options = Options {
            hdr,
            ..Options::default()
        };
        let clip = Clip::open(&path, &options).expect("a clip");
        let mut track = crate::track::empty_track(
            crate::track::smpl_skeleton(vec![[0.0; 3]; 24]),
            clip.size,
            30.0,
        );
        track.frames = [1, 3]
            .map(|index| Frame {
                index,
                pose: vec![0.0; 72],
                translation: [0.0; 3],
                k: [[1.0; 3]; 3],
                e: [[0.0; 4]; 4],
            })
            .to_vec();
        let imported = Imported {
            track,
            pictures: clip.pictures(&[1, 3], vec![Vec::new(); 2]),
            available: 4,
            notes: Vec::new(),
            found: Findings::default(),
        };
        let out = tempfile::tempdir().expect("a folder");
        write(&imported, out.path(), TrackForm::Json, |_, _, _| {}).expect("writes");
        if out.path().join(VIDEO).exists() {
            return None;
        }
        let picture = |index: u32| {
            let path = out.path().join(format!("frames/{index:06}.png"));
            let read = read_image(&path, clip.size, index);
            read.expect("a picture").into_raw()
        };
        Some([picture(1), picture(3)])
    }

    #[test]
    fn a_video_whose_declaration_is_not_believed_is_decoded() {
        assert_eq!(written(Hdr::Auto), None);
        let [off, hlg] = [Hdr::Off, Hdr::Hlg].map(|hdr| written(hdr).expect("pictures"));
        assert_ne!(off, hlg);
        assert_ne!(off[0], off[1]);
    }

    #[test]
    fn colour_fades_with_coverage() {
        let mut image = RgbImage::from_pixel(3, 1, image::Rgb([200, 100, 255]));
        let mask = GrayImage::from_raw(3, 1, vec![255, 0, 128]).expect("three pixels");
        over_black(&mut image, &mask);
        assert_eq!(image.as_raw()[..], [200, 100, 255, 0, 0, 0, 100, 50, 128]);
    }
}
