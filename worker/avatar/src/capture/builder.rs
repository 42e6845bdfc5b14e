//! Making a shard, one decoded frame after the other.

use super::shard::{Crop, Header, MAGIC, PREFIX, Rect, Shard};
use super::{CaptureError, FrameImage};
use crate::evaluate::metrics::mask_box;
use yoto_proto::pose_track::PoseTrack;

/// Bytes of all crops together, at most: a trainer holds them in memory.
const MAX_BYTES: usize = 8 << 30;

/// Makes a [`Shard`] frame by frame, holding only the crops.
#[derive(Debug)]
pub struct ShardBuilder {
    header: Header,
    pixels: Vec<u8>,
}

impl ShardBuilder {
    /// A shard for `track`, whose frames [`ShardBuilder::push`] must follow.
    pub fn new(track: PoseTrack) -> Self {
        Self {
            header: Header {
                track,
                crops: Vec::new(),
            },
            pixels: Vec::new(),
        }
    }

    /// Appends the next frame, cropped to the mask's bounding box.
    ///
    /// # Errors
    /// [`CaptureError::Shard`] when the image has not the track's size, its buffers not the
    /// image's, the track has no frame left, or all crops together are too large.
    pub fn push(&mut self, image: &FrameImage) -> Result<(), CaptureError> {
        let Self {
            header: Header { track, crops },
            pixels,
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
        let rect = mask_box(&image.mask, width, height).map_or(Rect::default(), |found| Rect {
            x0: found.x0 as u32,
            y0: found.y0 as u32,
            width: (found.x1 - found.x0) as u32,
            height: (found.y1 - found.y0) as u32,
        });
        if pixels.len() + 4 * rect.width as usize * rect.height as usize > MAX_BYTES {
            return Err(CaptureError::Shard(format!(
                "frame {}: the cropped frames exceed {} GiB; send fewer or smaller ones",
                frame.index,
                MAX_BYTES >> 30
            )));
        }
        crops.push(Crop {
            rect,
            offset: pixels.len() as u64,
        });
        let rows = rect.y0 as usize..(rect.y0 + rect.height) as usize;
        let columns = rect.x0 as usize..(rect.x0 + rect.width) as usize;
        for row in rows.clone() {
            let at = row * width;
            pixels.extend_from_slice(&image.rgb[(at + columns.start) * 3..(at + columns.end) * 3]);
        }
        for row in rows {
            let at = row * width;
            pixels.extend_from_slice(&image.mask[at + columns.start..at + columns.end]);
        }
        Ok(())
    }

    /// The shard.
    ///
    /// # Errors
    /// [`CaptureError::Shard`] when frames are missing, [`CaptureError::Invalid`] when the
    /// track is invalid.
    pub fn finish(self) -> Result<Shard, CaptureError> {
        let Self { header, pixels } = self;
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
        let mut bytes = Vec::with_capacity(PREFIX + text.len() + pixels.len());
        bytes.extend_from_slice(MAGIC);
        bytes.extend_from_slice(&length.to_le_bytes());
        bytes.extend_from_slice(&text);
        bytes.extend_from_slice(&pixels);
        Ok(Shard {
            track: header.track,
            crops: header.crops,
            bytes,
            pixels_at: PREFIX + text.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::tests::track;

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
