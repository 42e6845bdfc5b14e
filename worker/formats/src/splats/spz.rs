//! `.spz` files (Niantic's `spz`, version 3): splats in 20 bytes each, and 9 or 24 more for view-dependent colours,
//! compressed.

use super::{Gaussian, harmonics};
use flate2::Compression;
use flate2::write::GzEncoder;
use std::f32::consts::SQRT_2;
use std::io::{self, Write};

/// "NGSP".
const MAGIC: u32 = 0x5053_474e;
/// The first version with quaternions of four bytes.
const VERSION: u32 = 3;
/// Fractional bits of a coordinate: steps of 15 µm, in rooms of 256 m.
const FRACTION: u8 = 16;
/// Largest whole number of a coordinate, which has 24 bits.
const FARTHEST: f32 = 8_388_607.0;
/// Number of harmonics of degree 1.
const FIRST: usize = 3;
/// Scale of a coefficient of degree 0, in steps of 255.
const COLOURS: f32 = 0.15;
/// Largest stored value of the three small parts of a quaternion, which are at most √½.
const PART: f32 = 511.0;

/// Writes `splats`: y up, z towards the viewer.
///
/// # Errors
/// If writing fails, or there are 2³² splats or more.
pub fn write(to: impl Write, splats: &[Gaussian]) -> io::Result<()> {
    let count = u32::try_from(splats.len()).map_err(io::Error::other)?;
    let mut to = GzEncoder::new(to, Compression::best());
    for number in [MAGIC, VERSION, count] {
        to.write_all(&number.to_le_bytes())?;
    }
    let harmonics = harmonics(splats);
    let degree = match harmonics {
        0 => 0,
        FIRST => 1,
        _ => 2,
    };
    // No flags.
    to.write_all(&[degree, FRACTION, 0, 0])?;
    for splat in splats {
        for value in splat.mean {
            let fixed = (value * f32::from(2u8).powi(FRACTION.into())).round();
            let [a, b, c, _] = (fixed.clamp(-FARTHEST, FARTHEST) as i32).to_le_bytes();
            to.write_all(&[a, b, c])?;
        }
    }
    for splat in splats {
        to.write_all(&[byte(255.0 * splat.opacity)])?;
    }
    for splat in splats {
        let bytes = splat
            .harmonic()
            .map(|value| byte(255.0 * (COLOURS * value + 0.5)));
        to.write_all(&bytes)?;
    }
    for splat in splats {
        to.write_all(
            &splat
                .deviations
                .map(|value| byte((value.ln() + 10.0) * 16.0)),
        )?;
    }
    for splat in splats {
        to.write_all(&smallest_three(splat.rotation).to_le_bytes())?;
    }
    for splat in splats {
        for (k, harmonic) in splat.harmonics[..harmonics].iter().enumerate() {
            let bits = if k < FIRST { 5 } else { 4 };
            to.write_all(&harmonic.map(|value| coarse(value, bits)))?;
        }
    }
    to.finish()?.flush()
}

/// The nearest whole number from 0 to 255.
fn byte(value: f32) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

/// A coefficient from -1 to 1 in the upper `bits` of a byte; 128 means 0.
fn coarse(value: f32, bits: u32) -> u8 {
    let step = f32::from(1u8 << (8 - bits));
    byte(step * ((128.0 * value + 128.0) / step).round())
}

