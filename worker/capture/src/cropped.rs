//! Frames cropped to the person, in memory or in a file. Training reads one frame per step, and the films
//! of hundreds of people don't fit in memory.

use super::camera::fitted_size;
use super::{CaptureError, FrameImage, mask_box};
use memmap2::Mmap;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::ops::Deref;
use std::path::Path;
use std::sync::Arc;

/// Bytes per pixel: RGB and coverage.
pub(super) const PIXEL: usize = 4;

/// A rectangle of pixels inside a frame; empty (all zero) for a frame without a person.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rect {
    /// First column.
    pub x0: u32,
    /// First row.
    pub y0: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Rect {
    /// The box around the pixels of `image` that show the person.
    pub(super) fn around(image: &FrameImage) -> Self {
        mask_box(&image.mask, image.width, image.height).map_or(Self::default(), |found| Self {
            x0: found.x0 as u32,
            y0: found.y0 as u32,
            width: (found.x1 - found.x0) as u32,
            height: (found.y1 - found.y0) as u32,
        })
    }

    pub(super) fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    pub(super) fn is_inside(&self, size: [u32; 2]) -> bool {
        let fits = |from: u32, length: u32, side: u32| {
            from.checked_add(length).is_some_and(|end| end <= side)
        };
        fits(self.x0, self.width, size[0]) && fits(self.y0, self.height, size[1])
    }

    /// Writes the colours of `image` in this rectangle, and then their coverage.
    pub(super) fn write(
        &self,
        image: &FrameImage,
        to: &mut (impl Write + ?Sized),
    ) -> io::Result<()> {
        let rows = self.y0 as usize..(self.y0 + self.height) as usize;
        let columns = self.x0 as usize..(self.x0 + self.width) as usize;
        for row in rows.clone() {
            let at = row * image.width;
            to.write_all(&image.rgb[(at + columns.start) * 3..(at + columns.end) * 3])?;
        }
        for row in rows {
            let at = row * image.width;
            to.write_all(&image.mask[at + columns.start..at + columns.end])?;
        }
        Ok(())
    }
}

/// The crop of one frame: its rectangle in the image and its offset in the bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Crop {
    pub(super) rect: Rect,
    /// Byte offset of the crop after the first one's start.
    pub(super) offset: u64,
}

/// The bytes of crops.
#[derive(Clone, Debug)]
pub(super) enum Bytes {
    Memory(Arc<Vec<u8>>),
    /// An unlinked file, which the system pages in and out as memory allows.
    Mapped(Arc<Mmap>),
}

impl Bytes {
    /// All bytes of `file`, an unlinked file without any other handle.
    fn mapped(file: &File) -> io::Result<Self> {
        // An empty file can't be mapped everywhere.
        if file.metadata()?.len() == 0 {
            return Ok(Self::Memory(Arc::default()));
        }
        // SAFETY: the map is sound as long as nobody changes or shortens the file. It has no name by which
        // another process could open it, and no handle to it outlives this call.
        let map = unsafe { Mmap::map(file)? };
        Ok(Self::Mapped(Arc::new(map)))
    }
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Memory(bytes) => bytes,
            Self::Mapped(map) => map,
        }
    }
}

/// Frames of one size, each cropped to the person.
#[derive(Clone, Debug)]
pub struct CroppedFrames {
    /// Width and height of the frames.
    pub(super) size: [u32; 2],
    pub(super) crops: Vec<Crop>,
    pub(super) bytes: Bytes,
    /// Offset of the first crop in `bytes`.
    pub(super) pixels_at: usize,
}

impl PartialEq for CroppedFrames {
    fn eq(&self, other: &Self) -> bool {
        let pixels = |frames: &Self| frames.bytes[frames.pixels_at..].to_vec();
        self.size == other.size && self.crops == other.crops && pixels(self) == pixels(other)
    }
}

impl CroppedFrames {
    /// Number of frames.
    pub fn count(&self) -> usize {
        self.crops.len()
    }

    /// Width and height of the frames, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The rectangle of a frame's crop, its colours (`[height, width, 3]`, premultiplied) and its mask
    /// (`[height, width]`), without copying.
    ///
    /// # Panics
    /// If `frame` is not less than [`Self::count`].
    pub fn crop(&self, frame: usize) -> (Rect, &[u8], &[u8]) {
        let Crop { rect, offset } = self.crops[frame];
        let start = self.pixels_at + offset as usize;
        let bytes = &self.bytes[start..start + rect.pixels() * PIXEL];
        let (rgb, mask) = bytes.split_at(rect.pixels() * 3);
        (rect, rgb, mask)
    }

    /// A frame at its full size, black outside the crop.
    ///
    /// # Panics
    /// If `frame` is not less than [`Self::count`].
    pub fn image(&self, frame: usize) -> FrameImage {
        let [width, height] = self.size.map(|side| side as usize);
        let mut image = FrameImage::empty(width, height);
        let (rect, rgb, mask) = self.crop(frame);
        if rect.pixels() == 0 {
            return image;
        }
        let columns = rect.width as usize;
        let rows = rgb
            .chunks_exact(columns * 3)
            .zip(mask.chunks_exact(columns));
        for (row, (rgb, mask)) in rows.enumerate() {
            let at = (rect.y0 as usize + row) * width + rect.x0 as usize;
            image.rgb[at * 3..][..columns * 3].copy_from_slice(rgb);
            image.mask[at..][..columns].copy_from_slice(mask);
        }
        image
    }

