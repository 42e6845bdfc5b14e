//! One frame: colour premultiplied by coverage, and the coverage mask.

use super::CaptureError;
use crate::camera::fitted_size;
use image::{ColorType, DynamicImage, ImageDecoder, ImageReader, Limits};
use std::io::Cursor;
use yoto_proto::pose_track::violation;
use yoto_proto::v1::Violation;

/// What a decoder may allocate beyond the pixels themselves, bytes.
const DECODER_SLACK: u64 = 16 << 20;

/// A frame of 8-bit pixels, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameImage {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `[height, width, 3]`, premultiplied by coverage: the person over black. Over another
    /// background B a pixel is `rgb + (1 - mask) B`.
    pub rgb: Vec<u8>,
    /// `[height, width]`, coverage by the person, 0 to 255.
    pub mask: Vec<u8>,
}

impl FrameImage {
    /// A frame without a person.
    pub fn empty(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            rgb: vec![0; width * height * 3],
            mask: vec![0; width * height],
        }
    }

    /// Decodes a frame and its mask (PNG, or anything the build decodes).
    ///
    /// `expected` is the capture's width and height. They are compared with the declared size of the
    /// files before a pixel is decoded, so that a small file can't ask for gigabytes. `frame` and `names`
    /// (of the image file and the mask file) are for errors only. A mask may be empty.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] with one violation per faulty file: not decodable, of another size, an
    /// image that is not 8-bit RGB, or a mask that is not 8-bit gray.
    pub fn decode(
        image: &[u8],
        mask: &[u8],
        expected: [u32; 2],
        frame: u32,
        names: (&str, &str),
    ) -> Result<Self, CaptureError> {
        let rgb = decode_as(image, ColorType::Rgb8, expected, frame, names.0);
        let mask = decode_as(mask, ColorType::L8, expected, frame, names.1);
        match (rgb, mask) {
            (Ok(DynamicImage::ImageRgb8(rgb)), Ok(DynamicImage::ImageLuma8(mask))) => Ok(Self {
                width: expected[0] as usize,
                height: expected[1] as usize,
                rgb: rgb.into_raw(),
                mask: mask.into_raw(),
            }),
            (rgb, mask) => Err(CaptureError::Invalid(
                [rgb.err(), mask.err()].into_iter().flatten().collect(),
            )),
        }
    }

    /// This frame with its longest side reduced to `longest_side` pixels by exact area averaging:
    /// each pixel weighs as much as its overlap. Colours are premultiplied, so a plain average is right.
    /// 0 changes nothing, and frames never grow, as in [`fitted_size`], which cameras use too.
    pub fn resized(&self, longest_side: u32) -> Self {
        // The casts can't truncate: decoding limits sides far below u32's range.
        let side = |length: usize| u32::try_from(length).unwrap_or(u32::MAX);
        let (width, height) = fitted_size(side(self.width), side(self.height), longest_side);
        let (width, height) = (width as usize, height as usize);
        if (width, height) == (self.width, self.height) {
            return self.clone();
        }
        let columns = overlaps(self.width, width);
        let rows = overlaps(self.height, height);
        Self {
            width,
            height,
            rgb: average(&self.rgb, 3, self.width, &columns, &rows),
            mask: average(&self.mask, 1, self.width, &columns, &rows),
        }
    }
}

/// Decodes `bytes` if they hold `expected` pixels of `colour`.
fn decode_as(
    bytes: &[u8],
    colour: ColorType,
    expected: [u32; 2],
    frame: u32,
    name: &str,
) -> Result<DynamicImage, Violation> {
    let fault = |code, message: String| violation(code, name, Some(frame), "", message);
    let undecodable =
        |error: &dyn std::fmt::Display| fault("UNDECODABLE", format!("can't be decoded: {error}"));
    let [width, height] = expected;
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(u64::from(width) * u64::from(height) * 8 + DECODER_SLACK);
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| undecodable(&error))?;
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|error| undecodable(&error))?;
    if decoder.dimensions() != (width, height) {
        let (found_width, found_height) = decoder.dimensions();
        return Err(fault(
            "SIZE_MISMATCH",
            format!("{found_width}x{found_height} pixels, image_size says {width}x{height}"),
        ));
    }
    if decoder.color_type() != colour {
        let wanted = match colour {
            ColorType::L8 => "8-bit gray",
            _ => "8-bit RGB",
        };
        return Err(fault(
            "UNSUPPORTED_COLOUR",
            format!("{:?} pixels, {wanted} is needed", decoder.color_type()),
        ));
    }
    DynamicImage::from_decoder(decoder).map_err(|error| undecodable(&error))
}

/// For one target pixel along an axis: the first source pixel that it overlaps, and the share of the
/// target that each source pixel from there on fills.
type Overlap = (usize, Vec<f32>);

fn overlaps(source: usize, target: usize) -> Vec<Overlap> {
    let step = source as f64 / target as f64;
    (0..target)
        .map(|pixel| {
            let (from, to) = (pixel as f64 * step, (pixel + 1) as f64 * step);
            let first = from.floor() as usize;
            let last = (to.ceil() as usize).min(source);
            let shares = (first..last)
                .map(|at| {
                    let inside = to.min((at + 1) as f64) - from.max(at as f64);
                    (inside.max(0.0) / step) as f32
                })
                .collect();
            (first, shares)
        })
        .collect()
}

