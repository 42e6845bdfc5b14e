//! The training shard: one capture in one blob, decoded and cropped to the person.
//!
//! A person covers a tenth of a frame, so the crops of a capture are small beside its frames, and
//! training reads pixels without decoding anything. Layout:
//! `YOTOSHD1`, the header's length (u32, little-endian), the header as JSON (pose track and
//! crops), then per frame the crop's RGB bytes and its mask bytes.

use super::cropped::{Bytes, Crop, CroppedFrames, PIXEL, Rect};
use super::{CaptureError, FrameImage};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;
use yoto_proto::pose_track::{PoseTrack, describe};

pub(super) const MAGIC: &[u8; 8] = b"YOTOSHD1";
/// Magic and header length.
pub(super) const PREFIX: usize = MAGIC.len() + 4;

/// The header, before the pixels.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Header {
    pub(super) track: PoseTrack,
    pub(super) crops: Vec<Crop>,
}

/// A capture that is ready for training: a checked view of a shard's bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct Shard {
    /// Skeleton, poses and cameras; checked. Changing it changes nothing in the bytes.
    pub track: PoseTrack,
    /// All bytes, and the crops' offsets in them.
    pub(super) frames: CroppedFrames,
}

impl Shard {
    /// Reads a shard and checks all of it, so that no access to a frame can fail later.
    ///
    /// # Errors
    /// [`CaptureError::Shard`] if the bytes are not a shard or cut short, the header is not JSON, its pose
    /// track is invalid, or a crop is outside its image or outside the bytes.
    pub fn from_bytes(bytes: impl Into<Vec<u8>>) -> Result<Self, CaptureError> {
        let bytes: Vec<u8> = bytes.into();
        let fail = |what: String| CaptureError::Shard(what);
        let (prefix, rest) = bytes
            .split_at_checked(PREFIX)
            .ok_or_else(|| fail(format!("{} bytes are too few for one", bytes.len())))?;
        let (magic, header_length) = prefix.split_at(MAGIC.len());
        if magic != MAGIC {
            return Err(fail("the first bytes are not YOTOSHD1".into()));
        }
        let header_length = header_length
            .iter()
            .rev()
            .fold(0usize, |sum, &byte| sum << 8 | usize::from(byte));
        let (header, pixels) = rest.split_at_checked(header_length).ok_or_else(|| {
            fail(format!(
                "the header should have {header_length} bytes, {} are left",
                rest.len()
            ))
        })?;
        let header: Header =
            serde_json::from_slice(header).map_err(|error| fail(format!("header: {error}")))?;
        if let Some(violation) = header.track.check().first() {
            return Err(fail(format!("header: {}", describe(violation))));
        }
        check_crops(&header, pixels.len()).map_err(fail)?;
        Ok(Self {
            frames: CroppedFrames {
                size: header.track.image_size,
                crops: header.crops,
                bytes: Bytes::Memory(Arc::new(bytes)),
                pixels_at: PREFIX + header_length,
            },
            track: header.track,
        })
    }

    /// The bytes that [`Shard::from_bytes`] reads back.
    pub fn to_bytes(&self) -> Vec<u8> {
        self.frames.bytes.to_vec()
    }

    /// This shard with its bytes in an unlinked file in `folder`, which frees memory.
    ///
    /// # Errors
    /// [`CaptureError::Io`] with the folder, if the file can't be written.
    pub fn kept_in(self, folder: &Path) -> Result<Self, CaptureError> {
        Ok(Self {
            frames: self.frames.kept_in(folder)?,
            ..self
        })
    }

    /// The frames without the track.
    pub fn cropped(&self) -> &CroppedFrames {
        &self.frames
    }

    /// Number of frames, which is also the length of `track.frames`.
    pub fn frames(&self) -> usize {
        self.frames.count()
    }

    /// The crop of a frame, as in [`CroppedFrames::crop`].
    ///
    /// # Panics
    /// If `frame` is not less than [`Shard::frames`].
    pub fn crop(&self, frame: usize) -> (Rect, &[u8], &[u8]) {
        self.frames.crop(frame)
    }

    /// A frame at its full size, black outside the crop.
    ///
    /// # Panics
    /// If `frame` is not less than [`Shard::frames`].
    pub fn image(&self, frame: usize) -> FrameImage {
        self.frames.image(frame)
    }
}

