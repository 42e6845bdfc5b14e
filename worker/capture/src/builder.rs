//! Making a shard, one decoded frame after the other.

use super::cropped::{Bytes, Crop, CroppedFrames, PIXEL, Rect};
use super::shard::{Header, MAGIC, PREFIX, Shard};
use super::{CaptureError, FrameImage};
use std::io::Write;
use std::sync::Arc;
use yoto_proto::pose_track::{PoseTrack, violation};

/// Bytes of all crops together, at most: a whole shard is in memory for a moment.
const MAX_BYTES: usize = 8 << 30;

/// Makes a [`Shard`] frame by frame. Crops are written to `W`: memory, or a file if the shard is only
/// to be stored.
#[derive(Debug)]
pub struct ShardBuilder<W = Vec<u8>> {
    header: Header,
    pixels: W,
    length: usize,
}

impl ShardBuilder {
    /// A builder in memory for `track`. [`ShardBuilder::push`] takes the frames in the track's order.
    pub fn new(track: PoseTrack) -> Self {
        Self::writing_to(Vec::new(), track)
    }

    /// The finished shard.
    ///
    /// # Errors
    /// [`CaptureError::Shard`] if frames are missing, [`CaptureError::Invalid`] if the track is invalid.
    pub fn finish(self) -> Result<Shard, CaptureError> {
        let (head, crops, track, pixels) = self.head()?;
        let pixels_at = head.len();
        let mut bytes = head;
        bytes.extend_from_slice(&pixels);
        Ok(Shard {
            frames: CroppedFrames {
                size: track.image_size,
                crops,
                bytes: Bytes::Memory(Arc::new(bytes)),
                pixels_at,
            },
            track,
        })
    }
}

impl<W: Write> ShardBuilder<W> {
    /// A builder that writes the crops to `pixels`. The head from [`ShardBuilder::finish_head`] belongs
    /// before them.
    pub fn writing_to(pixels: W, track: PoseTrack) -> Self {
        Self {
            header: Header {
                track,
                crops: Vec::new(),
            },
            pixels,
            length: 0,
        }
    }

    /// The bytes before the crops, and the writer of the crops. Head and crops together are a shard.
    ///
    /// # Errors
    /// The same errors as [`ShardBuilder::finish`].
    pub fn finish_head(self) -> Result<(Vec<u8>, W), CaptureError> {
        let (head, _, _, pixels) = self.head()?;
        Ok((head, pixels))
    }

    /// Appends the next frame, cropped to the mask's bounding box.
    ///
    /// # Errors
    /// [`CaptureError::Shard`] if the image's size is not the track's, a buffer's length is not the
    /// image's, or the track has no frame left; [`CaptureError::Invalid`], without a file name, if all
    /// crops together are too large.
    pub fn push(&mut self, image: &FrameImage) -> Result<(), CaptureError> {
        let Self {
            header: Header { track, crops },
            pixels,
            length,
        } = self;
        let Some(frame) = track.frames.get(crops.len()) else {
            return Err(CaptureError::Shard(format!(
                "more images than the {} frames of its pose track",
                crops.len()
            )));
        };
        let [width, height] = track.image_size.map(|side| side as usize);
        let sizes = (image.width, image.height, image.rgb.len(), image.mask.len());
        if sizes != (width, height, width * height * 3, width * height) {
            return Err(CaptureError::Shard(format!(
                "frame {}: a {}x{} image with {} colour and {} mask bytes, image_size says \
                 {width}x{height}",
                frame.index, sizes.0, sizes.1, sizes.2, sizes.3
            )));
        }
        let rect = Rect::around(image);
        let bytes = rect.pixels() * PIXEL;
        if *length + bytes > MAX_BYTES {
            let message = format!(
                "the cropped frames exceed {} GiB; send fewer or smaller ones",
                MAX_BYTES >> 30
            );
            // Only the caller knows the frame's file.
            let fault = violation("TOO_LARGE", "", Some(frame.index), "", message);
            return Err(CaptureError::Invalid(vec![fault]));
        }
        crops.push(Crop {
            rect,
            offset: *length as u64,
        });
        *length += bytes;
        let written = rect.write(image, pixels);
        written.map_err(|error| CaptureError::Shard(format!("writing the crops: {error}")))
    }

    /// Magic and header as bytes, the header's parts, and the writer, after a check that no frame is
    /// missing.
    fn head(self) -> Result<(Vec<u8>, Vec<Crop>, PoseTrack, W), CaptureError> {
        let Self { header, pixels, .. } = self;
        let violations = header.track.check();
        if !violations.is_empty() {
            return Err(CaptureError::Invalid(violations));
        }
        let (images, frames) = (header.crops.len(), header.track.frames.len());
        if images != frames {
            return Err(CaptureError::Shard(format!(
                "{images} images for {frames} frames"
            )));
        }
        let text = serde_json::to_vec(&header)
            .map_err(|error| CaptureError::Shard(format!("header: {error}")))?;
        let length = u32::try_from(text.len())
            .map_err(|_| CaptureError::Shard("the header is over 4 GiB".into()))?;
        let mut head = Vec::with_capacity(PREFIX + text.len());
        head.extend_from_slice(MAGIC);
        head.extend_from_slice(&length.to_le_bytes());
        head.extend_from_slice(&text);
        Ok((head, header.crops, header.track, pixels))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::track;

    #[test]
    fn head_and_crops_apart_are_the_same_shard() {
        let mut whole = ShardBuilder::new(track(2, [6, 4]));
        let mut apart = ShardBuilder::writing_to(Vec::new(), track(2, [6, 4]));
        for level in [90, 200] {
            let mut image = FrameImage::empty(6, 4);
            image.mask[8..10].fill(level);
            image.rgb[24..30].fill(level / 2);
            whole.push(&image).expect("fits");
            apart.push(&image).expect("fits");
        }
        let (mut bytes, pixels) = apart.finish_head().expect("complete");
        bytes.extend(pixels);
        assert_eq!(bytes, whole.finish().expect("complete").to_bytes());
    }

    #[test]
    fn builders_refuse_what_does_not_fit() {
        let mut builder = ShardBuilder::new(track(1, [6, 4]));
        assert!(builder.push(&FrameImage::empty(4, 6)).is_err());
        let mut short = FrameImage::empty(6, 4);
        short.rgb.pop();
        assert!(builder.push(&short).is_err());
        builder.push(&FrameImage::empty(6, 4)).expect("fits");
        assert!(
            builder.push(&FrameImage::empty(6, 4)).is_err(),
            "one frame too many"
        );
        let missing = ShardBuilder::new(track(1, [6, 4])).finish();
        assert!(matches!(missing, Err(CaptureError::Shard(_))));
    }
}