/// Averages interleaved `channels` over the overlaps, one axis after the other.
fn average(
    source: &[u8],
    channels: usize,
    width: usize,
    columns: &[Overlap],
    rows: &[Overlap],
) -> Vec<u8> {
    let mut target = Vec::with_capacity(rows.len() * columns.len() * channels);
    let mut blended = vec![0.0f32; width * channels];
    for (first_row, row_shares) in rows {
        blended.fill(0.0);
        let lines = source.chunks_exact(width * channels).skip(*first_row);
        for (share, line) in row_shares.iter().zip(lines) {
            for (sum, &value) in blended.iter_mut().zip(line) {
                *sum += share * f32::from(value);
            }
        }
        for (first, shares) in columns {
            for channel in 0..channels {
                let pixels = blended[first * channels + channel..]
                    .iter()
                    .step_by(channels);
                let sum: f32 = shares.iter().zip(pixels).map(|(s, v)| s * v).sum();
                target.push(sum.round() as u8);
            }
        }
    }
    target
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use yoto_proto::pose_track::describe;

    /// Encodes pixels as PNG.
    pub(crate) fn png(pixels: impl Into<DynamicImage>) -> Vec<u8> {
        let mut bytes = Vec::new();
        pixels
            .into()
            .write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png)
            .expect("encodes");
        bytes
    }

    fn fault(rgb: &[u8], mask: &[u8]) -> String {
        let error = FrameImage::decode(
            rgb,
            mask,
            [4, 3],
            7,
            ("frames/000007.png", "masks/000007.png"),
        )
        .expect_err("broken");
        error
            .violations()
            .iter()
            .map(describe)
            .collect::<Vec<_>>()
            .join("\n")
    }

    #[test]
    fn frames_decode_and_faults_name_file_and_frame() {
        let rgb = png(image::RgbImage::from_fn(4, 3, |x, y| {
            image::Rgb([x as u8, y as u8, 9])
        }));
        let mask = png(image::GrayImage::from_fn(4, 3, |x, _| {
            image::Luma([x as u8 * 50])
        }));
        let frame = FrameImage::decode(&rgb, &mask, [4, 3], 7, ("a", "b")).expect("decodes");
        assert_eq!((frame.width, frame.height), (4, 3));
        assert_eq!(frame.rgb[3 * (4 + 2)..][..3], [2, 1, 9]);
        assert_eq!(frame.mask[..4], [0, 50, 100, 150]);

        let wide = png(image::GrayImage::new(5, 3));
        let deep = png(image::ImageBuffer::<image::Luma<u16>, _>::new(4, 3));
        for (rgb, mask, expected) in [
            (
                &rgb,
                &wide,
                "masks/000007.png frame 7: 5x3 pixels, image_size says 4x3",
            ),
            (
                &rgb,
                &deep,
                "masks/000007.png frame 7: L16 pixels, 8-bit gray is needed",
            ),
            (
                &rgb,
                &rgb,
                "masks/000007.png frame 7: Rgb8 pixels, 8-bit gray",
            ),
            (
                &mask,
                &mask,
                "frames/000007.png frame 7: L8 pixels, 8-bit RGB",
            ),
            (
                &b"no image".to_vec(),
                &mask,
                "frames/000007.png frame 7: can't be decoded",
            ),
            (
                &rgb[..rgb.len() - 20].to_vec(),
                &mask,
                "frames/000007.png frame 7: can't be",
            ),
        ] {
            let found = fault(rgb, mask);
            assert!(found.starts_with(expected), "{found}");
            assert_eq!(found.lines().count(), 1);
        }
        assert_eq!(fault(b"", b"").lines().count(), 2);
    }

    #[test]
    fn a_file_that_claims_gigabytes_is_refused_before_decoding() {
        let mut bomb = png(image::RgbImage::new(4, 3));
        bomb[16..20].copy_from_slice(&60_000u32.to_be_bytes());
        bomb[20..24].copy_from_slice(&60_000u32.to_be_bytes());
        // The header's checksum, so that the size is believed.
        let crc = crc32(&bomb[12..29]);
        bomb[29..33].copy_from_slice(&crc.to_be_bytes());
        let found = fault(&bomb, &png(image::GrayImage::new(4, 3)));
        assert!(found.contains("60000x60000 pixels"), "{found}");
    }

    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| {
                (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg())
            })
        })
    }

    #[test]
    fn shrinking_averages_areas() {
        let image = FrameImage {
            width: 3,
            height: 1,
            rgb: vec![0, 30, 255, 100, 60, 255, 200, 90, 255],
            mask: vec![255, 0, 255],
        };
        // Two pixels of 1.5 source pixels each.
        let half = image.resized(2);
        assert_eq!((half.width, half.height), (2, 1));
        assert_eq!(half.rgb, vec![33, 40, 255, 167, 80, 255]);
        assert_eq!(half.mask, vec![170, 170]);
        assert_eq!(image.resized(0), image);
        assert_eq!(image.resized(9), image);
    }

    #[test]
    fn premultiplied_pixels_stay_under_their_mask() {
        let mask: Vec<u8> = (0..37 * 23).map(|i| (i * 89 % 256) as u8).collect();
        let rgb = mask.iter().flat_map(|&m| [m, m / 2, 0]).collect();
        let image = FrameImage {
            width: 37,
            height: 23,
            rgb,
            mask,
        };
        let small = image.resized(16);
        assert_eq!((small.width, small.height), (16, 10));
        for (pixel, &mask) in small.rgb.chunks(3).zip(&small.mask) {
            assert!(pixel.iter().all(|&v| v <= mask), "{pixel:?} over {mask}");
        }
        let mean = |m: &[u8]| m.iter().map(|&v| f64::from(v)).sum::<f64>() / m.len() as f64;
        assert!((mean(&small.mask) - mean(&image.mask)).abs() < 0.5);
    }
}