    /// These frames with their longest side reduced to `longest_side` pixels, as in
    /// [`FrameImage::resized`]. They are in memory, or in an unlinked file in the folder `scratch`.
    ///
    /// # Errors
    /// [`CaptureError::Io`] with the folder, if the file can't be written.
    pub fn resized(&self, longest_side: u32, scratch: Option<&Path>) -> Result<Self, CaptureError> {
        let [width, height] = self.size;
        let (width, height) = fitted_size(width, height, longest_side);
        if [width, height] == self.size {
            return match scratch {
                Some(folder) => self.clone().kept_in(folder),
                None => Ok(self.clone()),
            };
        }
        let images = (0..self.count()).map(|frame| self.image(frame).resized(longest_side));
        let mut crops = Vec::with_capacity(self.count());
        let bytes = written(scratch, |to| {
            let mut offset = 0;
            for image in images {
                let rect = Rect::around(&image);
                crops.push(Crop { rect, offset });
                offset += (rect.pixels() * PIXEL) as u64;
                rect.write(&image, to)?;
            }
            Ok(())
        })?;
        Ok(Self {
            size: [width, height],
            crops,
            bytes,
            pixels_at: 0,
        })
    }

    /// These frames in an unlinked file in `folder`, unless they are already in a file.
    ///
    /// # Errors
    /// The same errors as [`Self::resized`].
    pub fn kept_in(mut self, folder: &Path) -> Result<Self, CaptureError> {
        if let Bytes::Memory(bytes) = &self.bytes {
            self.bytes = written(Some(folder), |to| to.write_all(bytes))?;
        }
        Ok(self)
    }
}

/// The bytes that `write` writes, in memory or in an unlinked file in the folder `scratch`.
fn written(
    scratch: Option<&Path>,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<Bytes, CaptureError> {
    let Some(folder) = scratch else {
        let mut bytes = Vec::new();
        write(&mut bytes).map_err(|source| failed(Path::new("memory"), source))?;
        return Ok(Bytes::Memory(Arc::new(bytes)));
    };
    let file = || {
        let mut file = BufWriter::new(tempfile::tempfile_in(folder)?);
        write(&mut file)?;
        Bytes::mapped(&file.into_inner()?)
    };
    file().map_err(|source| failed(folder, source))
}

fn failed(path: &Path, source: io::Error) -> CaptureError {
    CaptureError::Io {
        path: path.to_owned(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ShardBuilder;
    use crate::test_support::track;

    /// Three frames of 6x4 pixels with a person in columns 2..4 and rows 1..3, nobody in the second.
    fn frames() -> CroppedFrames {
        let mut builder = ShardBuilder::new(track(3, [6, 4]));
        for value in [Some(11), None, Some(33)] {
            let mut image = FrameImage::empty(6, 4);
            for at in [8, 9, 14, 15] {
                let Some(value) = value else { continue };
                image.mask[at] = 200;
                image.rgb[at * 3..][..3].copy_from_slice(&[value, at as u8, 0]);
            }
            builder.push(&image).expect("fits");
        }
        builder.finish().expect("complete").cropped().clone()
    }

    #[test]
    fn frames_in_a_file_are_those_in_memory() {
        let folder = tempfile::tempdir().expect("a folder");
        let memory = frames();
        let file = memory.clone().kept_in(folder.path()).expect("written");
        assert!(matches!(file.bytes, Bytes::Mapped(_)));
        assert_eq!(file, memory);
        for frame in 0..3 {
            assert_eq!(file.image(frame), memory.image(frame));
        }
        let names = std::fs::read_dir(folder.path()).expect("a folder").count();
        assert_eq!(names, 0, "the file has no name");
        folder.close().expect("nothing keeps the folder");
        assert_eq!(
            file.crop(2),
            memory.crop(2),
            "and is there as long as its frames"
        );
    }

    #[test]
    fn smaller_frames_are_those_that_resizing_gives() {
        let folder = tempfile::tempdir().expect("a folder");
        let whole = frames();
        for scratch in [None, Some(folder.path())] {
            let small = whole.resized(3, scratch).expect("written");
            assert_eq!(small.size(), [3, 2]);
            for frame in 0..3 {
                assert_eq!(small.image(frame), whole.image(frame).resized(3));
            }
            let same = whole.resized(0, scratch).expect("written");
            assert_eq!(same, whole);
            assert_eq!(matches!(same.bytes, Bytes::Mapped(_)), scratch.is_some());
        }
    }

    #[test]
    fn frames_without_a_person_need_no_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut builder = ShardBuilder::new(track(1, [6, 4]));
        builder.push(&FrameImage::empty(6, 4)).expect("fits");
        let shard = builder.finish().expect("complete");
        let small = shard
            .cropped()
            .resized(3, Some(folder.path()))
            .expect("fits");
        assert_eq!(small.image(0), FrameImage::empty(3, 2));
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let error = frames().kept_in(Path::new("/no/such/folder"));
        let error = error.expect_err("no folder").to_string();
        assert!(error.starts_with("/no/such/folder: "), "{error}");
    }
}
