//! Animated PNG: lossless, one file, supported by browsers in an `<img>`.

use super::{Pixels, PngError, check_size};
use std::io::Write;

/// Fastest animation, frames per second.
pub const MAX_FPS: f32 = 1000.0;

/// Writes a repeating animation frame by frame, so that memory holds only encoded bytes.
pub struct Animation<W: Write> {
    writer: ::png::Writer<W>,
    kind: Pixels,
    width: u32,
    height: u32,
}

impl<W: Write> Animation<W> {
    /// Starts an animation of exactly `frames` frames.
    ///
    /// # Errors
    /// When `frames` is 0, or `fps` is not above 0 and at most [`MAX_FPS`].
    pub fn new(
        out: W,
        kind: Pixels,
        (width, height): (u32, u32),
        frames: u32,
        fps: f32,
    ) -> Result<Self, PngError> {
        let (numerator, denominator) = delay(fps)?;
        let mut encoder = ::png::Encoder::new(out, width, height);
        encoder.set_color(kind.colour());
        encoder.set_depth(::png::BitDepth::Eight);
        encoder.set_animated(frames, 0)?;
        encoder.set_frame_delay(numerator, denominator)?;
        encoder.validate_sequence(true);
        Ok(Self {
            writer: encoder.write_header()?,
            kind,
            width,
            height,
        })
    }

    /// Adds a frame, row by row.
    ///
    /// # Errors
    /// When the pixels don't fit the size, or the writer fails.
    pub fn push(&mut self, pixels: &[u8]) -> Result<(), PngError> {
        check_size(self.kind, self.width, self.height, pixels)?;
        Ok(self.writer.write_image_data(pixels)?)
    }

    /// Writes the end.
    ///
    /// # Errors
    /// When there were fewer frames than announced, or the writer fails.
    pub fn finish(self) -> Result<(), PngError> {
        Ok(self.writer.finish()?)
    }
}

/// A frame's duration as the fraction of a second that APNG stores: exact for whole rates,
/// to the nearest millisecond or better otherwise.
fn delay(fps: f32) -> Result<(u16, u16), PngError> {
    if !(fps > 0.0 && fps <= MAX_FPS) {
        return Err(PngError::Fps(fps));
    }
    if fps.fract() == 0.0 {
        return Ok((1, fps as u16));
    }
    let unit = if fps >= 1.0 { 10_000.0 } else { 1000.0 };
    Ok((
        (unit / fps).round().clamp(1.0, f32::from(u16::MAX)) as u16,
        unit as u16,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_animation_decodes_to_its_frames_and_delays() {
        let frames: Vec<Vec<u8>> = (0..4u8).map(|i| vec![i * 60; 6 * 2 * 3]).collect();
        let mut bytes = Vec::new();
        let mut animation =
            Animation::new(&mut bytes, Pixels::Rgb, (6, 2), 4, 15.0).expect("starts");
        for frame in &frames {
            animation.push(frame).expect("a frame");
        }
        animation.finish().expect("ends");

        let mut reader = ::png::Decoder::new(std::io::Cursor::new(&bytes))
            .read_info()
            .expect("decodes");
        let control = *reader.info().animation_control().expect("animated");
        assert_eq!((control.num_frames, control.num_plays), (4, 0));
        for frame in &frames {
            let mut pixels = vec![0; reader.output_buffer_size().expect("fits")];
            reader.next_frame(&mut pixels).expect("a frame");
            let shown = reader.info().frame_control().expect("timed");
            assert_eq!((shown.delay_num, shown.delay_den), (1, 15));
            assert_eq!(&pixels, frame);
        }
        assert!(reader.next_frame(&mut [0; 36]).is_err(), "no fifth frame");
    }

    #[test]
    fn a_missing_frame_is_an_error() {
        let mut bytes = Vec::new();
        let mut animation =
            Animation::new(&mut bytes, Pixels::Rgb, (1, 1), 2, 1.0).expect("starts");
        animation.push(&[1, 2, 3]).expect("a frame");
        assert!(animation.finish().is_err());
    }

    #[test]
    fn odd_rates_are_kept_and_impossible_ones_refused() {
        assert_eq!(delay(12.5).expect("a rate"), (800, 10_000));
        assert_eq!(delay(0.25).expect("a rate"), (4000, 1000));
        for fps in [0.0, -1.0, f32::NAN, f32::INFINITY, 1001.0] {
            assert!(matches!(delay(fps), Err(PngError::Fps(_))), "{fps}");
        }
    }
}
