//! Films in `.mp4` files: H.264, which browsers and phones play.

use muxide::api::{Muxer, MuxerBuilder, MuxerError, VideoCodec};
use openh264::encoder::{
    Encoder, EncoderConfig, FrameRate, FrameType, IntraFramePeriod, RateControlMode, VuiConfig,
};
use openh264::formats::YUVBuffer;
use openh264::{OpenH264API, Timestamp};
use std::io::Write;

/// Frames from one key frame to the next. Players can only jump to a key frame.
const KEY_FRAMES: u32 = 30;

/// A film that can't be written.
#[derive(Debug, thiserror::Error)]
pub enum FilmError {
    /// A width or height of 0.
    #[error("a film of {0} x {1} pixels")]
    Size(usize, usize),
    /// A picture that does not have the film's size.
    #[error("a picture of {found} bytes in a film of {expected} per picture")]
    Picture {
        /// Bytes of the picture.
        found: usize,
        /// Bytes of a picture of the film.
        expected: usize,
    },
    /// The encoder.
    #[error("encoding the film")]
    Encode(#[from] openh264::Error),
    /// The file.
    #[error("writing the film")]
    Write(#[from] MuxerError),
}

/// A film that is being written.
pub struct Film<W: Write> {
    muxer: Muxer<W>,
    encoder: Encoder,
    /// Width and height of the pictures.
    size: [usize; 2],
    fps: f64,
    frames: u32,
}

impl<W: Write> Film<W> {
    /// An empty film of `width` x `height` pixels and `fps` frames per second. H.264 has only even sides, so the
    /// last row or column of an odd size is repeated.
    ///
    /// # Errors
    /// If the encoder fails, or a side is 0.
    pub fn new(to: W, width: usize, height: usize, fps: f64) -> Result<Self, FilmError> {
        if width == 0 || height == 0 {
            return Err(FilmError::Size(width, height));
        }
        let [wide, high] = even([width, height]);
        let config = EncoderConfig::new()
            // With a rate to keep, the encoder leaves out frames that are hard to compress.
            .rate_control_mode(RateControlMode::Off)
            .skip_frames(false)
            .max_frame_rate(FrameRate::from_hz(fps as f32))
            .intra_frame_period(IntraFramePeriod::from_num_frames(KEY_FRAMES))
            // The coding that `planes` computes, so that players need not guess it.
            .vui(VuiConfig::bt601());
        let encoder = Encoder::with_api_config(OpenH264API::from_source(), config)?;
        let muxer = MuxerBuilder::new(to)
            .video(VideoCodec::H264, wide as u32, high as u32, fps)
            .with_fast_start(true)
            .build()?;
        Ok(Self {
            muxer,
            encoder,
            size: [width, height],
            fps,
            frames: 0,
        })
    }

    /// Adds a picture: red, green and blue, row by row.
    ///
    /// # Errors
    /// If the picture has another size, or the encoder or the file fails.
    pub fn push(&mut self, rgb: &[u8]) -> Result<(), FilmError> {
        let [width, height] = self.size;
        let expected = 3 * width * height;
        if rgb.len() != expected {
            let found = rgb.len();
            return Err(FilmError::Picture { found, expected });
        }
        let [wide, high] = even(self.size);
        let mut padded = Vec::with_capacity(3 * wide * high);
        for row in (0..high).map(|row| row.min(height - 1)) {
            let row = &rgb[3 * width * row..3 * width * (row + 1)];
            padded.extend(row);
            padded.extend(&row[3 * (width - 1)..][..3 * (wide - width)]);
        }
        let yuv = YUVBuffer::from_vec(planes(&padded, wide), wide, high);
        let seconds = f64::from(self.frames) / self.fps;
        let moment = Timestamp::from_millis((1000.0 * seconds) as u64);
        let frame = self.encoder.encode_at(&yuv, moment)?;
        let alone = matches!(frame.frame_type(), FrameType::IDR | FrameType::I);
        self.muxer.write_video(seconds, &frame.to_vec(), alone)?;
        self.frames += 1;
        Ok(())
    }

    /// Writes the rest of the file.
    ///
    /// # Errors
    /// If writing fails, or there are no pictures.
    pub fn finish(self) -> Result<(), FilmError> {
        Ok(self.muxer.finish()?)
    }
}

/// Luma of each pixel, then both chromas of each block of 2x2 pixels (ITU-R BT.601, 16 to 235). Values are
/// rounded: the encoder's own conversion truncates, which darkens pictures by two levels.
fn planes(rgb: &[u8], width: usize) -> Vec<u8> {
    let pixels = rgb.as_chunks::<3>().0;
    let level = |[r, g, b]: [f32; 3], [kr, kg, kb]: [f32; 3], zero: f32| {
        (zero + (kr * r + kg * g + kb * b) / 255.0)
            .round()
            .clamp(0.0, 255.0) as u8
    };
    let mut planes: Vec<u8> = pixels
        .iter()
        .map(|pixel| level(pixel.map(f32::from), [65.481, 128.553, 24.966], 16.0))
        .collect();
    let rows = pixels.len() / width / 2;
    for chroma in [[-37.797, -74.203, 112.0], [112.0, -93.786, -18.214]] {
        for row in 0..rows {
            for column in 0..width / 2 {
                let first = 2 * (row * width + column);
                let four = [first, first + 1, first + width, first + width + 1];
                let mean =
                    |c: usize| four.iter().map(|at| f32::from(pixels[*at][c])).sum::<f32>() / 4.0;
                planes.push(level([mean(0), mean(1), mean(2)], chroma, 128.0));
            }
        }
    }
    planes
}

/// The sides, rounded up to even numbers.
fn even(size: [usize; 2]) -> [usize; 2] {
    size.map(|length| length.next_multiple_of(2))
}