/// Checks that every crop is inside its image, that crops follow each other without gaps, and that no
/// bytes are left over.
fn check_crops(header: &Header, bytes: usize) -> Result<(), String> {
    let frames = &header.track.frames;
    if header.crops.len() != frames.len() {
        return Err(format!(
            "{} crops for {} frames",
            header.crops.len(),
            frames.len()
        ));
    }
    let mut end = 0u64;
    for (crop, frame) in header.crops.iter().zip(frames) {
        let index = frame.index;
        if !crop.rect.is_inside(header.track.image_size) {
            return Err(format!("frame {index}: its crop leaves the image"));
        }
        if crop.offset != end {
            return Err(format!(
                "frame {index}: its crop is said to start at byte {}, not {end}",
                crop.offset
            ));
        }
        end += (crop.rect.pixels() * PIXEL) as u64;
        if end > bytes as u64 {
            return Err(format!("frame {index}: its pixels are cut short"));
        }
    }
    if end != bytes as u64 {
        return Err(format!(
            "{} bytes follow the last frame",
            bytes as u64 - end
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ShardBuilder;
    use crate::test_support::track;

    /// A 6x4 frame with a person in columns 2..4 and rows 1..3, told apart by `value`.
    fn frame(value: u8) -> FrameImage {
        let mut image = FrameImage::empty(6, 4);
        for (x, y) in [(2, 1), (3, 1), (2, 2), (3, 2)] {
            image.mask[y * 6 + x] = 200;
            image.rgb[(y * 6 + x) * 3..][..3].copy_from_slice(&[value, x as u8, y as u8]);
        }
        image
    }

    fn shard() -> Shard {
        let mut builder = ShardBuilder::new(track(3, [6, 4]));
        for image in [frame(11), FrameImage::empty(6, 4), frame(33)] {
            builder.push(&image).expect("fits");
        }
        builder.finish().expect("complete")
    }

    #[test]
    fn frames_come_back_from_bytes() {
        let shard = Shard::from_bytes(shard().to_bytes()).expect("reads");
        assert_eq!(shard.frames(), 3);
        assert_eq!(shard.track, track(3, [6, 4]));
        assert_eq!(shard.image(0), frame(11));
        assert_eq!(shard.image(1), FrameImage::empty(6, 4));
        assert_eq!(shard.image(2), frame(33));
        let (rect, rgb, mask) = shard.crop(2);
        let expected = Rect {
            x0: 2,
            y0: 1,
            width: 2,
            height: 2,
        };
        assert_eq!((rect, mask), (expected, &[200u8; 4][..]));
        assert_eq!(rgb[..6], [33, 2, 1, 33, 3, 1]);
        assert_eq!(shard.crop(1).0, Rect::default());
    }

    #[test]
    fn every_truncation_is_refused() {
        let bytes = shard().to_bytes();
        for length in 0..bytes.len() {
            assert!(
                Shard::from_bytes(&bytes[..length]).is_err(),
                "{length} bytes"
            );
        }
        let mut longer = bytes;
        longer.push(0);
        assert!(Shard::from_bytes(longer).is_err());
    }

    #[test]
    fn forged_headers_are_refused_with_their_reason() {
        let good = shard();
        let reason = |break_it: &dyn Fn(&mut Header)| {
            let mut header = Header {
                track: good.track.clone(),
                crops: good.frames.crops.clone(),
            };
            break_it(&mut header);
            let text = serde_json::to_vec(&header).expect("writes");
            let mut bytes = MAGIC.to_vec();
            bytes.extend_from_slice(&(text.len() as u32).to_le_bytes());
            bytes.extend_from_slice(&text);
            bytes.extend_from_slice(&good.frames.bytes[good.frames.pixels_at..]);
            Shard::from_bytes(bytes).expect_err("forged").to_string()
        };
        for (found, expected) in [
            (
                reason(&|h| h.crops[2].offset = u64::MAX),
                "frame 2: its crop is said to start",
            ),
            (
                reason(&|h| h.crops[0].rect.x0 = 5),
                "frame 0: its crop leaves the image",
            ),
            (
                reason(&|h| h.crops[0].rect.width = u32::MAX),
                "frame 0: its crop leaves the image",
            ),
            (
                reason(&|h| h.crops[2].rect.height = 3),
                "frame 2: its pixels are cut short",
            ),
            (
                reason(&|h| h.crops[2].rect.height = 1),
                "8 bytes follow the last frame",
            ),
            (reason(&|h| h.crops.truncate(1)), "1 crops for 3 frames"),
            (
                reason(&|h| h.track.frames[1].pose.truncate(2)),
                "header: poses.json frame 1: pose",
            ),
        ] {
            assert_eq!(
                found
                    .strip_prefix("training shard: ")
                    .map(|f| f.starts_with(expected)),
                Some(true),
                "{found}"
            );
        }

        let mut bytes = good.to_bytes();
        bytes[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
        let error = Shard::from_bytes(bytes).expect_err("a header of 4 GiB");
        assert!(error.to_string().contains("should have 4294967295 bytes"));
        let error = Shard::from_bytes(b"PNG".repeat(9)).expect_err("no shard");
        assert!(error.to_string().contains("not YOTOSHD1"));
    }
}