/// A unit quaternion without its largest part, which follows from the others: its index in 2 bits, then a sign and 9 bits
/// for each other part, in the order x, y, z, w.
fn smallest_three([w, x, y, z]: [f32; 4]) -> u32 {
    let parts = [x, y, z, w];
    let larger = |best: usize, i: usize| {
        if parts[i].abs() > parts[best].abs() {
            i
        } else {
            best
        }
    };
    let largest = (0..4).fold(0, larger);
    let mut packed = largest as u32;
    for (i, part) in parts.iter().enumerate().filter(|(i, _)| *i != largest) {
        debug_assert!(i < 4);
        // The negative quaternion is the same rotation, so the largest part can always be positive.
        let negative = (*part < 0.0) != (parts[largest] < 0.0);
        let size = (PART * part.abs() * SQRT_2).round().min(PART) as u32;
        packed = packed << 10 | u32::from(negative) << 9 | size;
    }
    packed
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::read::GzDecoder;
    use std::io::Read;

    /// The quaternion, unpacked like in Niantic's reader.
    fn unpacked(mut packed: u32) -> [f32; 4] {
        let largest = (packed >> 30) as usize;
        let mut parts = [0.0f32; 4];
        let mut squares = 0.0;
        for i in (0..4).rev().filter(|i| *i != largest) {
            parts[i] = (packed & 511) as f32 / 511.0 / SQRT_2;
            if packed & 512 != 0 {
                parts[i] = -parts[i];
            }
            squares += parts[i] * parts[i];
            packed >>= 10;
        }
        parts[largest] = (1.0 - squares).sqrt();
        let [x, y, z, w] = parts;
        [w, x, y, z]
    }

    #[test]
    fn quaternions_come_back_up_to_their_sign() {
        for turn in [
            [1.0, 0.0, 0.0, 0.0],
            [0.5, 0.5, -0.5, 0.5],
            [0.1, -0.7, 0.7, 0.1],
            [-0.2, 0.3, 0.1, -0.9],
        ] {
            let length = turn.iter().map(|q| q * q).sum::<f32>().sqrt();
            let turn = turn.map(|q| q / length);
            let back = unpacked(smallest_three(turn));
            let alike: f32 = turn.iter().zip(back).map(|(one, other)| one * other).sum();
            assert!(alike.abs() > 1.0 - 3e-6, "{turn:?} {back:?}");
        }
    }

    #[test]
    fn harmonics_follow_as_far_as_any_splat_has_them() {
        let plain = Gaussian {
            mean: [0.0; 3],
            rotation: [1.0, 0.0, 0.0, 0.0],
            deviations: [0.1; 3],
            opacity: 0.6,
            colour: [0.5; 3],
            harmonics: [[0.0; 3]; 8],
        };
        let (mut first, mut second) = (plain, plain);
        first.harmonics[2] = [0.5, -0.25, 0.02];
        second.harmonics[7] = [-1.0, 0.11, 3.0];
        for (splats, bytes, degree) in [
            ([plain, plain], 20, 0),
            ([plain, first], 29, 1),
            ([first, second], 44, 2),
        ] {
            let mut file = Vec::new();
            write(&mut file, &splats).expect("writes");
            let mut out = Vec::new();
            let mut reader = GzDecoder::new(file.as_slice());
            reader.read_to_end(&mut out).expect("gzip");
            assert_eq!(out.len(), 16 + 2 * bytes);
            assert_eq!(out[12], degree);
            let own = &out[out.len() - bytes + 20..];
            match degree {
                1 => assert_eq!(own, [128, 128, 128, 128, 128, 128, 192, 96, 128]),
                2 => assert_eq!(own[21..], [0, 144, 255]),
                _ => (),
            }
        }
    }

    #[test]
    fn parts_stand_in_their_order() {
        let splat = Gaussian {
            mean: [1.0, -2.0, 0.5],
            rotation: [1.0, 0.0, 0.0, 0.0],
            deviations: [1.0, 0.1, 0.01],
            opacity: 0.6,
            colour: [0.5, 1.0, 0.0],
            harmonics: [[0.0; 3]; 8],
        };
        let mut file = Vec::new();
        write(&mut file, &[splat, splat]).expect("writes");
        let mut bytes = Vec::new();
        GzDecoder::new(file.as_slice())
            .read_to_end(&mut bytes)
            .expect("gzip");
        assert_eq!(bytes.len(), 16 + 2 * 20);
        assert_eq!(&bytes[..4], b"NGSP");
        let fixed =
            |at: usize| i32::from_le_bytes([0, bytes[at], bytes[at + 1], bytes[at + 2]]) >> 8;
        assert_eq!(
            [fixed(16), fixed(19), fixed(22)],
            [1 << 16, -2 << 16, 1 << 15]
        );
        assert_eq!(bytes[16 + 18], 153);
        assert_eq!(&bytes[36..39], &[128, 195, 60]);
        assert_eq!(&bytes[42..45], &[160, 123, 86]);
        assert_eq!(&bytes[48..52], &[0, 0, 0, 0b1100_0000]);
    }
}
